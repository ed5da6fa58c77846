"""Derivatives with respect to motions: differences of renders whose paths share their numbers."""
