"""Derivatives of an intensity with respect to all vertices of a group at once."""
