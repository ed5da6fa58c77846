"""Facets as a labelled Wavefront OBJ (thesis 3.2.2): one object per label
`{f|s|t}*{material}*{kelvin}*{anything}`.
"""

from mi_lcair.scenes.build.bodies import Facet


def wavefront(facets: list[Facet], comment: str) -> str:
    """The text of an OBJ. Objects follow in the order in which their labels first appear;
    coordinates in m, to 1 um.

    Corners that print alike are one vertex. The bytes depend on the facets alone: no date, no
    version.
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
    # Rounding also hides the last bits of sine and cosine, which differ between processors; + 0.0
    # turns -0 into 0.
    return "v " + " ".join(f"{round(coordinate, 6) + 0.0:.6f}" for coordinate in point)
