"""Charts of error against computing time: the methods of Harkiss 2007 and those of this project.

Each method is one file. `reflectance` integrates a BRDF over the hemisphere, `propagation` computes
the intensity of a scene, and `throughput` compares the integrator's speed with Mitsuba's own.
"""
