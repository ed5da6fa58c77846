"""Temperatures of objects from the apparent temperatures that a camera shows."""
