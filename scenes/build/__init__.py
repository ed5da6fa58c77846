"""The facet models of the bundled scenes, built from dimensions.

`python -m mi_lcair.scenes.build FOLDER` writes each as a labelled OBJ. Lengths are in metres. Axes:
x forward (nose), y left, z up; the origin is the middle of the model's bounding box in x, and lies
on the axis in y and z.
"""
