"""What `bounce_path` records along its paths, and the errors of it that no number of paths lowers."""
