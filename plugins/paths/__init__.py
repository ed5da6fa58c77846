"""Quantities that `bounce_path` records along its paths, and its errors that are not noise."""
