"""Reflection models, one a file, and the interface that they share."""
