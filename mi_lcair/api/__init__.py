"""Thin public functions: they find the scene and call the implementation."""
