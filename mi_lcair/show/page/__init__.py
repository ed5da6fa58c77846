"""Report pages: one HTML file for each, with pictures to hover and turn, and no network."""
