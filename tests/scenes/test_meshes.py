"""The bundled meshes have the areas, openings and orientations that the thesis states.

The files are byte for byte what the script writes.
"""

from collections import Counter
from math import atan, pi, sin, tan

import mitsuba as mi
import numpy as np
import pytest

from benchmarks.methods.propagation import exact
from mi_lcair import scenes
from mi_lcair.scenes import build_meshes

MESHES = sorted(build_meshes.meshes())
CAVITIES = sorted(exact.CAVITY_BLOCKS)

# Areas of the openings of the sphere with 20 x 20 facets, in m^2, to four decimals. Six of them
# differ from thesis Table B.1, which has 0.0487, 0.1926, 0.2820, 0.4240, 0.6540 and 0.8749.
OPENING_AREAS = {
    2: 0.0244,
    4: 0.0488,
    8: 0.0963,
    16: 0.1927,
    24: 0.2830,
    36: 0.4245,
    60: 0.6603,
    80: 0.8804,
}
SPHERE_AREA = 3.1062  # m^2; the thesis prints 3.106


def read(name):
    """Return corners (F, 3, 3) and triangles (F, 3) of a mesh as Mitsuba loads it."""
    mesh = mi.load_dict(
        {"type": "ply", "filename": str(scenes.FOLDER / "meshes" / name), "face_normals": True}
    )
    parameters = mi.traverse(mesh)
    vertices = parameters["vertex_positions"].numpy().reshape(-1, 3).astype(float)
    triangles = parameters["faces"].numpy().reshape(-1, 3).astype(int)
    return vertices[triangles], triangles


def area_vectors(corners):
    """Return normal times area (F, 3) of each triangle."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2


def area(corners):
    return np.linalg.norm(area_vectors(corners), axis=1).sum()


def boundary_edges(triangles):
    """Return the edges, as pairs of vertices, that belong to one triangle only.

    The order of the vertices is that in which the triangle passes through them.
    """
    edges = Counter(
        (triangle[i], triangle[i - 2]) for triangle in triangles.tolist() for i in range(3)
    )
    assert max(edges.values()) == 1, (
        "two facets have an edge in the same direction: their normals disagree"
    )
    return [edge for edge in edges if edge[::-1] not in edges]


def test_meshes_on_disk_are_what_the_script_builds():
    assert sorted(file.name for file in (scenes.FOLDER / "meshes").iterdir()) == MESHES
    for name, (vertices, facets) in build_meshes.meshes().items():
        assert (scenes.FOLDER / "meshes" / name).read_bytes() == build_meshes.ply(
            vertices, facets
        ), name


def test_script_writes_the_meshes(tmp_path, monkeypatch):
    monkeypatch.setattr(build_meshes, "FOLDER", tmp_path / "meshes")
    build_meshes.main()
    assert sorted(file.name for file in (tmp_path / "meshes").iterdir()) == MESHES


@pytest.mark.parametrize(
    "name, normal, corner, opposite",
    [
        ("two_plates_reflector.ply", (0, 0, 1), (0, -0.05, 0), (0.2, 0.05, 0)),
        ("two_plates_emitter.ply", (1, 0, 0), (0, -0.05, 0), (0, 0.05, 0.2)),
        ("open_box_floor.ply", (0, 0, 1), (-0.1, 0, 0), (0.1, 0.1, 0)),
        ("open_box_wall.ply", (0, 1, 0), (-0.1, 0, 0), (0.1, 0, 0.1)),
    ],
)
def test_plates_stand_where_the_thesis_puts_them(name, normal, corner, opposite):
    corners, _ = read(name)
    # Each of the two triangles has half the area of a plate.
    assert np.allclose(area_vectors(corners), 0.01 * np.array(normal), atol=1e-9)
    assert np.allclose(corners.min(axis=(0, 1)), corner, atol=1e-8)
    assert np.allclose(corners.max(axis=(0, 1)), opposite, atol=1e-8)


@pytest.mark.parametrize("opening", CAVITIES)
def test_cavity_has_the_thesis_areas_and_facets(opening):
    corners, _ = read(f"cavity_{opening}.ply")
    vertices, facets = build_meshes.sphere(0.5)
    sphere = area(vertices[build_meshes.triangles(facets)[0]])
    assert round(sphere, 4) == SPHERE_AREA
    assert round(sphere - area(corners), 4) == OPENING_AREAS[opening]
    quads, poles = 360, 40  # quadrilaterals have two triangles, facets at the poles one
    assert len(corners) == 2 * (quads - opening) + poles


@pytest.mark.parametrize("opening", CAVITIES)
def test_cavity_lies_on_the_sphere_and_faces_inward(opening):
    corners, _ = read(f"cavity_{opening}.ply")
    assert np.allclose(np.linalg.norm(corners, axis=-1), exact.CAVITY_RADIUS, atol=1e-7)
    assert np.all(np.sum(area_vectors(corners) * corners.mean(axis=1), axis=1) < 0)


@pytest.mark.parametrize("opening", CAVITIES)
def test_cavity_is_tight_but_for_one_opening_centred_on_the_axis(opening):
    corners, triangles = read(f"cavity_{opening}.ply")
    following = dict(boundary_edges(triangles))
    rows, columns = exact.CAVITY_BLOCKS[opening]
    assert len(following) == 2 * (rows + columns)
    start = vertex = next(iter(following))
    for _ in range(len(following)):
        vertex = following.pop(vertex)
    assert vertex == start, "the boundary is one closed loop"
    # The vector areas of mesh and opening add up to 0. That of the mesh points along +x, so that
    # the axis passes through the middle of the opening.
    opening_vector = area_vectors(corners).sum(axis=0)
    assert opening_vector[0] > 0 and np.allclose(opening_vector[1:], 0, atol=1e-7)


@pytest.mark.parametrize("opening", CAVITIES)
def test_cavity_opening_covers_its_share_of_directions(opening):
    """The solid angle of the opening agrees with spherical trigonometry.

    It is larger than the fraction f of the sphere's formula. The upper and lower edges of facets
    appear as arcs of great circles, which lie beyond the parallels. A spherical strip of width w
    from the equator to a great-circle arc whose ends are at latitude t has the area
    2 atan(sin t tan(w / 2)).
    """
    corners, _ = read(f"cavity_{opening}.ply")
    a, b, c = np.moveaxis(corners / np.linalg.norm(corners, axis=-1, keepdims=True), 1, 0)
    # Van Oosterom and Strackee: tan(solid angle / 2) of a triangle seen from the origin.
    volume = np.sum(a * np.cross(b, c), axis=1)
    walls = np.abs(2 * np.arctan2(volume, 1 + np.sum(a * b + b * c + c * a, axis=1))).sum()
    rows, columns = exact.CAVITY_BLOCKS[opening]
    latitude, width = rows / 2 * pi / 20, 2 * pi / 20
    block = columns * 2 * 2 * atan(sin(latitude) * tan(width / 2))
    assert 4 * pi - walls == pytest.approx(block, abs=1e-5)
    assert 1 < block / (4 * pi * exact.cavity_opening_fraction(opening)) < 1.01


@pytest.mark.parametrize(
    "name, inward, size, surface",
    [
        ("furnace_room.ply", True, (2, 2, 2), 24),
        ("furnace_slab.ply", False, (0.7, 0.04, 0.7), 1.092),
        ("furnace_sphere.ply", False, (0.4, 0.4, 0.4), SPHERE_AREA * (0.2 / 0.5) ** 2),
    ],
)
def test_furnace_bodies_are_closed(name, inward, size, surface):
    corners, triangles = read(name)
    assert not boundary_edges(triangles)
    # The bodies are convex about the origin, so that the sign tells in and out.
    facing = np.sum(area_vectors(corners) * corners.mean(axis=1), axis=1)
    assert np.all(facing < 0 if inward else facing > 0)
    assert np.allclose(np.ptp(corners, axis=(0, 1)), size, rtol=1e-6)
    assert area(corners) == pytest.approx(surface, rel=2e-5)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name, facets",
    [
        ("two_plates_emitter.ply", 1),
        ("open_box_floor.ply", 1),
        ("furnace_room.ply", 6),
        ("furnace_slab.ply", 6),
        ("furnace_sphere.ply", 400),
        *((f"cavity_{opening}.ply", 400 - opening) for opening in CAVITIES),
    ],
)
def test_facets_are_the_polygons_that_the_thesis_counts(name, facets):
    """Facets are numbered from 0, and each is in a plane of its own."""
    mesh = mi.load_dict(
        {"type": "ply", "filename": str(scenes.FOLDER / "meshes" / name), "face_normals": True}
    )
    number = mi.traverse(mesh)["face_facet"].numpy()
    assert np.array_equal(np.unique(number), np.arange(facets))
    corners, _ = read(name)
    normals = area_vectors(corners)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    planes = np.column_stack([normals, np.sum(normals * corners.mean(axis=1), axis=1)])
    same_plane = np.linalg.norm(planes[:, None] - planes, axis=-1) < 1e-4
    assert np.array_equal(same_plane, number[:, None] == number)
