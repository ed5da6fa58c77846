"""Recorders of a walk: what is noted along each path, one kind in each file."""
