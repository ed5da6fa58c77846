"""Emitters: one plugin a file, and what they share."""
