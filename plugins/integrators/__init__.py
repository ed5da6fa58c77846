"""Integrators: one plugin a file."""
