"""Commands on files: pictures of them, and conversions to files of other programs."""
