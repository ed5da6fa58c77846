"""Remarks on a loaded scene that point out possible errors of its image."""
