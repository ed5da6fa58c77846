"""A target at a sensor: scenario, contrast, range, camera, sweeps and flights."""
