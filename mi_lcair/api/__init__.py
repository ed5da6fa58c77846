"""Public functions: they resolve names, load, plan and call."""
