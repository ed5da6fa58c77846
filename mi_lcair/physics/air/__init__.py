"""Clear air by LOWTRAN7's band model: paths, sky by night and by day, and sun, at any height.

`levels` holds the air by height and other weather, `bands` the spectral coefficients, `ray` the way
of light through the air, `light` light that has crossed air, and `clear_air` what a sensor sees
along a ray. The amounts of absorbers add where light crosses two paths one after the other; the
optical depths of the paths do not. The tables' headers and tables/README.md state the source.
"""
