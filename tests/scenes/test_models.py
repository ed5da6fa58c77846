"""The facet models are closed, face the right way, and have the dimensions, volumes and temperatures that they claim.

Everything is read back from the text of the OBJ. Dimensions and temperatures are written out here once more, volumes
come from the shapes of cross sections and from closed forms, never from the order of the corners, which they test.
"""
from collections import Counter, defaultdict
from math import asin, cos, pi, radians, sin, sqrt
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from mi_lcair.scenes.build.__main__ import main, models
from mi_lcair.scenes.build.bodies import patch
from mi_lcair.scenes.build.wavefront import wavefront

PRINTED = 1e-6  # m, the last decimal of a coordinate
TEXTS = models()
AIRLINER_BODIES = {"fuselage", "belly", "wing", "tailplane", "fin",
                   *(f"{part}_{number}" for part in ("nacelle", "pylon") for number in (1, 2, 3, 4))}
ENGINES = {1: 19.25, 2: 9.37, 3: -9.37, 4: -19.25}  # y in m

TABLE_3_2 = {  # thesis: position -> K, gloss black and bare aluminium
    "nose": (292.1, 301.7), "front fuselage": (293.1, 302.1), "rear fuselage": (294.2, 303.2),
    "left wing front": (301.6, 303.6), "left wing rear": (298.2, 303.6),
    "right wing front": (304.2, 303.7), "right wing rear": (299.1, 303.7),
}


def read(text):
    """vertices (n, 3), and per face its indices, its corners (k, 3) and the words of its label."""
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
    return SimpleNamespace(vertices=vertices, faces=faces, labels=labels, corners=[vertices[face] for face in faces])


MODELS = {name.removesuffix(".obj"): read(text) for name, text in TEXTS.items()}


def area_vector(corners):
    """Area (m^2) times normal of a plane polygon."""
    return np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0) / 2


def volume(polygons):
    """Enclosed volume (m^3) by Gauss's theorem, positive where the polygons face outward."""
    return sum(corners[0] @ area_vector(corners) for corners in polygons) / 3


def bodies(model):
    """Connected bodies, each a list of face numbers: faces that share a vertex belong together."""
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


@pytest.fixture(scope="module")
def parts():
    """The airliner's bodies by the name in their labels: lists of corners."""
    model = MODELS["a340"]
    named = {}
    for body in bodies(model):
        name, = {model.labels[number][3] for number in body if model.labels[number][1] == "bareAl"}
        named[name] = [model.corners[number] for number in body]
    return named


def stacked_volume(polygons, axis):
    """Volume (m^3) of a body whose vertices lie in parallel planes across `axis`, similar star-shaped polygons in each.

    Neighbours with areas A and B at a distance d enclose d / 3 (A + sqrt(A B) + B).
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
    return sum((h - g) / 3 * (a + sqrt(a * b) + b) for g, h, a, b in zip(heights, heights[1:], areas, areas[1:]))


# Topology

@pytest.mark.parametrize("name, count", [
    ("cylinder_bare_aluminum", 1), ("cylinder_gloss_black", 1), ("ir_range", 1), ("world_sphere", 1), ("a340", 13)])
def test_every_body_is_closed(name, count):
    """Each edge is travelled once in either direction, and each body is a sphere by Euler's formula: no gap, no handle."""
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


@pytest.mark.parametrize("name", MODELS)
def test_facets_are_plane_and_not_degenerate(name):
    """Plane but for the rounding of coordinates; sides longer than 1 mm, corners convex, so that a fan of triangles fits."""
    for corners in MODELS[name].corners:
        assert len(corners) in (3, 4)
        normal = area_vector(corners)
        area = np.linalg.norm(normal)
        normal /= area
        assert np.abs((corners - corners.mean(axis=0)) @ normal).max() < 2 * PRINTED
        side = np.roll(corners, -1, axis=0) - corners
        assert np.linalg.norm(side, axis=1).min() > 1e-3 and area > 1e-5
        assert (np.cross(side, np.roll(side, -1, axis=0)) @ normal > 0).all()


@pytest.mark.parametrize("name, fewest, most", [
    ("cylinder_bare_aluminum", 1900, 2100), ("cylinder_gloss_black", 1900, 2100), ("ir_range", 160, 160),
    ("world_sphere", 400, 400), ("a340", 4000, 10000)])
def test_facet_counts(name, fewest, most):
    assert fewest <= len(MODELS[name].faces) <= most


@pytest.mark.parametrize("name", ["cylinder_bare_aluminum", "a340"])
def test_left_and_right_are_mirror_images(name):
    """Facet by facet, by the centres of facets."""
    centres = np.array([corners.mean(axis=0) for corners in MODELS[name].corners])
    distances, _ = cKDTree(centres).query(centres * (1, -1, 1))
    assert distances.max() < 2 * PRINTED


def test_files_depend_on_nothing_but_the_scripts(tmp_path):
    main(tmp_path / "new")
    assert {file.name: file.read_bytes() for file in (tmp_path / "new").iterdir()} == {
        name: text.encode("ascii") for name, text in TEXTS.items()}
    assert not any("-0.000000" in text for text in TEXTS.values())


def test_patch_cuts_what_is_not_plane_and_leaves_out_what_has_no_area():
    flat = [[(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 0), (1, 1, 0), (1, 1, 0)]]
    assert [len(corners) for _, corners in patch(flat, "")] == [4, 3]
    assert [tuple(area_vector(corners)) for _, corners in patch(flat, "")] == [(0, 0, 1), (0, 0, 0.5)]
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
    """By where a facet lies: only wings reach beyond the radius; the nose begins 0.3 m behind the tip."""
    model = MODELS[name]
    seen = Counter()
    for corners, (kind, material, kelvin, region) in zip(model.corners, model.labels):
        x, y, _ = corners.mean(axis=0)
        if np.abs(corners[:, 1]).max() > 0.1501:
            place = f"{'left' if y > 0 else 'right'} wing {'front' if x > -0.15 else 'rear'}"
        else:
            place = "nose" if x > 0.3 else f"{'front' if x > -0.15 else 'rear'} fuselage"
        assert (kind, material, float(kelvin)) == ("f", finish, TABLE_3_2[place][column])
        assert region.replace("_", " ") == place
        seen[place] += 1
    assert seen.keys() == TABLE_3_2.keys()


@pytest.mark.parametrize("name", ["cylinder_bare_aluminum", "cylinder_gloss_black"])
def test_cylinder_has_its_dimensions(name):
    """1.2 m long, 1 m span, corners on a radius of 0.15 m; the 40-gon stands on a side, so it is lower by its apothem."""
    vertices = MODELS[name].vertices
    assert np.allclose(vertices.max(axis=0), (0.6, 0.5, 0.15 * cos(pi / 40)), atol=PRINTED)
    assert np.allclose(vertices.min(axis=0), (-0.6, -0.5, -0.15 * cos(pi / 40)), atol=PRINTED)
    body = vertices[np.abs(vertices[:, 1]) < 0.15]
    assert np.hypot(body[:, 1], body[:, 2]).max() == pytest.approx(0.15, abs=PRINTED)


@pytest.mark.parametrize("name", ["cylinder_bare_aluminum", "cylinder_gloss_black"])
def test_cylinder_encloses_cylinder_nose_and_wings(name):
    """Prism and two boxes exactly; the nose lies under the ogive of revolution, by less than its chords' sagitta.

    Ogive: V = pi (L rho^2 - L^3 / 3 - (rho - R) rho^2 asin(L / rho)). Six chords of an arc of length s and radius rho
    lie at most (s / 6)^2 / (8 rho) below it, over a lateral area below 2 pi R s.
    """
    polygon = 20 * sin(pi / 20)  # area of the 40-gon of radius 1
    rho = (0.15**2 + 0.3**2) / 0.3
    ogive = 0.3 * rho**2 - 0.3**3 / 3 - (rho - 0.15) * rho**2 * asin(0.3 / rho)
    arc = rho * asin(0.3 / rho)
    # Stations are even in x, so the steepest chord is longer than arc / 6: by 1 / cos of the slope, 53 degrees at the tip.
    sagitta = (0.05 / cos(asin(0.3 / rho))) ** 2 / (8 * rho)
    wings = 2 * (0.5 - 0.15 * cos(pi / 40)) * 0.45 * 0.3 * sin(pi / 40)
    most = polygon * (0.15**2 * 0.9 + ogive) + wings
    missing = most - volume(MODELS[name].corners)
    assert 0 < missing < 2 * pi * 0.15 * arc * sagitta < 0.04 * most


def test_wing_root_is_a_sharp_corner_of_small_facets():
    """Along the root of the left wing's upper side a wing facet and a fuselage facet share each edge, within a few cm."""
    model = MODELS["cylinder_bare_aluminum"]
    owners = defaultdict(list)
    for number, face in enumerate(model.faces):
        for edge in zip(face, face[1:] + face[:1]):
            owners[frozenset(edge)].append(number)
    y, z = 0.15 * cos(pi / 40), 0.15 * sin(pi / 40)
    on_root = {number for number, vertex in enumerate(model.vertices) if np.allclose(vertex[1:], (y, z), atol=PRINTED)}
    pairs = [pair for edge, pair in owners.items()
             if edge <= on_root and any("wing" in model.labels[number][3] for number in pair)]
    assert len(pairs) == 12
    for pair in pairs:
        pair = sorted(pair, key=lambda number: "wing" in model.labels[number][3])
        assert ["wing" in model.labels[number][3] for number in pair] == [False, True]
        fuselage, wing = (area_vector(model.corners[number]) for number in pair)
        assert np.allclose(wing / np.linalg.norm(wing), (0, 0, 1))
        tilt = radians(9)  # the middle of the next side of the 40-gon
        assert np.allclose(fuselage / np.linalg.norm(fuselage), (0, cos(tilt), sin(tilt)), atol=1e-4)
        assert max(np.ptp(model.corners[number], axis=0).max() for number in pair) < 0.04


# What surrounds the models

def test_ir_range_is_a_room_of_3_m():
    model = MODELS["ir_range"]
    assert np.array_equal(model.vertices.min(axis=0), (-1.5,) * 3) and np.array_equal(model.vertices.max(axis=0), (1.5,) * 3)
    assert volume(model.corners) == pytest.approx(-27, rel=1e-12)
    for corners, label in zip(model.corners, model.labels):
        centre = corners.mean(axis=0)
        assert np.abs(centre).max() == 1.5 and area_vector(corners) @ centre < 0
        expected = ("s", "ir_range_wall", "263", "group=walls") if centre[2] > 0 else ("t", "ir_range_wall", "253", "group=walls")
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
        assert np.ptp(elevation) == pytest.approx(9, abs=1e-5)  # a µm at the zenith is worth 1e-8 degrees, by arcsin 1e-5
        assert area_vector(corners) @ corners.mean(axis=0) < 0
        assert material == "blackbody"
        if middle > 0:
            key, degrees = word.split("=")
            assert (kind, kelvin, key) == ("s", "288", "elevation_deg") and float(degrees) == pytest.approx(middle, abs=1e-5)
            rings[degrees] += 1
        else:
            assert (kind, kelvin, word) == ("t", "302.5", "group=terrain")
    assert rings == {f"{degrees:g}": 20 for degrees in np.arange(4.5, 90, 9)}


def test_world_sphere_is_filled():
    """Stacked 20-gons, against the ball: the polygons take 1.6 % away, the chords of 9 degrees less than 0.7 %."""
    model = MODELS["world_sphere"]
    assert -volume(model.corners) == pytest.approx(stacked_volume(model.corners, axis=2), rel=1e-9)
    ball = 4 / 3 * pi * 10e3**3 * 10 * sin(pi / 10) / pi
    assert 0.993 * ball < -volume(model.corners) < ball


# The airliner

def test_airliner_has_the_public_dimensions(parts):
    assert parts.keys() == AIRLINER_BODIES
    lowest, highest = MODELS["a340"].vertices.min(axis=0), MODELS["a340"].vertices.max(axis=0)
    assert np.allclose([lowest[:2], highest[:2]], [(-63.69 / 2, -60.30 / 2), (63.69 / 2, 60.30 / 2)], atol=PRINTED)
    fuselage = np.concatenate(parts["fuselage"])
    assert np.allclose([fuselage[:, 1].min(), fuselage[:, 1].max()], (-2.82, 2.82), atol=PRINTED)
    assert np.ptp(np.concatenate(parts["tailplane"])[:, 1]) == pytest.approx(19.4, abs=PRINTED)
    assert all(volume(polygons) > 0 for polygons in parts.values())
    for number, lateral in ENGINES.items():
        nacelle = np.concatenate(parts[f"nacelle_{number}"])
        assert (nacelle[:, 1].min() + nacelle[:, 1].max()) / 2 == pytest.approx(lateral, abs=PRINTED)


def test_airliner_wing_sweeps_back_30_degrees(parts):
    """Quarter-chord line from kink to tip, and a dihedral of 5 degrees."""
    wing = np.concatenate(parts["wing"])
    stations = []
    for lateral in (9.9, 29.0):
        chord = wing[np.abs(wing[:, 1] - lateral) < 1e-6]
        quarter = chord[:, 0].max() - np.ptp(chord[:, 0]) / 4
        stations.append((quarter, (chord[:, 2].min() + chord[:, 2].max()) / 2))
    (x_kink, z_kink), (x_tip, z_tip) = stations
    assert np.degrees(np.arctan2(x_kink - x_tip, 29.0 - 9.9)) == pytest.approx(30, abs=0.5)
    assert np.degrees(np.arctan2(z_tip - z_kink, 29.0 - 9.9)) == pytest.approx(5, abs=0.1)


@pytest.mark.parametrize("name, axis", [
    ("fuselage", 0), ("belly", 0), ("tailplane", 1), ("fin", 2), *((f"pylon_{number}", 2) for number in ENGINES)])
def test_airliner_bodies_are_filled(parts, name, axis):
    assert volume(parts[name]) == pytest.approx(stacked_volume(parts[name], axis), rel=1e-5)


def test_airliner_wing_is_filled(parts):
    """Both wings out to 29 m as stacks of profiles; what is left are two winglets of 3 m^2 and a few cm of thickness."""
    inner = [corners for corners in parts["wing"] if np.abs(corners[:, 1]).max() < 29 + PRINTED]
    winglets = volume(parts["wing"]) - stacked_volume(inner, axis=1)
    assert 2 * 0.1 < winglets < 2 * 0.7


@pytest.mark.parametrize("number", ENGINES)
def test_airliner_engine_has_annulus_and_cone(parts, number):
    """The annulus faces straight aft, fills the gap between cowl and cone, and the cone is 20 ft long: 6.1 m."""
    model = MODELS["a340"]
    by_label = defaultdict(list)
    for corners, label in zip(model.corners, model.labels):
        by_label[tuple(label)].append(corners)
    annulus = by_label["f", "blackbody", "800", "group=hot_parts", f"engine_{number}"]
    cone = by_label["f", "blackbody", "500", "group=plume", f"engine_{number}"]
    cowl = by_label["f", "bareAl", "300", f"nacelle_{number}"]
    normals = np.array([area_vector(corners) for corners in annulus])
    assert (normals[:, 0] < 0).all() and np.allclose(normals[:, 1:], 0)
    polygon = 12 * sin(pi / 12)  # area of the 24-gon of radius 1
    assert -normals[:, 0].sum() == pytest.approx(polygon * (0.55**2 - 0.3**2), rel=1e-5)
    tip, base = np.concatenate(cone)[:, 0].min(), np.concatenate(cone)[:, 0].max()
    assert base - tip == pytest.approx(6.1, abs=2 * PRINTED)
    assert np.allclose(np.concatenate(annulus)[:, 0], base)
    assert np.concatenate(cowl)[:, 0].min() == base
    # The whole is the cone and the stack of the cowl's rings, whose front disc adds no volume.
    cowl_rings = [corners for corners in cowl if np.ptp(corners[:, 0]) > 0]
    expected = polygon * 0.3**2 * 6.1 / 3 + stacked_volume(cowl_rings, axis=0)
    assert volume(parts[f"nacelle_{number}"]) == pytest.approx(expected, rel=1e-5)


def test_airliner_is_bare_aluminium_at_300_K_but_for_the_exhausts():
    labels = Counter(tuple(label[:3]) for label in MODELS["a340"].labels)
    assert labels.keys() == {("f", "bareAl", "300"), ("f", "blackbody", "800"), ("f", "blackbody", "500")}


def inside(points, polygons):
    """Which points lie inside a closed body: those from which its facets fill the whole sphere of directions."""
    triangles = np.array([corners[[0, k, k + 1]] for corners in polygons for k in range(1, len(corners) - 1)])
    a, b, c = np.moveaxis(triangles[None] - np.asarray(points)[:, None, None], 2, 0)
    la, lb, lc = (np.linalg.norm(side, axis=-1) for side in (a, b, c))
    # Van Oosterom and Strackee: tan(solid angle / 2) of a triangle seen from the origin.
    dot = lambda u, v: np.sum(u * v, axis=-1)
    angle = 2 * np.arctan2(dot(a, np.cross(b, c)), la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb)
    return np.abs(angle.sum(axis=1)) > 2 * pi


def test_airliner_parts_reach_into_each_other(parts):
    """No gap where parts join: the hidden end of each lies wholly inside its neighbour, or in the middle of the wing."""
    def end(name, axis, side):
        points = np.unique(np.concatenate(parts[name]), axis=0)
        return points[np.abs(points[:, axis] - side(points[:, axis])) < PRINTED]

    assert inside(end("fin", 2, np.min), parts["fuselage"]).all()
    for name in ("wing", "tailplane"):
        root = np.concatenate(parts[name])
        root = root[np.abs(root[:, 1]) < PRINTED]
        assert inside(root, parts["fuselage"]).all()
    for number in ENGINES:
        assert inside(end(f"pylon_{number}", 2, np.max), parts["wing"]).all()
        assert inside(end(f"pylon_{number}", 2, np.min), parts[f"nacelle_{number}"]).all()


def test_airliner_exhausts_stand_free(parts):
    """No corner of annulus or cone on the left side lies inside a pylon, the wing or any other body."""
    model = MODELS["a340"]
    hot = np.concatenate([corners for corners, label in zip(model.corners, model.labels) if label[1] == "blackbody"])
    hot = np.unique(hot[hot[:, 1] > 0], axis=0)
    for name, polygons in parts.items():
        if not name.startswith("nacelle"):
            assert not inside(hot, polygons).any(), name
