"""Paths of `bounce_path`: launches, the walk, its sums, and errors that are not noise."""
