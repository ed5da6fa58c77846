"""Triangulation: known areas and outlines of polygons of many shapes and positions."""

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.models3d import read
from mi_lcair.models3d.polygons import clip_ears, triangulate
from tests.calls import calls_of

L = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 3), (0, 3)]  # area 4
COMB = [
    (0, 0),
    (7, 0),
    (7, 3),
    (6, 3),
    (6, 1),
    (4, 1),
    (4, 3),
    (3, 3),
    (3, 1),
    (1, 1),
    (1, 3),
    (0, 3),
]  # 13
STAR = [(np.cos(a) * r, np.sin(a) * r) for a, r in zip(np.pi * np.arange(10) / 5, [2, 0.5] * 5)]
FRAME = [
    (0, 0),
    (4, 0),
    (4, 4),
    (0, 4),
    (0, 0),
    (1, 1),
    (1, 3),
    (3, 3),
    (3, 1),
    (1, 1),
]  # a hole of 2 x 2: area 12
TEETH = [(x, y) for x in range(40) for y in ((0, 1) if x % 2 else (1, 0))][1:] + [(39, -1), (0, -1)]
GOOD = {
    "triangle": ([(0, 0), (2, 0), (0, 1)], 1),
    "square": ([(0, 0), (1, 0), (1, 1), (0, 1)], 1),
    "dart": ([(0, 0), (2, -1), (1, 0), (2, 1)], 1),
    "dart from its notch": ([(1, 0), (2, 1), (0, 0), (2, -1)], 1),
    "square with a corner twice": ([(0, 0), (1, 0), (1, 0), (1, 1), (0, 1)], 1),
    "triangle of four": ([(0, 0), (1, 0), (2, 0), (0, 1)], 1),
    "corner 0 on an edge": ([(1, 0), (2, 0), (2, 2), (0, 2), (0, 0)], 4),
    "L": (L, 4),
    "comb": (COMB, 13),
    "star": (STAR, 5 * np.sin(np.pi / 5)),
    "frame": (FRAME, 12),
    "touches its own edge": ([(0, 3), (1, 1), (1, 3), (3, 3), (1, 2), (1, 0), (3, 1), (3, 3)], 5),
    "hexagon": ([(np.cos(a), np.sin(a)) for a in np.pi / 3 * np.arange(6)], 1.5 * np.sqrt(3)),
    "spike": ([(0, 0), (2, 0), (2, 1), (2, 5), (2, 1), (0, 1)], 2),
    "saw": (TEETH[::-1], None),
    "circle with a notch": (
        [(np.cos(a), np.sin(a)) for a in 2 * np.pi * np.arange(200) / 200] + [(0, -1e-3)],
        None,
    ),
}
CROSSED = {
    "bow tie": [(0, 0), (1, 1), (1, 0), (0, 1)],
    "uneven bow tie": [(0, 0), (1, 1), (1, 0), (0, 3)],
    "pentagram": [(np.cos(a), np.sin(a)) for a in 0.8 * np.pi * np.arange(5)],
    "bow tie of five": [(0, 0), (1, 1), (1, 0.5), (1, 0), (0, 1)],
    "spiral": [
        (0, 0),
        *(
            (r * np.cos(a), r * np.sin(a))
            for r, a in zip((1, 1.5, 2, 2.5, 3), np.radians(100) * np.arange(5))
        ),
    ],
    "every triangle faces the right way": [
        (3, 0),
        (3, 3),
        (1, 1),
        (2, 2),
        (1, 0),
        (3, 2),
        (0, 3),
        (2, 0),
    ],
    "folded": [(0, 0), (2, 0), (0, 0), (0, 2), (3, 2), (3, -1), (1, -1), (1, 3)],
}


def placed(points, turn=0):
    """The polygon in space, on an oblique plane far from the origin; its corners counted from
    another one.
    """
    points = np.roll(np.array(points, float), turn, axis=0)
    across = np.array([[2, -1, 2], [2, 2, -1]]) / 3
    return points @ across + [100, -50, 20]


def vectors(points):
    """Area vectors of triangles (T, 3, 3)."""
    return np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]) / 2


def shoelace(points):
    x, y = np.array(points, float).T
    return (x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


@pytest.mark.slow
@pytest.mark.parametrize("name", GOOD)
def test_area_and_facing(name):
    """All triangles face as the polygon does, and their areas add up to its area."""
    plane, area = GOOD[name]
    for turn in range(0, len(plane), 1 + len(plane) // 6):
        points = placed(plane, turn)
        triangles, facet, off_plane, crossed = triangulate(
            points, _welded(points), np.array([0, len(plane)])
        )
        found = vectors(points[triangles])
        normal = np.array([-1, 2, 2]) / 3
        assert not crossed.any() and (facet == 0).all() and off_plane[0] < 1e-12 * 100
        assert (found @ normal > 0).all() and found @ normal == pytest.approx(
            np.linalg.norm(found, axis=1), rel=1e-6
        )
        assert (found @ normal).sum() == pytest.approx(area or shoelace(plane), rel=1e-9), turn


def _welded(points):
    return np.array([np.flatnonzero((points == point).all(axis=1))[0] for point in points])


@pytest.mark.parametrize("name", CROSSED)
def test_polygons_that_cross_themselves(name):
    plane = np.array(CROSSED[name], float)
    for points in (placed(plane), np.pad(plane, ((0, 0), (0, 1)))):
        assert triangulate(points, _welded(points), np.array([0, len(points)]))[3].all()


def test_points_of_the_plane_are_covered_once():
    """Random points lie in as many triangles as the even-odd rule says."""
    rng = np.random.default_rng(1)
    for plane in (L, COMB, STAR, FRAME):
        plane = np.array(plane, float)
        triangles = plane[clip_ears(plane, _welded(plane))]
        samples = rng.uniform(plane.min(axis=0), plane.max(axis=0), (500, 2))
        x, y = samples.T
        crossings = np.zeros(500, int)
        for (ax, ay), (bx, by) in zip(plane, np.roll(plane, -1, axis=0)):
            crossings += ((ay > y) != (by > y)) & (
                x < ax + (y - ay) * (bx - ax) / (by - ay + (ay == by))
            )
        inside = np.zeros(500, int)
        for a, b, c in triangles:
            inside += np.all(
                [
                    np.cross(np.append(q - p, 0), np.c_[samples - p, np.zeros(500)])[:, 2] > 0
                    for p, q in ((a, b), (b, c), (c, a))
                ],
                axis=0,
            )
        assert (inside == crossings % 2).all()


def test_random_star_shapes():
    """Around a point in view of every corner, any radii make a simple polygon."""
    rng = np.random.default_rng(2)
    for size in (5, 6, 8, 13, 40):
        angles = (np.arange(size) + rng.uniform(-0.3, 0.3, size)) * 2 * np.pi / size
        plane = np.stack([np.cos(angles), np.sin(angles)], 1) * rng.uniform(0.1, 1, (size, 1))
        points = placed(plane)
        triangles, _, _, crossed = triangulate(points, np.arange(size), np.array([0, size]))
        assert not crossed and len(triangles) == size - 2
        assert np.linalg.norm(vectors(points[triangles]), axis=1).sum() == pytest.approx(
            shoelace(plane), rel=1e-9
        )


def test_polygons_of_several_sizes_keep_their_order():
    points = np.array([placed(L), placed(COMB[:1] * 6), placed(FRAME[:4] + L[:2])]).reshape(-1, 3)
    corners = np.concatenate(
        [np.arange(6), [12, 13, 14], np.arange(6), [12, 13, 14, 15], [0, 0, 0]]
    )
    triangles, facet, _, crossed = triangulate(points, corners, np.array([0, 6, 9, 15, 19, 22]))
    assert facet.tolist() == [0] * 4 + [1] + [2] * 4 + [3] * 2 and not crossed.any()


def test_facets_without_area_have_no_triangles():
    points = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0], [5, 0, 0], [1, 1e-7, 0]], float)
    corners, first = (
        np.array([0, 1, 2, 0, 1, 2, 3, 0, 1, 2, 3, 4, 0, 1, 0, 0, 2, 5]),
        np.array([0, 3, 7, 12, 15, 18]),
    )
    triangles, _, off_plane, crossed = triangulate(points, corners, first)
    assert len(triangles) == 0 and not crossed.any()


def test_distance_from_the_plane():
    """A unit square with one corner lifted by h: its corners lie h/4 off the mean plane, to first
    order in h.
    """
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0.01], [0, 1, 0]])
    triangles, _, off_plane, _ = triangulate(points, np.arange(4), np.array([0, 4]))
    assert off_plane == pytest.approx([0.0025], rel=1e-4) and len(triangles) == 2


@pytest.mark.parametrize("amplitude, allowed", [(0.0, True), (0.2, False)])
def test_enormous_polygons(tmp_path, amplitude, allowed):
    """A convex one is cut by arrays. Another is refused, because its time would grow with the
    square of its corners.
    """
    angle = np.linspace(0, 2 * np.pi, 20_000, endpoint=False)
    radius = 1 + amplitude * np.cos(5 * angle)
    path = tmp_path / "model.obj"
    path.write_text(
        "o f*bareAl*300*\n"
        + "".join(
            f"v {x:.9f} {y:.9f} 0\n" for x, y in zip(radius * np.cos(angle), radius * np.sin(angle))
        )
        + "f "
        + " ".join(map(str, range(1, 20_001)))
        + "\n"
    )
    if allowed:
        assert len(read(path).triangles) == 19_998
        assert calls_of(read, path) < 20_000
    else:
        with pytest.raises(
            InputError, match="line 20002: the face has 20000 corners and is not convex"
        ):
            read(path)
