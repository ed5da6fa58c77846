"""Temperatures of single facets, and patterns of them."""
