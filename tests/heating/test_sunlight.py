"""Absorbed sunlight: squares, sheets, shadows, and light that other facets reflect."""

import mitsuba as mi
import numpy as np
import pytest

from mi_lcair.heating.paths import RANDOMISATIONS
from mi_lcair.heating.sunlight import solar_areas
from tests.heating.scenes import box, emits, grey, scene_of, square

T = mi.ScalarTransform4f()
UP = np.array([[0.0, 0.0, 1.0]])


def slanted(degrees: float) -> np.ndarray:
    h = np.radians(degrees)
    return np.array([[np.cos(h), 0, np.sin(h)]])


def test_a_square_absorbs_by_the_cosine():
    both = np.concatenate([UP, slanted(30), slanted(-30)])
    areas = solar_areas(scene_of(plate=square(grey(0.7), emitter=emits())), both, 64, 64)
    assert areas.lit.shape == (RANDOMISATIONS, 3, 1)
    np.testing.assert_allclose(areas.lit.mean(axis=0)[:, 0], [4, 2, 0], rtol=1e-5)
    np.testing.assert_allclose(areas.direct.mean(axis=0)[:, 0], [2.8, 1.4, 0], rtol=1e-5)
    assert np.all(areas.reflected == 0)


def test_a_sheet_is_lit_on_the_side_of_the_sun():
    sheet = square({"type": "twosided", "bsdf": grey(0.7)}, emitter=emits())
    suns = np.concatenate([slanted(30), slanted(-30)])
    areas = solar_areas(scene_of(sheet=sheet), suns, 64, 64)
    np.testing.assert_allclose(areas.direct.mean(axis=0)[:, 0], [1.4, 1.4], rtol=1e-5)
    # Each side absorbs what comes from its half of the sphere
    assert areas.sky.mean(axis=0).sum() == pytest.approx(0.7 * 4, rel=1e-5)
    assert areas.ground.mean(axis=0).sum() == pytest.approx(0.7 * 4, rel=1e-5)


@pytest.mark.parametrize(("elevation", "absorptance"), [(30, 0.7), (-30, 0.1)])
def test_the_absorptance_of_a_sheet_is_that_of_its_lit_side(elevation, absorptance):
    sides = {"type": "twosided", "front": grey(0.7), "back": grey(0.1)}
    areas = solar_areas(scene_of(sheet=square(sides, emitter=emits())), slanted(elevation), 64, 64)
    assert areas.absorptance == pytest.approx(absorptance, rel=1e-5)
    np.testing.assert_allclose(areas.direct, absorptance * areas.lit, rtol=1e-5)


def test_areas_are_the_same_however_many_suns_a_launch_has(monkeypatch):
    scene = scene_of(plate=square(grey(0.7), emitter=emits()))
    suns = np.concatenate([UP, slanted(30), slanted(60)])
    together = solar_areas(scene, suns, 64, 64).direct
    monkeypatch.setattr("mi_lcair.heating.sunlight.LANES", 1)
    # Sums of a launch are divided among threads, so that rounding depends on their number
    np.testing.assert_allclose(solar_areas(scene, suns, 64, 64).direct, together, rtol=1e-6)


def test_a_roof_casts_its_shadow():
    scene = scene_of(
        floor=square(grey(0.7), emitter=emits("floor")),
        roof=square(
            {"type": "twosided", "bsdf": grey(1.0)},
            T.translate([0, 0, 1]).scale([0.5, 0.5, 1]),
            emitter=emits("roof"),
        ),
    )
    areas = solar_areas(scene, UP, 64, 8192)
    np.testing.assert_allclose(areas.lit.mean(axis=0)[0], [3, 1], rtol=2e-3)


def test_what_one_wall_reflects_another_absorbs():
    """Two squares along an edge: a diffuse floor lights a wall with the view factor 0.2."""
    wall = square(grey(1.0), T.translate([1, 0, 1]).rotate([0, 1, 0], -90), emitter=emits("wall"))
    scene = scene_of(floor=square(grey(0.4), emitter=emits("floor")), wall=wall)
    areas = solar_areas(scene, UP, 32768, 64)
    assert areas.direct.mean(axis=0)[0] == pytest.approx([1.6, 0], abs=1e-5)
    assert areas.reflected.mean(axis=0)[0] == pytest.approx([0, 2.4 * 0.200044], rel=3e-3, abs=1e-6)
    assert areas.onward[[0], [1]] == pytest.approx(0.200044, rel=3e-3)


def test_light_in_a_sheets_lee_does_not_come_through():
    """What the upper side of a sheet reflects does not reach a wall below it."""
    sheet = square({"type": "twosided", "bsdf": grey(0.4)}, emitter=emits("sheet"))
    wall = square(grey(1.0), T.translate([0, 0, -1]), emitter=emits("wall"))
    areas = solar_areas(scene_of(sheet=sheet, wall=wall), UP, 1024, 64)
    assert areas.reflected.max() == 0


def test_what_a_convex_box_reflects_escapes():
    """Half of what its sides absorb of an even surrounding comes from the sky."""
    scene = scene_of(box=box(grey(0.3), inward=False, emitter=emits()))
    areas = solar_areas(scene, UP, 256, 64)
    whole = (areas.sky + areas.ground).mean(axis=0).sum()
    assert whole == pytest.approx(0.3 * 24, rel=1e-5)
    assert areas.sky.mean(axis=0).sum() == pytest.approx(0.3 * 12, rel=1e-2)
    assert areas.reflected.max() == 0 and areas.onward.nnz == 0
