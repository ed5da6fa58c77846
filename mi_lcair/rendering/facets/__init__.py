"""Facets of a loaded scene as polygons and as a model."""
