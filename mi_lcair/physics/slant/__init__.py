"""Air along slant paths, up and down, and the geometry of their lines of sight."""
