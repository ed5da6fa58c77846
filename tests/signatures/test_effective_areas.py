"""Tests of effective areas: a closed cube against radiosity, and other temperatures."""

import csv
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from docs.studies.claims.lit import X, Y, turned_to_front
from docs.studies.claims.scene_file import BLACK, UP, Place, SceneFile, diffuse, thermal
from docs.studies.claims.sources import corners
from docs.studies.claims.view_factors import to_polygon
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance, spectral_radiance
from mi_lcair.rendering.scene import checked
from tests.plugins.conftest import plate  # noqa: F401, a fixture
from tests.plugins.small_scenes import SQUARE, camera
from tests.scenes.view_factors import WALLS, cube

EMISSIVITY = np.array([0.9, 0.5, 0.3, 0.6, 0.2, 0.8])
TEMPERATURES = np.array([300.0, 350, 400, 450, 500, 600])
# Corners of a wall on the lower (0) and on the upper (1) side, anticlockwise seen from inside.
CORNERS = {
    0: [(0, 0), (1, 0), (1, 1), (0, 1)],
    1: [(0, 0), (0, 1), (1, 1), (1, 0)],
}


def closed_cube(plate, band_name="LWIR", temperatures=TEMPERATURES):
    """Six grey walls of a unit cube, each with its own group.

    A sensor inside the cube sees the whole of wall 0.
    """
    shapes = {}
    for k, ((axis, side), e, T) in enumerate(zip(WALLS, EMISSIVITY, temperatures)):
        corners = np.full((4, 3), float(side))
        corners[:, [(axis + 1) % 3, (axis + 2) % 3]] = CORNERS[side]
        grey = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 1 - e}}
        shapes[f"wall{k}"] = plate(f"wall{k}", corners, grey, float(T), band_name, group=f"wall{k}")
    sensor = camera(size=16, height=1.0, origin=(0.9, 0.5, 0.5), target=(0, 0.5, 0.5))
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "bounce_path", "max_bounces": 2},
            "sensor": sensor,
            **shapes,
        },
        optimize=False,
    )
    return checked(scene, Path("cube.xml"), {})


def radiosity(n):
    """Mean radiance of wall 0 per unit blackbody radiance of each wall, shape (6,).

    It includes two diffuse reflections. Each wall has n x n patches.
    """
    F, e, own = cube(n), np.repeat(EMISSIVITY, n * n), np.repeat(np.arange(6), n * n)
    shares = []
    for wall in range(6):
        term = total = np.where(own == wall, e, 0.0)
        for _ in range(2):
            term = (1 - e) * (F @ term)
            total = total + term
        shares.append(total[own == 0].mean())
    return np.array(shares)


def test_view_factors_of_the_cube():
    """The view factors of the radiosity: closure, reciprocity, and the published values."""
    F = cube(2)
    np.testing.assert_allclose(F.sum(axis=1), 1, rtol=1e-12)
    np.testing.assert_allclose(F, F.T, atol=1e-14)
    assert cube(1)[0, 1] == pytest.approx(0.1998248957, abs=1e-10)


@pytest.mark.slow
def test_closed_cube(plate):
    """The effective area of each group is within 0.5 % of radiosity.

    The radiosity is extrapolated to infinitely many patches, as its error falls with 1 / n^2.
    """
    exact = (4 * radiosity(4) - radiosity(2)) / 3
    areas = mi_lcair.signature(closed_cube(plate), spp=16384, by_spectrum=True).effective_areas
    order = np.argsort([source.group for source in areas.sources])
    np.testing.assert_allclose(areas.area[0, order], exact, rtol=5e-3)  # the window has 1 m^2
    np.testing.assert_array_equal(areas.area[0], areas.area[1])  # no background here
    assert np.all(np.abs(areas.area[0, order] - exact) < 4 * areas.error[0, order] + 3e-4 * exact)


@pytest.mark.slow
def test_other_temperatures_and_bands(plate):
    """Recomputed intensities agree with new renders, within 3 standard errors of both.

    Their spectra integrate to the same intensities.
    """
    areas = mi_lcair.signature(
        closed_cube(plate), spp=256, seed=1, by_spectrum=True
    ).effective_areas
    changed = {f"wall{k}": T for k, T in enumerate((280.0, 320.0, 700.0, 300.0, 450.0, 310.0))}
    fresh = mi_lcair.signature(
        closed_cube(plate, temperatures=changed.values()), spp=256, seed=2
    ).target
    value, error = areas.intensity("target", changed)
    assert abs(value - fresh.intensity) < 3 * np.hypot(error, fresh.standard_error)
    part = mi_lcair.signature(closed_cube(plate, "9-11"), spp=256, seed=3).target
    value, error = areas.intensity(band="9-11")
    assert abs(value - part.intensity) < 3 * np.hypot(error, part.standard_error)


@pytest.mark.slow
def test_error_of_an_intensity_is_the_scatter_of_seeds(plate):
    """Standard errors from the covariance match the scatter of 16 seeds, within 5 sigma."""
    runs = [
        mi_lcair.signature(closed_cube(plate), spp=16, seed=seed, by_spectrum=True)
        for seed in range(16)
    ]
    values, errors = np.array([run.effective_areas.intensity("scene") for run in runs]).T
    assert values.var(ddof=1) == pytest.approx(np.mean(errors**2), rel=5 * np.sqrt(2 / 15))
    for part in ("scene", "target"):
        for name in ("wall0", "wall5"):
            shares = [getattr(run, part).by_group[name] for run in runs]
            claimed = np.mean([getattr(run, part).by_group_error[name] ** 2 for run in runs])
            assert np.var(shares, ddof=1) == pytest.approx(claimed, rel=5 * np.sqrt(2 / 15))
    np.testing.assert_allclose(values, [run.intensity for run in runs], rtol=1e-6)


@pytest.fixture
def many(plate, tmp_path):
    """A scene with more temperatures than can be told apart.

    100 small blackbodies of 100 temperatures lie in front of a surface of two facets, beside a sky.
    """
    black = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}}
    grey = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.5}}
    table = tmp_path / "lines.csv"
    rows = [(8 + k / 50, 2 + np.sin(k)) for k in range(201)]
    table.write_text(
        "wavelength_um,radiance_W_m2_sr_um\n" + "".join(f"{x:.9g},{y:.9g}\n" for x, y in rows)
    )
    shapes = {}
    for k in range(50):
        x, y = -4 + 0.8 * (k % 10), -2 + k // 10
        corners = [[x, y, 1], [x, y + 0.5, 1], [x + 0.5, y + 0.5, 1], [x + 0.5, y, 1]]
        shapes[f"s{k}"] = plate(
            f"s{k}", corners, black, [250.0 + 2 * k, 251.0 + 2 * k], group="patches"
        )
    sky = plate("sky", [[-9, -9, 30], [-9, 9, 30], [9, 9, 30], [9, -9, 30]], black)
    sky["emitter"] = {
        "type": "thermal",
        "spectrum": str(table),
        "band": "LWIR",
        "group": "sky",
        "facet_type": "sky",
    }
    floor = plate("floor", SQUARE, grey, 300.0, group="floor")
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "bounce_path", "max_bounces": 1},
            "sensor": camera(16),
            "floor": floor,
            "sky": sky,
            **shapes,
        },
        optimize=False,
    )
    return checked(scene, Path("many.xml"), {})


@pytest.mark.slow
def test_more_temperatures_than_can_be_told_apart(many):
    """The spectrum by wavelength integrates to the in-band intensity.

    Its shape is the sum of Planck's law over each group.
    """
    result = mi_lcair.signature(many, spp=64, by_spectrum=True)
    areas = result.effective_areas
    assert [source.group for source in areas.sources] == ["sky"] and areas.nodes_um.size
    x = areas.wavelengths_um()
    np.testing.assert_allclose(
        np.trapezoid(areas.spectrum(x).sum(axis=1), x),
        [result.target.intensity, result.scene.intensity],
        rtol=1e-5,
    )
    sky = areas.spectrum(x)[1, 0]
    assert np.trapezoid(sky, x) == pytest.approx(result.scene.by_group["sky"], rel=1e-5)
    assert result.scene.by_group["sky"] > result.target.by_group["sky"] * (1 - 1e-6) > 0
    with pytest.raises(InputError, match="too many temperatures"):
        areas.intensity("target", {"floor": 310.0})


@pytest.mark.slow
def test_by_wavelength_is_planck(plate):
    """The spectrum of 65 temperatures is the sum over the facets that the sensor sees.

    The scene has no reflections.
    """
    black = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}}
    temperatures = np.linspace(280, 800, 66)
    shapes = {
        f"s{k}": plate(
            f"s{k}", [[x, -4, 0], [x + 0.2, -4, 0], [x + 0.2, 4, 0], [x, 4, 0]], black, [T0, T1]
        )
        for k, (x, T0, T1) in enumerate(
            zip(np.arange(33) * 0.25 - 4, temperatures[::2], temperatures[1::2])
        )
    }
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "bounce_path", "max_bounces": 0},
            "sensor": camera(16),
            **shapes,
        },
        optimize=False,
    )
    result = mi_lcair.signature(
        checked(scene, Path("strips.xml"), {}), spp=64, by_spectrum=True, facets=True
    )
    x = np.linspace(8, 12, 7)
    facets = result.facets.table
    # The sampled area of each facet is its intensity over its in-band radiance.
    planck = [
        I / in_band_radiance(band("LWIR"), T) * spectral_radiance(x, T)
        for I, T in zip(facets["intensity_W_sr"], facets["temperature_K"])
    ]
    np.testing.assert_allclose(
        result.effective_areas.spectrum(x)[0, 0], np.sum(planck, axis=0), rtol=2e-6
    )


@pytest.mark.slow
def test_csv_and_plot(many, tmp_path):
    result = mi_lcair.signature(many, spp=16, by_spectrum=True)
    result.effective_areas.save(tmp_path / "s.csv")
    rows = [
        line for line in (tmp_path / "s.csv").read_text().splitlines() if not line.startswith("#")
    ]
    table = {name: np.array(column, float) for name, *column in zip(*csv.reader(rows))}
    integral = np.trapezoid(table["target_W_sr_um"] * table["response"], table["wavelength_um"])
    assert integral == pytest.approx(result.target.intensity, rel=1e-5)
    np.testing.assert_allclose(
        table["scene.sky_W_sr_um"] + table["scene.blackbodies_W_sr_um"],
        table["scene_W_sr_um"],
        rtol=1e-7,
    )
    result.effective_areas.plot(tmp_path / "s.png")
    assert (tmp_path / "s.png").stat().st_size > 10000


@pytest.mark.slow
def test_a_response_band(plate, tmp_path):
    """The effective areas hold for any response of the band.

    The trapezoid rule over the CSV, times the response, gives the in-band intensity.
    """
    path = tmp_path / "detector.csv"
    path.write_text("wavelength_um,response\n8,0\n8.7,1\n10,0.6\n11.5,0\n")
    result = mi_lcair.signature(closed_cube(plate, str(path)), spp=4, by_spectrum=True)
    x = result.effective_areas.wavelengths_um()
    values = result.effective_areas.spectrum(x).sum(
        axis=1
    ) * result.effective_areas.band.response_at(x)
    np.testing.assert_allclose(np.trapezoid(values, x), result.intensity, rtol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("wanted", ["MWIR", "total", "7-9"])
def test_another_band_is_refused(plate, wanted):
    areas = mi_lcair.signature(closed_cube(plate), spp=2, by_spectrum=True).effective_areas
    with pytest.raises(InputError, match="material parameters of band LWIR"):
        areas.intensity(band=wanted)
    with pytest.raises(InputError, match="hold for the material parameters of band LWIR"):
        areas.spectrum([3.0, 4.0])
    with pytest.raises(InputError, match="unknown blackbody group 'wall9'"):
        areas.intensity("target", {"wall9": 300.0})
    with pytest.raises(InputError, match="group wall0: temperature = -5 K"):
        areas.intensity("target", {"wall0": -5})
    with pytest.raises(InputError, match="unknown part 'all'"):
        areas.intensity("all")


def test_one_temperature_of_a_group(plate):
    """One temperature of a group is chosen by the label's kelvin, not by its Float32 value."""
    grey = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.5}}
    floor = plate("floor", SQUARE, grey, [301.7, 310.3])
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "bounce_path", "max_bounces": 0},
            "sensor": camera(16),
            "floor": floor,
        },
        optimize=False,
    )
    areas = mi_lcair.signature(
        checked(scene, Path("x.xml"), {}), spp=16, by_spectrum=True
    ).effective_areas
    assert [source.temperature for source in areas.sources] == [301.7, 310.3]
    both = areas.intensity("target", {("self", 301.7): 350.0, ("self", 310.3): 350.0})
    assert (
        both == pytest.approx(areas.intensity("target", {"self": 350.0}))
        and areas.intensity("target", {("self", 301.7): 350.0}) < both
    )


@pytest.mark.parametrize(
    "emitter, message",
    [
        ({"type": "thermal", "radiance": 2.0}, "given `radiance` has no spectrum"),
        ({"type": "area", "radiance": {"type": "uniform", "value": 1.0}}, "has no spectrum"),
        (
            {
                "type": "thermal",
                "band": "LWIR",
                "temperature": {"type": "checkerboard", "color0": 300.0, "color1": 310.0},
            },
            "varies inside the facets",
        ),
    ],
)
def test_sources_without_a_spectrum(plate, emitter, message):
    black = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}}
    hot = plate("hot", SQUARE, black, 300.0)
    other = {**plate("other", SQUARE, black), "emitter": emitter}
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "bounce_path"},
            "sensor": camera(),
            "hot": hot,
            "other": other,
        },
        optimize=False,
    )
    with pytest.raises(InputError, match=message):
        mi_lcair.signature(checked(scene, Path("x.xml"), {}), spp=4, by_spectrum=True)


def test_total_has_no_spectrum(plate):
    with pytest.raises(InputError, match="band total has no wavelengths"):
        mi_lcair.signature(closed_cube(plate, "total"), spp=4, by_spectrum=True)


def test_of_a_black_body_the_effective_area_is_the_projected_area(plate):
    """Effective area, projected area and all their variances agree for each sample."""
    black = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}}
    slab = plate(
        "slab", [[-0.3, -0.2, 0], [0.3, -0.2, 0], [0.3, 0.2, 0], [-0.3, 0.2, 0]], black, 300.0
    )
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "bounce_path"},
            "sensor": camera(size=9, height=1.5),
            "slab": slab,
        },
        optimize=False,
    )
    areas = mi_lcair.signature(
        checked(scene, Path("slab.xml"), {}), spp=64, by_spectrum=True
    ).effective_areas
    assert areas.projected_area == pytest.approx(areas.area[0, 0], rel=1e-6)
    assert (
        areas.covariance[0].ravel()
        == pytest.approx(np.full(4, areas.covariance[0, 0, 0]), rel=1e-4)
        and areas.covariance[0, 0, 0] > 0
    )
    assert abs(areas.projected_area - 0.24) < 4 * areas.error[0, 0]


def test_a_source_that_no_path_meets_has_an_error(tmp_path):
    """A lamp of 1 cm above a floor fills 1.3e-4 of its hemisphere; none of 256 paths meets it."""
    file = SceneFile(Place())
    file.rectangle(np.zeros(3), X, Y, diffuse(0.5) + thermal("floor", 250.0))
    lamp = turned_to_front((0.5 * UP, 5e-3 * X, 5e-3 * Y), -UP)
    file.rectangle(*lamp, BLACK + thermal("lamp", 1000.0))
    file.camera(0.2 * UP, -UP, Y, 0.02, 4.0)
    scene = mi_lcair.load(file.write(tmp_path, "MWIR", 1, "false"))
    areas = mi_lcair.signature(scene, spp=4, seed=1, by_spectrum=True).effective_areas
    (k,) = (k for k, source in enumerate(areas.sources) if source.group == "lamp")
    truth = 0.5 * to_polygon(np.zeros((1, 3)), UP, corners(lamp))[0] * 0.04**2
    assert areas.area[0, k] == 0 and areas.error[0, k] > truth / 2
    assert areas.error[0, k] < 0.04**2 * 2.5 / 256
