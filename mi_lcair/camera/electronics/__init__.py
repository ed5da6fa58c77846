"""What a detector array makes of radiance: electrons, noise, frames and their correction."""
