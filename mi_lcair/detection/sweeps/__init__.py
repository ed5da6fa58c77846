"""Sweeps: signatures over tables of conditions, of which only new geometry is traced."""
