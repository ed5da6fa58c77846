"""Motions: turns, shifts and changes of size of the meshes of a loaded scene, by name."""
