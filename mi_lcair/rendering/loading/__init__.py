"""Checks of a scene file, and what is derived from it, when it is loaded."""
