"""Uncertainty budgets: what an intensity or a contrast owes to each uncertain quantity."""
