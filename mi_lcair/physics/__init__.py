"""The physics: Dr.Jit and NumPy, no Mitsuba."""
