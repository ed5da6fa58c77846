"""Effective emissivity of cavities, the sources of blackbody radiation in laboratories."""
