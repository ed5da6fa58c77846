"""How many reflections a tolerance needs."""
