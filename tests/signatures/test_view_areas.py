"""Tests of effective areas toward many views: against intensities, other temperatures, files."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance, spectral_radiance
from mi_lcair.plugins.emission.source import Source
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.views import View
from mi_lcair.signatures.view_areas import ViewAreas, measure_view_areas, view_areas
from tests.detection.disc_scenario import triangles, write_disc
from tests.signatures.rendered_views import render_views

VIEWS = [View(20.0, 5.0), View(100.0, 5.0), View(260.0, -10.0)]


@pytest.fixture(scope="module")
def cylinder():
    return mi_lcair.load("cylinder_ir_range", finish="gloss_black", max_bounces=2)


@pytest.fixture(scope="module")
def areas(cylinder):
    return measure_view_areas(cylinder, VIEWS, 16, Sampling(spp=8))


def test_they_give_the_intensities_of_a_render(cylinder, areas):
    """At the rendered temperatures: the same values and intervals as a render of the same paths."""
    rendered = render_views(cylinder, VIEWS, 16, Sampling(spp=8))
    intensity = areas.intensity()
    assert intensity.value == pytest.approx(rendered.parts["target"][0], rel=1e-6)
    assert intensity.half_width == pytest.approx(rendered.half_width, rel=1e-4)
    assert areas.amounts[:, -1] == pytest.approx(rendered.parts["hit"][0], rel=1e-12)


def test_edges_widen_the_intervals():
    """Where the randomisations agree, an edge decides the error: 0.3 of a mean of 0.5 W/m^2/sr."""
    sources = [Source("self", "400 K", 0.5, 400.0), Source("dark", "4 K", 0.0, 4.0)]
    means = {"source.0": 0.5, "source.1": 0.5, "hit": 1.0}
    total = SimpleNamespace(
        emitters=SimpleNamespace(
            sources=SimpleNamespace(list=sources, wavelengths_um=np.empty(0)), draws=False
        ),
        mean=lambda of: np.array([0.5] if of == "target" else [[means[name]] for name in of]),
        deviations=lambda names: np.zeros((len(names), 1, 8)),
        scatter_error=lambda name: np.array([0.1]),
        edge_error=lambda name: np.array([0.3]),
        missed=lambda name: np.array([0.0]),
        systematic=0.0,
        reached_by_window=np.array([True]),
        traced=np.array([64.0]),
    )
    scene = SimpleNamespace(name="made up", band=band("LWIR"))
    areas = view_areas(total, scene, [View(0.0)], np.array([10.0]))
    student, normal = 2.3646, 1.96
    edge = np.sqrt((normal * 0.3) ** 2 - (student * 0.1) ** 2) / normal
    assert areas.relative == pytest.approx([edge / 0.5], rel=1e-3)
    assert areas.amounts[0] == pytest.approx([10, 0, 10])  # too cold to radiate
    assert areas.reached.tolist() == [True]


def test_a_tolerance_is_reached_or_not(tmp_path):
    write_disc(tmp_path)
    disc = mi_lcair.load(tmp_path / "disc.xml")
    for tolerance, is_reached in ((0.2, True), (1e-4, False)):
        sampling = Sampling(tolerance=tolerance, max_spp=1)
        areas = measure_view_areas(disc, [View(0.0), View(40.0)], 16, sampling)
        assert areas.reached.tolist() == [is_reached] * 2


def of_disc(folder, temperatures=None, **parameters) -> ViewAreas:
    """Effective areas of the disc that faces +x, a blackbody."""
    write_disc(folder, temperatures)
    disc = mi_lcair.load(folder / "disc.xml", **parameters)
    return measure_view_areas(disc, [View(0.0), View(60.0), View(0.0, 30.0)], 16, Sampling(spp=8))


def test_another_temperature_is_that_of_another_render(tmp_path):
    """The disc at 350 K: rendered, and from effective areas that were rendered at 400 K."""
    rendered = of_disc(tmp_path, temperature=350).intensity()
    areas = of_disc(tmp_path, temperature=400)
    sets = areas.intensity({"self": np.array([400.0, 350.0])})
    for name in ("value", "standard_error", "half_width"):
        assert getattr(sets, name)[1] == pytest.approx(getattr(rendered, name), rel=1e-5)
        same = getattr(areas.intensity(), name)
        assert getattr(sets, name)[0] == pytest.approx(same, rel=1e-12)
    within_band = areas.intensity({"self": 350.0}, "3-4").value
    share = in_band_radiance(band("3-4"), 350) / in_band_radiance(band("MWIR"), 350)
    assert within_band == pytest.approx(rendered.value * share, rel=1e-5)


def test_many_temperatures_have_polynomials(tmp_path):
    """Too many temperatures for an area each: the spectrum is right, and none can be changed."""
    temperatures = np.linspace(300, 500, len(triangles()))
    areas = of_disc(tmp_path, temperatures)
    assert areas.nodes_um.size
    of_triangles = np.cross(*(triangles()[:, k] - triangles()[:, 0] for k in (1, 2)))
    size = np.linalg.norm(of_triangles, axis=1) / 2
    exact = size @ in_band_radiance(areas.band, temperatures)
    intensity = areas.intensity()
    factors = np.array([1, 0.5, np.sqrt(0.75)])
    assert np.all(np.abs(intensity.value - exact * factors) < 2 * intensity.half_width)
    assert np.all(intensity.half_width < 0.05 * intensity.value)
    wavelengths = np.linspace(3.1, 4.9, 5)
    spectrum = areas.amounts[0, :-1] @ areas.spectra_of_amounts(wavelengths)
    exact = size @ spectral_radiance(wavelengths, temperatures[:, None])
    assert spectrum == pytest.approx(exact, rel=0.05)
    with pytest.raises(InputError, match="too many temperatures"):
        areas.intensity({"self": 300.0})


def test_brighter_sources_raise_what_may_have_been_missed(tmp_path):
    """The bound follows the brightest source; with drawn directions, the largest ratio of one."""
    areas = of_disc(tmp_path, temperature=400)
    radiance = in_band_radiance(areas.band, np.array([[400.0], [500.0]]))
    ratio = (radiance[1] / radiance[0])[0]
    cold = replace(areas.sources[0], group="cold", in_band=areas.sources[0].in_band / 1000)
    both = replace(areas, sources=[*areas.sources, cold])
    changed = np.array([radiance[0, 0], radiance[1, 0]])
    assert both.brighter(changed) == pytest.approx(ratio)
    assert replace(both, is_drawn=True).brighter(changed) == pytest.approx(1000 * ratio)
    assert areas.brighter(radiance) == pytest.approx([1, ratio])


def test_a_file_holds_everything(areas, tmp_path):
    areas.save(tmp_path / "areas.nc")
    read = ViewAreas.read(tmp_path / "areas.nc")
    assert read.views == areas.views and read.band.name == areas.band.name
    for name in ("amounts", "deviations", "relative", "missed"):
        assert np.array_equal(getattr(read, name), getattr(areas, name))
    assert read.intensity().half_width == pytest.approx(areas.intensity().half_width, rel=1e-12)


def test_bad_input(areas, tmp_path):
    with pytest.raises(InputError, match="blackbody group"):
        areas.intensity({"wing": 300.0})
    with pytest.raises(InputError, match="temperature = nan K; must be positive"):
        areas.intensity({areas.sources[0].group: np.array([300.0, np.nan])})
    cold = replace(areas, sources=[replace(source, in_band=1e-31) for source in areas.sources])
    with pytest.raises(InputError, match="radiates nothing in the band"):
        cold.at_temperatures({areas.sources[0].group: 300.0})
    with pytest.raises(InputError, match="band"):
        areas.intensity(band="3-5")
    (tmp_path / "text.nc").write_text("text")
    with pytest.raises(InputError, match="text.nc"):
        ViewAreas.read(tmp_path / "text.nc")
