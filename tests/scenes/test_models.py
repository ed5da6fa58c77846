"""The facet models are closed, face the right way, and have the stated dimensions.

Volumes and temperatures are tested as well. The expected numbers are repeated here.
"""

from collections import Counter, defaultdict
from math import asin, cos, pi, radians, sin

import numpy as np
import pytest
from scipy.spatial import cKDTree

from mi_lcair.scenes.build.__main__ import main
from mi_lcair.scenes.build.bodies import patch
from mi_lcair.scenes.build.wavefront import wavefront
from tests.scenes.polyhedra import (
    MODELS,
    PRINTED,
    TEXTS,
    area_vector,
    bodies,
    stacked_volume,
    volume,
)

TABLE_3_2 = {  # thesis Table 3.2: position -> K for gloss black and for bare aluminium
    "nose": (292.1, 301.7),
    "front fuselage": (293.1, 302.1),
    "rear fuselage": (294.2, 303.2),
    "left wing front": (301.6, 303.6),
    "left wing rear": (298.2, 303.6),
    "right wing front": (304.2, 303.7),
    "right wing rear": (299.1, 303.7),
}


# Topology


@pytest.mark.slow
@pytest.mark.parametrize(
    "name, count",
    [
        ("cylinder_bare_aluminum", 1),
        ("cylinder_gloss_black", 1),
        ("ir_range", 1),
        ("world_sphere", 1),
        ("a340", 13),
    ],
)
def test_every_body_is_closed(name, count):
    """Each edge occurs once in each direction, and Euler's formula holds as for a sphere.

    The bodies therefore have no gap and no handle.
    """
    model = MODELS[name]
    found = bodies(model)
    assert len(found) == count
    assert sorted(np.unique(np.concatenate(model.faces))) == list(range(len(model.vertices)))
    for body in found:
        faces = [model.faces[number] for number in body]
        edges = Counter(edge for face in faces for edge in zip(face, face[1:] + face[:1]))
        assert set(edges.values()) == {1}
        assert all(edge[::-1] in edges for edge in edges)
        assert len(set().union(*faces)) - len(edges) / 2 + len(faces) == 2


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
def test_facets_are_plane_and_not_degenerate(name):
    """Facets are plane to the rounding of coordinates, and their sides are longer than 1 mm.

    They are convex, so that a fan of triangles covers them.
    """
    for corners in MODELS[name].corners:
        assert len(corners) in (3, 4)
        normal = area_vector(corners)
        area = np.linalg.norm(normal)
        normal /= area
        assert np.abs((corners - corners.mean(axis=0)) @ normal).max() < 2 * PRINTED
        side = np.roll(corners, -1, axis=0) - corners
        assert np.linalg.norm(side, axis=1).min() > 1e-3 and area > 1e-5
        assert (np.cross(side, np.roll(side, -1, axis=0)) @ normal > 0).all()


@pytest.mark.parametrize(
    "name, fewest, most",
    [
        ("cylinder_bare_aluminum", 1900, 2100),
        ("cylinder_gloss_black", 1900, 2100),
        ("ir_range", 160, 160),
        ("world_sphere", 400, 400),
        ("a340", 4000, 10000),
    ],
)
def test_facet_counts(name, fewest, most):
    assert fewest <= len(MODELS[name].faces) <= most


@pytest.mark.parametrize("name", ["cylinder_bare_aluminum", "a340"])
def test_left_and_right_are_mirror_images(name):
    """The mirror image of each facet's centre is the centre of a facet."""
    centres = np.array([corners.mean(axis=0) for corners in MODELS[name].corners])
    distances, _ = cKDTree(centres).query(centres * (1, -1, 1))
    assert distances.max() < 2 * PRINTED


@pytest.mark.slow
def test_files_depend_on_nothing_but_the_scripts(tmp_path):
    main(tmp_path / "new")
    assert {file.name: file.read_bytes() for file in (tmp_path / "new").glob("*.obj")} == {
        f"{name}.obj": text.encode("ascii") for name, text in TEXTS.items()
    }
    assert not any("-0.000000" in text for text in TEXTS.values())


def test_patch_cuts_what_is_not_plane_and_leaves_out_what_has_no_area():
    flat = [[(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 0), (1, 1, 0), (1, 1, 0)]]
    assert [len(corners) for _, corners in patch(flat, "")] == [4, 3]
    assert [tuple(area_vector(corners)) for _, corners in patch(flat, "")] == [
        (0, 0, 1),
        (0, 0, 0.5),
    ]
    bent = [[(0, 0, 0), (1, 0, 0)], [(0, 1, 0), (1, 1, 0.1)]]
    assert [len(corners) for _, corners in patch(bent, "")] == [3, 3]
    assert patch([flat[0], flat[0]], "") == []


def test_equal_labels_become_one_object():
    strip = [[(x, y, 0) for x in range(4)] for y in range(2)]
    first, second, third = (facet.corners for facet in patch(strip, ""))
    text = wavefront([("a", first), ("b", second), ("a", third)], "what it is\nand more")
    assert text.splitlines()[:3] == ["# what it is", "# and more", "v 0.000000 0.000000 0.000000"]
    assert text.splitlines()[-5:] == ["o a", "f 1 2 3 4", "f 5 7 8 6", "o b", "f 2 5 6 3"]


# The cylinder with wings

FINISHES = [("cylinder_gloss_black", "gloss_black", 0), ("cylinder_bare_aluminum", "bareAl", 1)]


@pytest.mark.parametrize("name, finish, column", FINISHES)
def test_cylinder_has_the_temperatures_of_table_3_2(name, finish, column):
    """The place of a facet determines its temperature.

    Only wings extend beyond the radius. The nose ends 0.3 m behind the tip.
    """
    model = MODELS[name]
    places = Counter()
    for corners, (kind, material, kelvin, region) in zip(model.corners, model.labels):
        x, y, _ = corners.mean(axis=0)
        if np.abs(corners[:, 1]).max() > 0.1501:
            place = f"{'left' if y > 0 else 'right'} wing {'front' if x > -0.15 else 'rear'}"
        else:
            place = "nose" if x > 0.3 else f"{'front' if x > -0.15 else 'rear'} fuselage"
        assert (kind, material, float(kelvin)) == ("f", finish, TABLE_3_2[place][column])
        assert region.replace("_", " ") == place
        places[place] += 1
    assert places.keys() == TABLE_3_2.keys()


@pytest.mark.parametrize("name", ["cylinder_bare_aluminum", "cylinder_gloss_black"])
def test_cylinder_has_its_dimensions(name):
    """The model is 1.2 m long with a span of 1 m, and its corners are on a radius of 0.15 m.

    The 40-gon stands on a side, so that half its height is its apothem.
    """
    vertices = MODELS[name].vertices
    assert np.allclose(vertices.max(axis=0), (0.6, 0.5, 0.15 * cos(pi / 40)), atol=PRINTED)
    assert np.allclose(vertices.min(axis=0), (-0.6, -0.5, -0.15 * cos(pi / 40)), atol=PRINTED)
    body = vertices[np.abs(vertices[:, 1]) < 0.15]
    assert np.hypot(body[:, 1], body[:, 2]).max() == pytest.approx(0.15, abs=PRINTED)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cylinder_bare_aluminum", "cylinder_gloss_black"])
def test_cylinder_encloses_cylinder_nose_and_wings(name):
    """The volume is that of a prism, two boxes and a nose.

    The nose is smaller than the ogive of revolution by less than the sagitta of its chords. The
    volume of the ogive is V = pi (L rho^2 - L^3 / 3 - (rho - R) rho^2 asin(L / rho)). Six chords of
    an arc of length s and radius rho are at most (s / 6)^2 / (8 rho) below it. The lateral area is
    below 2 pi R s.
    """
    polygon = 20 * sin(pi / 20)  # area of the 40-gon of radius 1
    rho = (0.15**2 + 0.3**2) / 0.3
    ogive = 0.3 * rho**2 - 0.3**3 / 3 - (rho - 0.15) * rho**2 * asin(0.3 / rho)
    arc = rho * asin(0.3 / rho)
    # Stations have equal distances in x. The steepest chord is therefore longer than arc / 6, by
    # 1 / cos of the slope, which is 53 degrees at the tip.
    sagitta = (0.05 / cos(asin(0.3 / rho))) ** 2 / (8 * rho)
    wings = 2 * (0.5 - 0.15 * cos(pi / 40)) * 0.45 * 0.3 * sin(pi / 40)
    most = polygon * (0.15**2 * 0.9 + ogive) + wings
    missing = most - volume(MODELS[name].corners)
    assert 0 < missing < 2 * pi * 0.15 * arc * sagitta < 0.04 * most


def test_wing_root_is_a_sharp_corner_of_small_facets():
    """Along the root of the left wing's upper side a wing facet and a fuselage facet share an edge.

    These facets are a few cm in size.
    """
    model = MODELS["cylinder_bare_aluminum"]
    owners = defaultdict(list)
    for number, face in enumerate(model.faces):
        for edge in zip(face, face[1:] + face[:1]):
            owners[frozenset(edge)].append(number)
    y, z = 0.15 * cos(pi / 40), 0.15 * sin(pi / 40)
    on_root = {
        number
        for number, vertex in enumerate(model.vertices)
        if np.allclose(vertex[1:], (y, z), atol=PRINTED)
    }
    pairs = [
        pair
        for edge, pair in owners.items()
        if edge <= on_root and any("wing" in model.labels[number][3] for number in pair)
    ]
    assert len(pairs) == 12
    for pair in pairs:
        pair = sorted(pair, key=lambda number: "wing" in model.labels[number][3])
        assert ["wing" in model.labels[number][3] for number in pair] == [False, True]
        fuselage, wing = (area_vector(model.corners[number]) for number in pair)
        assert np.allclose(wing / np.linalg.norm(wing), (0, 0, 1))
        tilt = radians(9)  # the middle of the next side of the 40-gon
        assert np.allclose(
            fuselage / np.linalg.norm(fuselage), (0, cos(tilt), sin(tilt)), atol=1e-4
        )
        assert max(np.ptp(model.corners[number], axis=0).max() for number in pair) < 0.04


# The surroundings of the models


def test_ir_range_is_a_room_of_3_m():
    model = MODELS["ir_range"]
    assert np.array_equal(model.vertices.min(axis=0), (-1.5,) * 3) and np.array_equal(
        model.vertices.max(axis=0), (1.5,) * 3
    )
    assert volume(model.corners) == pytest.approx(-27, rel=1e-12)
    for corners, label in zip(model.corners, model.labels):
        centre = corners.mean(axis=0)
        assert np.abs(centre).max() == 1.5 and area_vector(corners) @ centre < 0
        expected = (
            ("s", "ir_range_wall", "263", "group=walls")
            if centre[2] > 0
            else ("t", "ir_range_wall", "253", "group=walls")
        )
        assert tuple(label) == expected
        assert len(set(np.sign(corners[:, 2])) - {0}) == 1, "no facet crosses the middle"
    assert Counter(label[0] for label in model.labels) == {"s": 80, "t": 80}


def test_world_sphere_has_ten_rings_of_sky_and_a_terrain():
    model = MODELS["world_sphere"]
    assert np.allclose(np.linalg.norm(model.vertices, axis=1), 10e3, atol=2 * PRINTED)
    rings = Counter()
    for corners, (kind, material, kelvin, word) in zip(model.corners, model.labels):
        elevation = np.degrees(np.arcsin(corners[:, 2] / 10e3))
        middle = (elevation.min() + elevation.max()) / 2
        # At the zenith a rounding of 1 um changes the elevation from arcsin by 1e-5 degrees.
        assert np.ptp(elevation) == pytest.approx(9, abs=1e-5)
        assert area_vector(corners) @ corners.mean(axis=0) < 0
        assert material == "blackbody"
        if middle > 0:
            key, degrees = word.split("=")
            assert (kind, kelvin, key) == ("s", "288", "elevation_deg") and float(
                degrees
            ) == pytest.approx(middle, abs=1e-5)
            rings[degrees] += 1
        else:
            assert (kind, kelvin, word) == ("t", "302.5", "group=terrain")
    assert rings == {f"{degrees:g}": 20 for degrees in np.arange(4.5, 90, 9)}


def test_world_sphere_is_filled():
    """The volume is that of stacked 20-gons.

    The 20-gons have 1.6 % less volume than the ball. The chords of 9 degrees take away less than
    0.7 %.
    """
    model = MODELS["world_sphere"]
    assert -volume(model.corners) == pytest.approx(stacked_volume(model.corners, axis=2), rel=1e-9)
    ball = 4 / 3 * pi * 10e3**3 * 10 * sin(pi / 10) / pi
    assert 0.993 * ball < -volume(model.corners) < ball
