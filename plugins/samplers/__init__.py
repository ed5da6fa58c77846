"""Samplers: one plugin a file."""
