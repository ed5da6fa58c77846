"""The airliner's dimensions and bodies.

It has the public dimensions. Its bodies are solid and join without gaps. No other body intersects
its exhausts.
"""

from collections import Counter, defaultdict
from math import pi, sin

import numpy as np
import pytest

from tests.scenes.polyhedra import (
    MODELS,
    PRINTED,
    area_vector,
    bodies,
    inside,
    stacked_volume,
    volume,
)

BODIES = {
    "fuselage",
    "belly",
    "wing",
    "tailplane",
    "fin",
    *(f"{part}_{number}" for part in ("nacelle", "pylon") for number in (1, 2, 3, 4)),
}
ENGINES = {1: 19.25, 2: 9.37, 3: -9.37, 4: -19.25}  # y in m


@pytest.fixture(scope="module")
def parts():
    """The airliner's bodies, name in their labels -> list of the facets' corners."""
    model = MODELS["a340"]
    named = {}
    for body in bodies(model):
        (name,) = {
            model.labels[number][3] for number in body if model.labels[number][1] == "bareAl"
        }
        named[name] = [model.corners[number] for number in body]
    return named


@pytest.mark.slow
def test_airliner_has_the_public_dimensions(parts):
    assert parts.keys() == BODIES
    lowest, highest = MODELS["a340"].vertices.min(axis=0), MODELS["a340"].vertices.max(axis=0)
    assert np.allclose(
        [lowest[:2], highest[:2]], [(-63.69 / 2, -60.30 / 2), (63.69 / 2, 60.30 / 2)], atol=PRINTED
    )
    fuselage = np.concatenate(parts["fuselage"])
    assert np.allclose([fuselage[:, 1].min(), fuselage[:, 1].max()], (-2.82, 2.82), atol=PRINTED)
    assert np.ptp(np.concatenate(parts["tailplane"])[:, 1]) == pytest.approx(19.4, abs=PRINTED)
    assert all(volume(polygons) > 0 for polygons in parts.values())
    for number, lateral in ENGINES.items():
        nacelle = np.concatenate(parts[f"nacelle_{number}"])
        assert (nacelle[:, 1].min() + nacelle[:, 1].max()) / 2 == pytest.approx(
            lateral, abs=PRINTED
        )


def test_airliner_wing_sweeps_back_30_degrees(parts):
    """The quarter-chord line sweeps by 30 degrees from kink to tip; the dihedral is 5 degrees."""
    wing = np.concatenate(parts["wing"])
    stations = []
    for lateral in (9.9, 29.0):
        chord = wing[np.abs(wing[:, 1] - lateral) < 1e-6]
        quarter = chord[:, 0].max() - np.ptp(chord[:, 0]) / 4
        stations.append((quarter, (chord[:, 2].min() + chord[:, 2].max()) / 2))
    (x_kink, z_kink), (x_tip, z_tip) = stations
    assert np.degrees(np.arctan2(x_kink - x_tip, 29.0 - 9.9)) == pytest.approx(30, abs=0.5)
    assert np.degrees(np.arctan2(z_tip - z_kink, 29.0 - 9.9)) == pytest.approx(5, abs=0.1)


@pytest.mark.parametrize(
    "name, axis",
    [
        ("fuselage", 0),
        ("belly", 0),
        ("tailplane", 1),
        ("fin", 2),
        *((f"pylon_{number}", 2) for number in ENGINES),
    ],
)
def test_airliner_bodies_are_filled(parts, name, axis):
    assert volume(parts[name]) == pytest.approx(stacked_volume(parts[name], axis), rel=1e-5)


def test_airliner_wing_is_filled(parts):
    """Up to 29 m the wings are stacks of profiles.

    The rest of their volume is two winglets of 3 m^2 with a thickness of a few cm.
    """
    inner = [corners for corners in parts["wing"] if np.abs(corners[:, 1]).max() < 29 + PRINTED]
    winglets = volume(parts["wing"]) - stacked_volume(inner, axis=1)
    assert 2 * 0.1 < winglets < 2 * 0.7


@pytest.mark.parametrize("number", ENGINES)
def test_airliner_engine_has_annulus_and_cone(parts, number):
    """The annulus faces aft and fills the gap between cowl and cone.

    The cone is 6.1 m (20 ft) long.
    """
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
    # The body consists of the cone and the stack of the cowl's rings. The front disc has no volume.
    cowl_rings = [corners for corners in cowl if np.ptp(corners[:, 0]) > 0]
    expected = polygon * 0.3**2 * 6.1 / 3 + stacked_volume(cowl_rings, axis=0)
    assert volume(parts[f"nacelle_{number}"]) == pytest.approx(expected, rel=1e-5)


def test_airliner_is_bare_aluminium_at_300_K_but_for_the_exhausts():
    labels = Counter(tuple(label[:3]) for label in MODELS["a340"].labels)
    assert labels.keys() == {
        ("f", "bareAl", "300"),
        ("f", "blackbody", "800"),
        ("f", "blackbody", "500"),
    }


def test_airliner_parts_reach_into_each_other(parts):
    """There is no gap where parts join.

    The hidden end of each part lies inside its neighbour.
    """

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


@pytest.mark.slow
def test_airliner_exhausts_stand_free(parts):
    """No corner of an annulus or a cone lies inside another body, tested on the left side."""
    model = MODELS["a340"]
    hot = np.concatenate(
        [corners for corners, label in zip(model.corners, model.labels) if label[1] == "blackbody"]
    )
    hot = np.unique(hot[hot[:, 1] > 0], axis=0)
    for name, polygons in parts.items():
        if not name.startswith("nacelle"):
            assert not inside(hot, polygons).any(), name
