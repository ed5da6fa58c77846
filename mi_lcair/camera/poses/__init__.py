"""Where a camera is: its pose from points whose pixels are known."""
