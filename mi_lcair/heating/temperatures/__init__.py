"""Temperatures of facets from their heat balance: steady, and over a day."""
