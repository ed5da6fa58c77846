"""Directions drawn toward emitting panels: by what they send, and by solid angle."""
