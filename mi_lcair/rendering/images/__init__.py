"""Radiance images: rendered, through air, and in files."""
