"""The sun: its position, its light through the air, and the sky that it lights."""
