"""Independent errors of single facets against sums over them."""

from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.plugins.emission.source import Source
from mi_lcair.uncertainty.facet_errors import facet_contribution, sigma_of, slopes_per_area
from tests.detection.disc_scenario import disc, triangles, write_disc
from tests.uncertainty.plate_scene import (
    row,
    slope,
    triangle_areas,
)

mi.set_variant("llvm_ad_mono")


@pytest.mark.slow
def test_independent_errors_of_facets(tmp_path):
    """The disc's n equal facets: each has the n-th part of the derivative, and squares add."""
    write_disc(tmp_path, np.full(len(triangles()), 400.0))
    scenario = disc(tmp_path, render__resolution=64, render__spp=64)
    band, areas = scenario.sensor.detector().band, triangle_areas()
    one = slope(band, 400) / 1000**2
    found = mi_lcair.budget(scenario, {"facets": {"self": 2.0}}, draws=50)
    expected = 2 * one * np.sqrt(np.sum(areas**2))
    assert row(found, "self facets").contribution == pytest.approx(expected, rel=0.02)
    contribution = row(found, "self facets").contribution
    assert found.sigma_of_quantities == pytest.approx(contribution, rel=1e-12)
    assert found.monte_carlo.sigma == pytest.approx(found.sigma_of_quantities, rel=1e-6)
    # Only two of the facets, from a table
    (tmp_path / "sigma.csv").write_text("facet,sigma_K\n0,3\n7,4\n")
    found = mi_lcair.budget(scenario, {"facets": {"self": str(tmp_path / "sigma.csv")}})
    expected = one * np.hypot(3 * areas[0], 4 * areas[7])
    assert row(found, "self facets").contribution == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize(
    "facets, message",
    [
        ({"selv": 1.0}, "unknown group 'selv'; known: self"),
        ({"self": "facet,sigma_K\n9999,1\n"}, "group self has no facet 9999"),
        ({"self": "facet,sigma_K\n0,-1\n"}, "sigma_K -1; must be 0 or more"),
        ({"self": "facet,sigma_K\n0,1\n0,2\n"}, "a facet is listed twice"),
        ({"self": "number,sigma\n0,1\n"}, "the header must name facet and sigma_K"),
    ],
)
def test_facets_that_cannot_be_used(tmp_path, facets, message):
    write_disc(tmp_path, np.full(len(triangles()), 400.0))
    if isinstance(facets.get("self"), str):
        (tmp_path / "s.csv").write_text(facets["self"])
        facets = {"self": str(tmp_path / "s.csv")}
    with pytest.raises(InputError, match=message):
        mi_lcair.budget(disc(tmp_path, render__resolution=8), {"facets": facets})


class Facets:
    """A number of 2 m^2 of facets at 300 K and 5 m^2 at 350 K, with slopes of 6 and 10."""

    is_linear, what, unit = True, "plate", "W/sr"
    areas = SimpleNamespace(
        sources=[
            Source("self", "300 K", 1.0, 300.0),
            Source("other", "300 K", 1.0, 300.0),
            Source("self", "350 K", 1.0, 350.0),
            Source("self", "table", 1.0),
        ]
    )

    def source_slope(self, k):
        return (6.0, 99.0, 10.0, 99.0)[k]


def test_slopes_of_facets():
    """The slope of a source is divided among its facets by their area; unseen ones have none."""
    LWIR = band("LWIR")
    matrix = SimpleNamespace(temperature=np.array([300.0, 350.0, 300.0, 320.0]), band=LWIR)
    area = np.array([0.5, 4.0, 1.5, 0.0])
    found = slopes_per_area(Facets(), "self", matrix, area)
    np.testing.assert_allclose(found, [3.0, 2.5, 3.0, 0.0])
    number = Facets()
    number.is_linear = False
    expected = [slope(LWIR, T) for T in matrix.temperature]
    np.testing.assert_allclose(slopes_per_area(number, "self", matrix, area), expected, rtol=1e-4)
    number.unit = "W m^-2"
    with pytest.raises(InputError, match="errors of single facets in a contrast need at most 64"):
        slopes_per_area(number, "self", matrix, area)


@pytest.mark.parametrize("is_linear", [True, False])
def test_contribution_of_facets(monkeypatch, is_linear):
    """Products of different randomisations of area x slope x sigma, added over the facets.

    The first pixel sees half of the first facet beside the second one.
    """
    areas = np.array([[1.0, 3.0], [1.4, 2.6], [0.6, 3.4]])
    matrices = [np.array([[a / 2, b], [a / 2, 0]]) / (10 / 4) for a, b in areas]  # 4 on 10 m^2
    matrix = SimpleNamespace(
        matrices=matrices,
        facets=np.array([0, 1]),
        temperature=np.array([300.0, 350.0]),
        band=band("LWIR"),
    )
    monkeypatch.setattr("mi_lcair.uncertainty.facet_errors.facet_matrix", lambda *a, **k: matrix)
    number = Facets()
    number.numbers = SimpleNamespace(
        sampling=SimpleNamespace(sensor=0, seed=0),
        windows=SimpleNamespace(pixels=4),
        paths=64,
        area=10.0,
    )
    number.scene, number.columns, number.is_linear = None, 0, is_linear
    found = facet_contribution(number, "self", 2.0)
    slopes = [6 / 1.0, 10 / 3.0]  # mean areas of the facets: 1 and 3 m^2
    if not is_linear:
        slopes = [slope(matrix.band, T) for T in matrix.temperature]
    effects = 2.0 * areas * slopes
    pairs = [effects[r] @ effects[s] for r in range(3) for s in range(3) if r != s]
    assert found == pytest.approx(np.sqrt(np.mean(pairs)), rel=1e-4)
    assert number.columns == 1


def test_standard_deviations_of_facets(tmp_path):
    """One for all facets, or those of a table, in which the other facets have none."""
    facets = np.array([3, 0, 7])
    np.testing.assert_array_equal(sigma_of(facets, 2.5, "self"), [2.5, 2.5, 2.5])
    (tmp_path / "sigma.csv").write_text("facet,sigma_K\n7,3\n3,0\n")
    np.testing.assert_array_equal(sigma_of(facets, tmp_path / "sigma.csv", "self"), [0, 0, 3])
