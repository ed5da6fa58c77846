"""Numbers that a budget is drawn up for, and what they depend on."""
