"""How certain a number is, and what measurements say: budgets and inversions."""
