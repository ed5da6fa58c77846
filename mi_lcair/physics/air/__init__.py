"""Clear air by LOWTRAN7's band model: paths, sky by night and by day, and sun, at any height.

`levels` holds the air by height, other weather and the spectral coefficients. `clear_air` follows
rays through the air and computes what a sensor sees along them. `atmosphere` has light that has
crossed air, and `tape7` reads files of MODTRAN and LOWTRAN. The amounts of absorbers add where
light crosses two paths one after the other; the optical depths of the paths do not. The tables'
headers and tables/README.md state the source.
"""
