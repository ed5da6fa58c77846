"""Outlines of facets: areas by independent formulas, and what has no single outline."""

import numpy as np
import pytest

import mi_lcair
from mi_lcair.rendering.facets.polygons import FacetPolygons
from mi_lcair.rendering.facets.table import FacetTable


def newell(points) -> float:
    """Area of a planar polygon, by Newell's formula."""
    points = points - points[0]
    return np.linalg.norm(sum(np.cross(a, b) for a, b in zip(points, np.roll(points, -1, 0)))) / 2


def triangles_of(*polygons):
    """Triangles of fans, and the number of the polygon of each."""
    found = [
        (k, [polygon[0], polygon[i], polygon[i + 1]])
        for k, polygon in enumerate(polygons)
        for i in range(1, len(polygon) - 1)
    ]
    return np.array([t for _, t in found], float), np.array([k for k, _ in found])


def test_polygons_come_back():
    square = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]]
    arrow = [[0, 0, 1], [3, -2, 1], [1, 0, 1], [3, 2, 1]]  # concave; the fan about its first corner
    single = [[5, 0, 0], [6, 0, 0], [5, 0, 1]]
    found = FacetPolygons.of(*triangles_of(square, arrow, single))
    assert found.facet.tolist() == [0, 1, 2] and [len(face) for face in found.faces] == [4, 4, 3]
    for polygon, face in zip((square, arrow, single), found.faces):
        points = found.vertices[face]
        assert newell(points) == pytest.approx(newell(np.array(polygon, float)), rel=1e-12)
        start = points.tolist().index(polygon[0])  # the same corners in the same order
        assert np.roll(points, -start, axis=0).tolist() == polygon


def test_a_warped_quadrilateral_keeps_its_triangles_as_a_fan():
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0.3], [0, 1, 0]], float)
    triangles = points[[[1, 2, 3], [1, 3, 0]]]  # a fan about corner 1
    found = FacetPolygons.of(triangles, np.zeros(2, int))
    assert len(found.faces) == 1 and found.vertices[found.faces[0][0]].tolist() in (
        points[[1, 3]].tolist()
    )


@pytest.mark.parametrize("case", ["hole", "apart", "strip"])
def test_what_has_no_single_outline_stays_triangles(case):
    if case == "hole":
        outer = np.array([[0, 0, 0], [3, 0, 0], [3, 3, 0], [0, 3, 0]], float)
        inner = outer / 3 + [1, 1, 0]
        triangles = np.array(
            [
                t
                for k in range(4)
                for t in (
                    [outer[k], outer[(k + 1) % 4], inner[k]],
                    [outer[(k + 1) % 4], inner[(k + 1) % 4], inner[k]],
                )
            ]
        )
    elif case == "apart":
        one = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
        triangles = np.stack([one, one + 5])
    else:  # three squares of a channel, which no fan covers
        points = np.array([[x, y, z] for x, z in ((0, 0), (1, 0), (1, 1), (0, 1)) for y in (0, 1)])
        corners = [c for k in (0, 2, 4) for c in ([k, k + 2, k + 1], [k + 2, k + 3, k + 1])]
        triangles = points[corners].astype(float)
    found = FacetPolygons.of(triangles, np.zeros(len(triangles), int))
    assert len(found.faces) == len(triangles)
    areas = sum(newell(found.vertices[face]) for face in found.faces)
    assert areas == pytest.approx(sum(map(newell, triangles)), rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a340_landing", "cylinder_ir_range", "cavity"])
def test_areas_of_bundled_scenes(name):
    table = FacetTable(mi_lcair.load(name))
    found = FacetPolygons.of(table.triangles, table.triangle_facet)
    areas = np.zeros(table.count)
    for face, facet in zip(found.faces, found.facet):
        fan = found.vertices[face]
        areas[facet] += sum(newell(fan[[0, k, k + 1]]) for k in range(1, len(fan) - 1))
    np.testing.assert_allclose(areas, table.area, rtol=1e-6)
    assert len(found.faces) < 1.01 * table.count


def test_nothing():
    found = FacetPolygons.of(np.zeros((0, 3, 3)), np.zeros(0, int))
    assert not found.faces
