"""Sky and ground around a scene: spectral and in-band radiance that arrives from any direction."""
