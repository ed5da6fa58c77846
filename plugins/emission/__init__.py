"""Emission of a scene: emissivities, sources, and the table for sampling emitters."""
