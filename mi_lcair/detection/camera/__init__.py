"""A staring infrared camera: optics, electrons, noise, calibration and measures of its quality."""
