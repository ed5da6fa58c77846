"""Points of facets that have several unequal triangles, and which shapes are closed."""

from types import SimpleNamespace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mi_lcair.heating.parts import Parts, closed_shapes
from mi_lcair.rendering.facets.table import FacetTable
from tests.heating.scenes import emits, grey, scene_of


def test_points_are_even_over_the_triangles_of_a_facet():
    props = mi.Properties()
    props["mesh_bsdf"], props["mesh_emitter"] = mi.load_dict(grey(0.5)), mi.load_dict(emits())
    mesh = mi.Mesh("model", 5, 3, props=props)
    mesh.add_attribute("face_facet", 1, [0.0, 0.0, 1.0])
    values = mi.traverse(mesh)
    values["vertex_positions"] = [3.0, 2, 0, 4, 2, 0, 3, 3, 0, 13, 22, 0, 20, 20, 1]
    values["faces"] = [0, 1, 2, 1, 3, 2, 1, 4, 3]
    values.update()
    scene = scene_of(model=mesh)
    table, count = FacetTable(scene), 40_000
    parts = Parts.of(table, np.array([0, 1]), list(scene.mi.shapes()))
    u, x, y = (mi.Float(row) for row in np.random.default_rng(0).random((3, 2 * count)))
    facet = dr.arange(mi.UInt32, 2 * count) // count
    points = np.array(parts.point(facet, u, mi.Point2f(x, y)).p).T.reshape(2, count, 3)
    error = points.std(axis=1) / np.sqrt(count)
    assert np.all(abs(points.mean(axis=1) - table.centre[:2]) < 5 * error + 1e-6)


TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


@pytest.mark.parametrize(
    ("triangles", "one_sided", "closed"),
    [
        (TETRAHEDRON, [True, True], [True, True]),
        (TETRAHEDRON[:3], [True, True], [False, False]),
        ([*TETRAHEDRON[:3], TETRAHEDRON[3, ::-1]], [True, True], [False, False]),
        (TETRAHEDRON, [True, False], [False, True]),
    ],
)
def test_a_body_is_closed_if_its_triangles_meet_at_all_edges(triangles, one_sided, closed):
    """Two triangles of a tetrahedron are those of one shape, and the others of another."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])[np.array(triangles)]
    numbers = np.arange(len(triangles))
    table = SimpleNamespace(triangles=corners, triangle_facet=numbers, shape_index=numbers // 2)
    shapes = [SimpleNamespace(class_name=lambda: "Mesh")] * 2
    np.testing.assert_array_equal(closed_shapes(table, shapes, np.array(one_sided)), closed)
