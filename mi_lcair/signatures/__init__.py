"""Intensities of a scene: signature, effective areas, facets, trends."""
