"""What is shown of results: pictures, pages, and the kinds of files."""
