"""Derivatives of the radiance of a scene with respect to its parameters."""
