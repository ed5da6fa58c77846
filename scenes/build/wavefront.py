"""Facets as a labelled Wavefront OBJ (thesis 3.2.2).

There is one object per label `{f|s|t}*{material}*{kelvin}*{anything}`.
"""

from mi_lcair.scenes.build.bodies import Facet


def wavefront(facets: list[Facet], comment: str) -> str:
    """Return the text of an OBJ file.

    Objects are in the order in which their labels first appear. Coordinates are in m, rounded to
    1 um. Corners with the same rounded coordinates become one vertex. The text has no date and no
    version, so that it depends only on the facets and the comment.
    """
    numbers, objects = {}, {}
    for label, corners in facets:
        indices = [
            numbers.setdefault(_vertex(corner), len(numbers) + 1) for corner in corners.tolist()
        ]
        objects.setdefault(label, []).append("f " + " ".join(map(str, indices)))
    lines = [f"# {line}" for line in comment.splitlines()] + list(numbers)
    for label, faces in objects.items():
        lines += [f"o {label}", *faces]
    return "\n".join(lines) + "\n"


def _vertex(point):
    # The last bits of sine and cosine differ between processors. Rounding removes them. Adding 0.0
    # turns -0 into 0.
    return "v " + " ".join(f"{round(coordinate, 6) + 0.0:.6f}" for coordinate in point)
