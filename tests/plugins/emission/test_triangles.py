"""The buffers of Mitsuba's meshes: their names, and what is written is read."""

import ast
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.plugins.emission import triangles

ROOT = Path(mi_lcair.__file__).parents[1]
NAMES = {triangles.VERTICES, triangles.NORMALS, triangles.TEXTURE}


def test_what_is_written_is_read():
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 2]])
    faces = np.array([[0, 1, 2], [0, 3, 1]])
    mesh = mi.Mesh("pair", len(corners), len(faces))
    triangles.set_triangles(mesh, corners, faces)
    assert triangles.is_faceted(mesh)
    np.testing.assert_array_equal(triangles.vertex_positions(mesh), corners)
    np.testing.assert_array_equal(triangles.triangle_vertices(mesh), faces)
    assert mesh.surface_area()[0] == pytest.approx(0.5 + 1)


def test_one_module_knows_the_names():
    """Mitsuba 3.10 has other names: no other module may have these."""
    files = [path for folder in ("mi_lcair", "plugins") for path in (ROOT / folder).rglob("*.py")]
    users = {
        path.name
        for path in files
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant) and node.value in NAMES
    }
    assert users == {"triangles.py"}


def test_tables_by_pointer_have_few_sizes():
    """Other scenes that are alive raise the pointers' numbers; kernels hold the tables' size."""
    low, high = (triangles.PrimitiveTable([k, k + 1], [[7], [8, 9]], 5) for k in (1, 62))
    assert dr.width(low.first) == dr.width(high.first) == 64
    assert dr.width(triangles.PrimitiveTable([64], [[7]], 5).first) == 128
    keys, primitives = mi.UInt32([62, 63, 63, 61, 64, 2**31]), mi.UInt32([3, 0, 1, 0, 0, 0])
    assert high.at(keys, primitives).numpy().tolist() == [7, 8, 9, 5, 5, 5]
