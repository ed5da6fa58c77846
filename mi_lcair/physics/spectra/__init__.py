"""Materials whose parameters depend on wavelength: their files, their averages and their bins."""
