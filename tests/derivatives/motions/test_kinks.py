"""Kinks where facets of convex black bodies turn edge-on, whose projected areas are known."""

from functools import partial

import numpy as np
import pytest

import mi_lcair
from mi_lcair.derivatives.motions.kinks import turning_facets
from mi_lcair.plugins.emission.triangles import triangle_vertices
from mi_lcair.rendering.parameters.values import changed
from tests.derivatives.motions.test_differences import (
    CUBE,
    L,
    convex_hull,
    derivative,
    facets_intensity,
    mesh,
    scene_of,
)

KINK = 12.1089743  # yaw at which a facet of the hull below turns edge-on [deg]


@pytest.mark.parametrize("away", [0.001, -0.003, 0.03, -0.3])
def test_a_kink_beside_the_present_value(away):
    """A facet of a hull turns edge-on nearby: the kink is named, and both sides are known."""
    points = (0.5 * np.random.default_rng(3).normal(size=(12, 3))).astype(np.float32).astype(float)
    intensity = partial(facets_intensity, points, "yaw_deg")
    slopes = [(intensity(x + 1e-5) - intensity(x)) / 1e-5 for x in (KINK - 2e-5, KINK + 1e-5)]
    present = (intensity(KINK + away + 1e-5) - intensity(KINK + away - 1e-5)) / 2e-5
    scene = scene_of(convex_hull("body", points), window=4)
    with changed(scene, {"body.yaw_deg": KINK + away}):
        result = mi_lcair.sensitivities(scene, ["body.yaw_deg"], paths=2**12)
    found = result.differences["body.yaw_deg"]
    assert found.verdict == "kink" and found.kink == pytest.approx(-away, abs=1e-4)
    jump, errors = np.ptp(slopes), found.one_sided_errors
    assert (
        jump > 0.1 and (np.abs(np.subtract(found.one_sided, slopes)) < 3 * np.array(errors)).all()
    )
    assert abs(found.derivative - present) < 3 * found.error and 0 < max(errors) < 0.05 * jump
    side = "above" if away > 0 else "below"
    assert f"{-away:+.3g}, where facets turn edge-on" in result.kinks()[0]
    assert result.kinks()[0].endswith(f"The table has the one {side}.")


def test_a_kink_of_the_observer():
    """At azimuth 0 two sides of a cube swap."""
    scene = scene_of(convex_hull("cube", CUBE))
    with changed(scene, {"observer.azimuth_deg": -0.01}):
        found = derivative(scene, "observer.azimuth_deg", 2**10)
    slope = L * np.cos(np.radians(20)) * np.pi / 180
    assert (found.verdict, found.kink) == ("kink", pytest.approx(0.01, abs=1e-4))
    assert found.one_sided == pytest.approx((-slope, slope), rel=2e-3)
    assert found.derivative == pytest.approx(-slope, rel=2e-3)


def test_facets_that_stay_edge_on_or_turn_elsewhere():
    """A shift turns nothing, and a corner of 45 degrees none within half a degree."""
    scene = scene_of(convex_hull("cube", CUBE), view=np.array([1.0, 0, 0]))
    camera = scene.sensor(0)
    assert turning_facets(scene, camera, "cube.y_m", 0.0, 0.01, 1.0) == []
    assert turning_facets(scene, camera, "cube.yaw_deg", 45.0, 0.5, 57.3) == []
    (at,) = turning_facets(scene, camera, "cube.yaw_deg", 0.0, 0.5, 57.3)
    assert at.among.sum() == 4 and at.offset == pytest.approx(0, abs=1e-9)
    # 1/16 of the window's area is 1 m^2: two triangles of half of it show on each side
    assert [at.area(side * 0.5, side) for side in (-1, 1)] == pytest.approx(
        [np.sin(np.radians(0.5)) / 16] * 2, rel=1e-3
    )


@pytest.mark.parametrize("reflectance", [0.0, 0.5])
def test_a_box_that_stands_on_a_plate(reflectance):
    """Lifted, it hides as much of the plate as before; pushed down, its sides become shorter."""
    corners = np.array([[x, y, z] for x in (-0.3, 0.3) for y in (-0.3, 0.3) for z in (0, 0.5)])
    box = mesh(
        "box", corners, triangle_vertices(convex_hull("box", corners)), reflectance, kelvin=400.0
    )
    plate = np.array([[-3, -1, 0], [1, -1, 0], [1, 1, 0], [-3, 1, 0.0]])
    plate = mesh("plate", plate, [[0, 1, 2], [0, 2, 3]], reflectance)
    scene = scene_of(box, plate, max_bounces=int(2 * reflectance))
    result = mi_lcair.sensitivities(scene, ["box.z_m"], paths=2**13)
    found = result.differences["box.z_m"]
    assert found.verdict == "kink" and found.touches
    assert "at its value, where parts of the model touch" in result.kinks()[0]
    if not reflectance:
        below = 0.6 * np.cos(np.radians(20)) * ((400 / 300) ** 4 - 1) * L
        errors = np.array(found.one_sided_errors)
        assert (np.abs(np.subtract(found.one_sided, [below, 0])) < 4 * errors).all()
        assert errors.max() < 0.1 * below
        with changed(scene, {"box.z_m": 0.1}):
            assert not mi_lcair.sensitivities(scene, ["box.z_m"], paths=2**12).kinks()
