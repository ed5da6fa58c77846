"""Absorbed sunlight: squares, sheets, shadows, and light that other facets reflect."""

import mitsuba as mi
import numpy as np
import pytest

from mi_lcair.heating.paths import RANDOMISATIONS
from mi_lcair.heating.sunlight import Sunlight
from tests.heating.scenes import box, emits, grey, scene_of, square

T = mi.ScalarTransform4f()
UP = np.array([[0.0, 0.0, 1.0]])


def slanted(degrees: float) -> np.ndarray:
    h = np.radians(degrees)
    return np.array([[np.cos(h), 0, np.sin(h)]])


def test_a_square_absorbs_by_the_cosine():
    sun = Sunlight(scene_of(plate=square(grey(0.7), emitter=emits())), rays=64)
    both = np.concatenate([UP, slanted(30), slanted(-30)])
    areas = sun.areas(both)
    assert areas.lit.shape == (RANDOMISATIONS, 3, 1)
    np.testing.assert_allclose(areas.lit.mean(axis=0)[:, 0], [4, 2, 0], rtol=1e-5)
    np.testing.assert_allclose(areas.direct.mean(axis=0)[:, 0], [2.8, 1.4, 0], rtol=1e-5)
    assert np.all(areas.reflected == 0)


def test_a_sheet_is_lit_on_the_side_of_the_sun():
    sheet = square({"type": "twosided", "bsdf": grey(0.7)}, emitter=emits())
    sun = Sunlight(scene_of(sheet=sheet), rays=64)
    areas = sun.areas(np.concatenate([slanted(30), slanted(-30)]))
    np.testing.assert_allclose(areas.direct.mean(axis=0)[:, 0], [1.4, 1.4], rtol=1e-5)
    # Each side absorbs what comes from its half of the sphere
    assert sun.of_sky.mean(axis=0).sum() == pytest.approx(0.7 * 4, rel=1e-5)
    assert sun.of_ground.mean(axis=0).sum() == pytest.approx(0.7 * 4, rel=1e-5)


def test_areas_are_the_same_however_many_suns_a_launch_has(monkeypatch):
    sun = Sunlight(scene_of(plate=square(grey(0.7), emitter=emits())), rays=64)
    suns = np.concatenate([UP, slanted(30), slanted(60)])
    together = sun.areas(suns).absorbing
    monkeypatch.setattr("mi_lcair.heating.sunlight.LANES", 1)
    np.testing.assert_array_equal(sun.areas(suns).absorbing, together)


def test_a_roof_casts_its_shadow():
    scene = scene_of(
        floor=square(grey(0.7), emitter=emits("floor")),
        roof=square(
            {"type": "twosided", "bsdf": grey(1.0)},
            T.translate([0, 0, 1]).scale([0.5, 0.5, 1]),
            emitter=emits("roof"),
        ),
    )
    areas = Sunlight(scene, rays=64).areas(UP, rays=8192)
    np.testing.assert_allclose(areas.lit.mean(axis=0)[0], [3, 1], rtol=2e-3)


def test_what_one_wall_reflects_another_absorbs():
    """Two squares along an edge: a diffuse floor lights a wall with the view factor 0.2."""
    wall = square(grey(1.0), T.translate([1, 0, 1]).rotate([0, 1, 0], -90), emitter=emits("wall"))
    scene = scene_of(floor=square(grey(0.4), emitter=emits("floor")), wall=wall)
    areas = Sunlight(scene, rays=32768).areas(UP)
    assert areas.direct.mean(axis=0)[0] == pytest.approx([1.6, 0], abs=1e-5)
    assert areas.reflected.mean(axis=0)[0] == pytest.approx([0, 2.4 * 0.200044], rel=3e-3, abs=1e-6)
    np.testing.assert_array_equal(areas.absorbing, areas.direct + areas.reflected)


def test_light_in_a_sheets_lee_does_not_come_through():
    """What the upper side of a sheet reflects does not reach a wall below it."""
    sheet = square({"type": "twosided", "bsdf": grey(0.4)}, emitter=emits("sheet"))
    wall = square(grey(1.0), T.translate([0, 0, -1]), emitter=emits("wall"))
    areas = Sunlight(scene_of(sheet=sheet, wall=wall), rays=1024).areas(UP)
    assert areas.reflected.max() == 0


def test_a_box_keeps_the_light_that_enters_it():
    """What is absorbed and what escapes of the light through an opening are what entered."""
    scene = scene_of(box=box(grey(0.3), inward=False, emitter=emits()))
    sun = Sunlight(scene, rays=256)
    escapes = np.array([ends.sum(axis=1) for ends in sun.means.ends]).mean(axis=0)
    absorbed = sum(g.sum(axis=1) for g in sun.means.between) / RANDOMISATIONS
    # The box is convex, so that all that it reflects escapes
    np.testing.assert_allclose(escapes, 0.3, rtol=1e-5)
    assert np.all(absorbed == 0)
