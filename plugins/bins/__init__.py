"""Bins of wavelength: what the paths of a scene with spectral materials carry and sum."""
