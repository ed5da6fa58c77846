"""The exact results of adverse scenes, each against a second derivation."""

from dataclasses import replace

import numpy as np
import pytest

from docs.studies.claims import bodies, planck
from docs.studies.claims.case import Draw, Unsuitable
from docs.studies.claims.enclosed import overlap
from docs.studies.claims.scenes import DARKEST, KINDS, case
from docs.studies.claims.seen import below_line, clipped_area
from docs.studies.claims.sources import corners
from docs.studies.claims.view_factors import (
    by_areas,
    on_rectangle,
    parallel_rectangles,
    perpendicular_rectangles,
    to_polygon,
)

CASES = 4  # of each kind
X, Y, UP = np.eye(3)


@pytest.mark.parametrize("band", ["SWIR", "MWIR", "LWIR"])
@pytest.mark.parametrize("temperature", [20, 300, 3000])
def test_series_of_planck_is_its_integral(band, temperature):
    series = planck.in_band_radiance(band, temperature)
    assert series == pytest.approx(planck.by_quadrature(band, temperature), rel=1e-9)


def test_total_is_stefan_boltzmann():
    assert planck.in_band_radiance("total", 300) == pytest.approx(5.670374419e-8 * 300**4 / np.pi)


def test_lambert_agrees_with_closed_forms():
    """A polygon's formula, the closed form of rectangles, and the integral over both areas."""
    floor = (np.zeros(3), 0.5 * X, 0.4 * Y)
    points, weights = on_rectangle(*floor, 8)
    above = (np.array([0.3, 0.2, 0.6]), 0.2 * X, -0.3 * Y)
    exact = parallel_rectangles((-0.5, 0.5), (-0.4, 0.4), (0.1, 0.5), (-0.1, 0.5), 0.6)
    assert weights @ to_polygon(points, UP, corners(above)) == pytest.approx(exact, rel=1e-8)
    assert by_areas(floor, above, 6) == pytest.approx(exact, rel=1e-8)
    beside = (np.array([-0.6, 0.1, 0.0]), 0.3 * Y, 0.4 * UP)  # half of it is below the horizon
    exact = perpendicular_rectangles((0.1, 1.1), (-0.4, 0.4), (-0.2, 0.4), (0, 0.4))
    assert weights @ to_polygon(points, UP, corners(beside)) == pytest.approx(exact, rel=1e-8)


def test_share_below_a_line_is_a_clipped_area():
    for angle in (0.0, 0.3, np.pi / 2, 2.0):
        for offset in (-1.2, -0.4, 0.0, 0.9):
            across = np.array([np.cos(angle), np.sin(angle)])
            along = np.array([-across[1], across[0]])
            far, near = offset * across - 9 * across, offset * across
            polygon = [far - 9 * along, near - 9 * along, near + 9 * along, far + 9 * along]
            share = clipped_area(polygon, 1.0) / 4
            assert below_line(offset, 1.0, 1.0, angle) == pytest.approx(share, abs=1e-12)


def test_a_disc_in_a_square():
    x = (np.arange(200_000) + 0.5) / 200_000
    for radius in (0.3, 1.1, 1.3, 1.5):
        column = np.minimum(np.sqrt(np.maximum(radius**2 - x**2, 0)), 1)
        assert overlap(radius, 1.0) == pytest.approx(column.mean(), rel=1e-6)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_second_derivation(kind):
    number, found = 0, 0
    while found < CASES:
        number += 1
        try:
            drawn = kind(Draw(np.random.default_rng([5, number])))
        except Unsuitable:
            continue
        if drawn.mean < DARKEST:
            continue
        found += 1
        values = drawn.radiances(), drawn.materials
        assert drawn.second(*values) == pytest.approx(drawn.mean, rel=drawn.second_error), number
        # Each source alone, because one may hide the others
        for name, alone in values[0].items():
            single = {other: alone * (other == name) for other in values[0]}
            exact = float(drawn.response(single, drawn.materials).mean(axis=(1, 2)).sum())
            second = drawn.second(single, drawn.materials)
            assert second == pytest.approx(exact, rel=10 * drawn.second_error, abs=1e-30), name


def test_a_case_is_the_same_for_the_same_numbers():
    assert case(3, 5).mean == case(3, 5).mean != case(3, 6).mean
    assert sum(case(3, 5).by_group.values()) == pytest.approx(case(3, 5).mean)


def test_change_of_a_convex_body():
    """Differences of the projected areas; and everything scaled changes by twice the intensity."""
    found = (drawn for k in range(40) if (drawn := drawn_body(k)) and drawn.body is not None)
    for drawn in [next(found) for _ in range(CASES)]:
        body, values = drawn.body, (drawn.radiances(), drawn.materials)
        corners = body.corners - body.corners.mean(axis=(0, 1))
        scale, step = np.array([0.3, -1.0, 0.7]), 1e-6

        def intensity(corners, body=body, values=values):
            seen = np.maximum(replace(body, corners=corners).areas @ body.toward, 0)
            return seen @ body.radiance(*values)

        assert intensity(corners) == pytest.approx(drawn.facets(*values).sum(), rel=1e-6)
        ends = intensity(corners * (1 + step * scale)), intensity(corners * (1 - step * scale))
        slope = (ends[0] - ends[1]) / (2 * step)
        assert body.change(corners * scale, *values) == pytest.approx(slope, rel=1e-5)
        assert body.change(corners, *values) == pytest.approx(2 * intensity(corners), rel=1e-9)


def drawn_body(number):
    try:
        return bodies.body(Draw(np.random.default_rng([6, number])))
    except Unsuitable:
        return None


def test_parts_of_a_band_add_up():
    drawn = case(3, 5)
    lower, upper = planck.BANDS_UM[drawn.band]
    parts = [drawn.radiances_within(*limits) for limits in ((lower, 4.3), (4.3, upper))]
    for name, whole in drawn.radiances().items():
        assert parts[0][name] + parts[1][name] == pytest.approx(whole, rel=1e-9)
