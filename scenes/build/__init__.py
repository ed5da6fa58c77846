"""Scripts that build the facet models of the bundled scenes from their dimensions.

`python -m mi_lcair.scenes.build FOLDER` writes each model as a labelled OBJ. Lengths are in m. The
x axis points forward (nose), y left, z up. The origin lies on the model's axis, at the middle of
its length.
"""
