"""A target that a camera has seen once, put at other ranges."""
