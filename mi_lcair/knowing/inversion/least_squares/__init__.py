"""Predictions with derivatives, normal equations without bias, and their solution."""
