"""Public functions: they resolve names, load and call."""
