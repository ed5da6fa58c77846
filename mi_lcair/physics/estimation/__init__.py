"""Estimation of parameters, for fits, inversions and poses: profiles, correlations, verdicts."""
