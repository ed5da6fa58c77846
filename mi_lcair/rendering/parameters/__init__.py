"""Parameters of a loaded scene by name: values, bounds, patterns of temperatures, solutions."""
