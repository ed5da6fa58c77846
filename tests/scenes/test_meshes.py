"""The bundled meshes have the areas, openings and orientations that the thesis states, byte for
byte from the script.
"""

from collections import Counter
from math import atan, pi, sin, tan

import mitsuba as mi
import numpy as np
import pytest

from mi_lcair import scenes
from mi_lcair.benchmark.propagation import exact
from mi_lcair.scenes import build_meshes

MESHES = sorted(build_meshes.meshes())
CAVITIES = sorted(exact.CAVITY_BLOCKS)

# Of the 20 x 20 sphere, m^2, to four decimals. Thesis Table B.1 prints 0.0487, 0.1926, 0.2820,
# 0.4240, 0.6540, 0.8749 where these differ.
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
    """Corners (F, 3, 3) of the mesh as Mitsuba's `ply` loader sees it, and its triangles (F, 3)."""
    mesh = mi.load_dict(
        {"type": "ply", "filename": str(scenes.FOLDER / "meshes" / name), "face_normals": True}
    )
    parameters = mi.traverse(mesh)
    vertices = parameters["vertex_positions"].numpy().reshape(-1, 3).astype(float)
    triangles = parameters["faces"].numpy().reshape(-1, 3).astype(int)
    return vertices[triangles], triangles


def area_vectors(corners):
    """Normal times area (F, 3) of each triangle."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2


def area(corners):
    return np.linalg.norm(area_vectors(corners), axis=1).sum()


def boundary_edges(triangles):
    """Edges (as vertex pairs, in their direction of travel) that no neighbour travels the other
    way.
    """
    edges = Counter(
        (triangle[i], triangle[i - 2]) for triangle in triangles.tolist() for i in range(3)
    )
    assert max(edges.values()) == 1, (
        "two facets travel an edge in the same direction: their normals disagree"
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
    assert np.allclose(
        area_vectors(corners), 0.01 * np.array(normal), atol=1e-9
    )  # two triangles of half a plate
    assert np.allclose(corners.min(axis=(0, 1)), corner, atol=1e-8)
    assert np.allclose(corners.max(axis=(0, 1)), opposite, atol=1e-8)


@pytest.mark.parametrize("opening", CAVITIES)
def test_cavity_has_the_thesis_areas_and_facets(opening):
    corners, _ = read(f"cavity_{opening}.ply")
    vertices, facets = build_meshes.sphere(0.5)
    sphere = area(vertices[build_meshes.triangles(facets)[0]])
    assert round(sphere, 4) == SPHERE_AREA
    assert round(sphere - area(corners), 4) == OPENING_AREAS[opening]
    quads, poles = 360, 40  # two triangles each, one each
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
    # The opening's vector area closes the mesh's: along +x alone, so that the axis meets the
    # opening's middle.
    opening_vector = area_vectors(corners).sum(axis=0)
    assert opening_vector[0] > 0 and np.allclose(opening_vector[1:], 0, atol=1e-7)


@pytest.mark.parametrize("opening", CAVITIES)
def test_cavity_opening_covers_its_share_of_directions(opening):
    """The opening's solid angle, facet by facet, against spherical trigonometry.

    It exceeds the fraction f of the sphere formula by slivers: upper and lower edges of facets are
    arcs of great circles, which bulge beyond the parallels. A spherical strip of width w from the
    equator up to a great-circle arc with both ends at latitude t has the excess 2 atan(sin t tan(w
    / 2)).
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
    facing = np.sum(area_vectors(corners) * corners.mean(axis=1), axis=1)  # convex about the origin
    assert np.all(facing < 0 if inward else facing > 0)
    assert np.allclose(np.ptp(corners, axis=(0, 1)), size, rtol=1e-6)
    assert area(corners) == pytest.approx(surface, rel=2e-5)


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
    """Numbered from 0; the triangles of one lie in one plane, and share it with no other facet's."""
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
