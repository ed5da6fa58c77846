"""How a command is used: examples in its help, and completion in the shell."""
