"""The physics: Planck's law, bands, atmospheres, materials and reflection models.

It uses Dr.Jit and NumPy, and never imports Mitsuba.
"""
