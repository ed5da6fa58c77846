"""The facet models, read from the text of their OBJs, and the geometry of polyhedra.

Lengths are in m. `stacked_volume` computes a volume from cross sections alone. It does not use the
order of the corners, so that it can test that order.
"""

from collections import defaultdict
from math import pi, sqrt
from types import SimpleNamespace

import numpy as np

from mi_lcair.scenes.build.__main__ import models

PRINTED = 1e-6  # m, last decimal of a printed coordinate
TEXTS = models()


def read(text):
    """Return vertices (n, 3), and for each face its indices, corners (k, 3) and label."""
    vertices, faces, labels, label = [], [], [], None
    for line in text.splitlines():
        key, *rest = line.split(maxsplit=1)
        if key == "v":
            vertices.append([float(word) for word in rest[0].split()])
        elif key == "o":
            label = rest[0].split("*")
        elif key == "f":
            faces.append([int(word) - 1 for word in rest[0].split()])
            labels.append(label)
    vertices = np.array(vertices)
    return SimpleNamespace(
        vertices=vertices, faces=faces, labels=labels, corners=[vertices[face] for face in faces]
    )


MODELS = {name: read(text) for name, text in TEXTS.items()}


def area_vector(corners):
    """Return area [m^2] times normal of a plane polygon."""
    return np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0) / 2


def volume(polygons):
    """Return the volume [m^3] by Gauss's theorem, positive if the polygons face outward."""
    return sum(corners[0] @ area_vector(corners) for corners in polygons) / 3


def bodies(model):
    """Return the connected bodies as lists of face numbers.

    Faces that share a vertex belong to the same body.
    """
    body = np.arange(len(model.vertices))
    while True:
        lowest = body.copy()
        for face in model.faces:
            lowest[face] = lowest[face].min()
        if np.array_equal(lowest, body):
            break
        body = lowest
    members = defaultdict(list)
    for number, face in enumerate(model.faces):
        members[body[face[0]]].append(number)
    return list(members.values())


def stacked_volume(polygons, axis):
    """Return the volume [m^3] of a body from its cross sections.

    The vertices of the body lie in planes perpendicular to `axis` and form similar star-shaped
    polygons there. Neighbouring sections of areas A and B at a distance d enclose
    d / 3 (A + sqrt(A B) + B).
    """
    points = np.unique(np.round(np.concatenate(polygons), 6), axis=0)
    heights, areas = [], []
    for height in np.unique(points[:, axis]):
        across = np.delete(points[points[:, axis] == height], axis, axis=1)
        x, y = (across - across.mean(axis=0)).T
        order = np.argsort(np.arctan2(y, x))
        x, y = x[order], y[order]
        heights.append(height)
        areas.append(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2)
    return sum(
        (h - g) / 3 * (a + sqrt(a * b) + b)
        for g, h, a, b in zip(heights, heights[1:], areas, areas[1:])
    )


def inside(points, polygons):
    """Return which points lie inside a closed body.

    From such a point the facets cover a solid angle of 4 pi.
    """
    triangles = np.array(
        [corners[[0, k, k + 1]] for corners in polygons for k in range(1, len(corners) - 1)]
    )
    a, b, c = np.moveaxis(triangles[None] - np.asarray(points)[:, None, None], 2, 0)
    la, lb, lc = (np.linalg.norm(side, axis=-1) for side in (a, b, c))
    # Van Oosterom and Strackee: tan(solid angle / 2) of a triangle seen from the origin.
    base = la * lb * lc + np.vecdot(a, b) * lc + np.vecdot(b, c) * la + np.vecdot(c, a) * lb
    angle = 2 * np.arctan2(np.vecdot(a, np.cross(b, c)), base)
    return np.abs(angle.sum(axis=1)) > 2 * pi
