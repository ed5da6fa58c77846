"""The thesis's methods and ours, one a file, behind one interface for each question."""
