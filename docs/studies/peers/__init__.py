"""The same jobs in other tools and in mi_lcair, side by side."""
