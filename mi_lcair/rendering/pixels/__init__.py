"""Pixels of an image: their errors, and how paths are shared among them."""
