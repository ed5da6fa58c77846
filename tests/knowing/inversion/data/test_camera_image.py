"""A camera's image as a measurement: prediction, derivatives, noise, and the temperatures in it."""

from functools import cache
from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.detection.scenario import Scenario
from mi_lcair.errors import InputError
from mi_lcair.knowing.inversion.data.camera_image import CameraImage, numbers_of
from mi_lcair.rendering.parameters.values import changed
from tests.knowing.inversion.corner import EXACT, KELVIN, NAMES, write_scenario

mi.set_variant("llvm_ad_mono")


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    return write_scenario(tmp_path_factory.mktemp("camera"))


@pytest.fixture(scope="module")
def seen(scenario):
    """What the camera records of the corner, in vacuum."""
    return mi_lcair.image(scenario, spp=1024, seed=3)


@pytest.fixture(scope="module")
def camera(scenario):
    return CameraImage.of(scenario, {})


def entry(path, **changes):
    plain = {"channel": None, "quantity": None, "scale": 1.0, "saturation": None, "mask": None}
    return SimpleNamespace(**plain | {"image": str(path)} | changes)


def test_prediction_of_the_electrons(camera, seen):
    """As `mi_lcair.image` has them, within the errors of both renders."""
    images, none = camera.predicted([], 64, 5, 3)
    assert none.shape == (3, 0, 24, 24)
    difference = images.mean(axis=0) - seen.channels["electrons.Y"]
    error = images.std(axis=0, ddof=1) / np.sqrt(3)
    assert np.mean(np.abs(difference)) < 3 * np.mean(error)
    assert abs(difference.sum()) < 4e-3 * (images.mean(axis=0) - camera.camera.background).sum()


def test_derivatives_of_the_electrons(camera):
    """Against differences of two predictions from the same paths."""
    scene, name = camera.setting.view, NAMES[3]
    _, columns = camera.predicted([name], 16, 5, 2)
    ends = []
    for step in (0.5, -0.5):
        with changed(scene, {name: KELVIN[3] + step}):
            ends.append(camera.predicted([], 16, 5, 2)[0])
    expected = ends[0] - ends[1]
    assert expected.max() > 1e4  # electrons per kelvin
    np.testing.assert_allclose(columns[:, 0], expected, atol=2e-3 * expected.max())


def test_measured_electrons_and_pixels_that_count(camera, seen, tmp_path):
    """Counts and temperatures of the file give the same electrons, but for their rounding."""
    seen.save(tmp_path / "seen.exr")
    values, counts, plateau = camera.measured(entry(tmp_path / "seen.exr"))
    from_counts, *_ = camera.measured(entry(tmp_path / "seen.exr", quantity="counts"))
    assert counts.all() and not plateau.any()
    np.testing.assert_allclose(values, from_counts, rtol=1e-5)
    frame = np.array(seen.counts[0], dtype=float)
    frame[0, 0] = 2**14 - 1
    np.save(tmp_path / "counts.npy", frame)
    _, counts, _ = camera.measured(entry(tmp_path / "counts.npy", quantity="counts"))
    assert np.argwhere(~counts).tolist() == [[0, 0]]
    with pytest.raises(InputError, match="a camera's image has counts or apparent_temperature"):
        camera.measured(entry(tmp_path / "counts.npy", quantity="radiance"))


def test_noise_of_the_camera(scenario):
    """Shot noise, read noise and quantisation; an uncorrected fixed pattern in addition."""
    camera = CameraImage.of(scenario, {"camera.gain_nonuniformity": 0.01})
    counts = np.ones((24, 24), dtype=bool)
    signal = np.full(576, 4e6)
    count = 20e6 / (2**14 - 1) / (1 - 1 / 64)
    in_time = 4e6 + 300**2 + count**2 / 12
    np.testing.assert_allclose(camera.noise(True, counts)(signal) ** 2, in_time, rtol=1e-6)
    both = in_time + (0.01 * 4e6) ** 2
    np.testing.assert_allclose(camera.noise(False, counts)(signal) ** 2, both, rtol=1e-6)


def test_noise_and_span_of_a_bolometer(scenario, tmp_path):
    """Neither end of the span counts; pattern and rows add 30 and 40 mK to 50 mK in squares."""
    entries = {"camera.detector": "bolometer", "camera.netd_mK": 50.0, "camera.span_K": [250, 400]}
    others = {"camera.sigma_vh_mK": 30.0, "camera.sigma_tv_mK": 40.0}
    plain, camera = (CameraImage.of(scenario, more) for more in (entries, entries | others))
    frame = np.full((24, 24), 5000.0)
    frame[0, :2] = 0, 2**14 - 1
    np.save(tmp_path / "counts.npy", frame)
    values, counts, _ = camera.measured(entry(tmp_path / "counts.npy", quantity="counts"))
    assert np.argwhere(~counts).tolist() == [[0, 0], [0, 1]]
    alone, both = (of.noise(True, counts)(values[counts]) ** 2 for of in (plain, camera))
    of_counts = camera.scenario.camera.electrons_per_count**2 / 12
    np.testing.assert_allclose(both - of_counts, 2 * (alone - of_counts), rtol=1e-6)


def test_values_that_share_an_error(camera):
    """A sum over pixels: variance of independent samples, blurred, against that of pixels alone."""
    random, optics = np.random.default_rng(0), camera.camera.optics
    samples = random.normal(size=(200, 3 * 24, 3 * 24))
    middle = slice(6, 18)
    images = np.array([optics.seen(sample)[middle, middle] for sample in samples])
    ratio = images.sum(axis=(1, 2)).var() / images.var(axis=0).sum()
    assert ratio == pytest.approx(camera.spread, rel=0.3)
    assert camera.spread > 1.2


@pytest.mark.slow
def test_temperatures_from_an_image(scenario, seen, tmp_path):
    seen.save(tmp_path / "seen.exr")
    given = {
        "data": [{"scene": scenario, "image": str(tmp_path / "seen.exr"), **EXACT}],
        "unknowns": {name: {"start": 300.0} for name in NAMES},
        "render": {"spp": 64},
    }
    found = mi_lcair.invert(given, advise=False)
    assert found.converged and found.data[0].quantity == "signal (electrons)"
    assert found.p_value > 1e-3
    for answer, kelvin in zip(found.answers, KELVIN):
        assert abs(answer.value - kelvin) < 4 * answer.standard_error < 0.5


def test_what_a_camera_s_image_does_not_take(scenario, tmp_path):
    np.save(tmp_path / "counts.npy", np.full((24, 24), 7000.0))
    data = {"scene": scenario, "image": str(tmp_path / "counts.npy"), "quantity": "counts"}
    given = {"data": [data], "unknowns": {NAMES[3]: {}}, "render": {"spp": 16}}
    for changes, message in (
        ({"netd_mK": 50}, "has its own; leave it out"),
        ({"sensor": 1}, "sensor cannot be combined with the image of a scenario's camera"),
        ({"offset": True}, "needs offset_prior, in electrons"),
        ({"quantity": "radiance"}, "quantity"),
        ({"parameters": {"camera.width": 12}}, "has 24 x 24 pixels"),
    ):
        with pytest.raises(InputError, match=message):
            mi_lcair.invert(given | {"data": [data | changes]}, advise=False)
    with pytest.raises(InputError, match="motions and the weather can be unk"):
        numbers_of(SimpleNamespace(list=[]), "terrain.radiance", 30.0)


def test_derivatives_with_respect_to_materials(camera):
    """(1 - R) B + R E is linear in R: one difference holds for the whole range, to 1 %.

    The strip's neighbours change by the second reflection too, which is not linear.
    """
    scene, name = camera.setting.view, "paint3.reflectance"
    (image,), ((column,),) = camera.predicted([name], 64, 5, 1)
    with changed(scene, {name: 0.35}):
        (high,), _ = camera.predicted([], 64, 5, 1)
    with changed(scene, {name: 0.25}):
        (low,), _ = camera.predicted([], 64, 5, 1)
    expected = (high - low) / 0.1
    assert np.abs(expected).max() > 100 and image.shape == column.shape
    np.testing.assert_allclose(column, expected, atol=0.02 * np.abs(expected).max())
    # At a bound the difference is one-sided
    with changed(scene, {name: 0.0}):
        _, ((bound,),) = camera.predicted([name], 64, 5, 1)
        (black,), _ = camera.predicted([], 64, 5, 1)
    with changed(scene, {name: 0.01}):
        (grey,), _ = camera.predicted([], 64, 5, 1)
    np.testing.assert_allclose(bound, (grey - black) / 0.01, rtol=1e-6, atol=1e-6)


@pytest.mark.slow
def test_a_temperature_and_a_reflectance_from_an_image(scenario, seen, tmp_path):
    seen.save(tmp_path / "seen.exr")
    given = {
        "data": [{"scene": scenario, "image": str(tmp_path / "seen.exr"), **EXACT}],
        "unknowns": {NAMES[5]: {"start": 330.0}, "paint5.reflectance": {"start": 0.4}},
        "render": {"spp": 64},
    }
    found = mi_lcair.invert(given, advise=False)
    assert found.converged
    for answer, value in zip(found.answers, (KELVIN[5], 0.3)):
        assert abs(answer.value - value) < 4 * answer.standard_error, answer


HUMID = {
    "atmosphere.table": "us_standard",
    "observer.range_m": 3000,
    "camera.focal_length_mm": 300,
    "surroundings.sky": "clear",
    "surroundings.ground": 290,
}


def table_sky(folder, factor) -> str:
    """A sky of one spectrum."""
    rows = [f"{x:g},{factor * (1 + 0.1 * x):g}" for x in np.linspace(7.5, 12.5, 101)]
    path = folder / f"sky{factor:g}.csv"
    path.write_text("\n".join(["wavelength_um,radiance_W_m2_sr_um", *rows]))
    return str(path)


@pytest.mark.slow
@pytest.mark.parametrize("elevation", [35, -35])
def test_derivatives_with_respect_to_sky_and_ground(scenario, tmp_path, elevation):
    """Against images of other scenarios: the strips reflect both, and one is behind them."""

    @cache
    def of(name, ground="290,0.8", factor=1.0):
        around = {"surroundings.ground": ground, "surroundings.sky": table_sky(tmp_path, factor)}
        place = {"observer.elevation_deg": elevation}
        if name == "sky.scale":  # it scales the light of the air before the ground, too
            place["atmosphere.table"] = "vacuum"
        elif elevation < 0:
            place["target.height_m"] = 3000
        return CameraImage.of(scenario, HUMID | around | place)

    for name, high, low, step in (
        ("ground.temperature", {"ground": "291,0.8"}, {"ground": "289,0.8"}, 2.0),
        ("ground.emissivity", {"ground": "290,0.81"}, {"ground": "290,0.79"}, 0.02),
        ("sky.scale", {"factor": 1.5}, {"factor": 0.5}, 1.0),
    ):
        part = name if name == "sky.scale" else "ground"
        high, low = (of(part, **end).predicted([], 16, 5, 1)[0][0] for end in (high, low))
        _, ((column,),) = of(part).predicted([name], 16, 5, 1)
        expected = (high - low) / step
        assert np.abs(expected).min() > 0
        np.testing.assert_allclose(column, expected, atol=2e-3 * np.abs(expected).max())


@pytest.mark.slow
def test_derivatives_with_respect_to_the_weather(scenario):
    """Against images of scenarios in other weathers; the light of the sky changes, too."""
    of = lambda humidity: CameraImage.of(scenario, HUMID | {"atmosphere.humidity": humidity})
    middle = of(0.5)
    _, ((column,),) = middle.predicted(["scenario.air_humidity"], 4, 5, 1)
    high, low = (of(humidity).predicted([], 4, 5, 1)[0][0] for humidity in (0.55, 0.45))
    expected = (high - low) / 0.1
    assert np.abs(expected).max() > 1000
    np.testing.assert_allclose(column, expected, atol=0.02 * np.abs(expected).max())
    # The light is again that of the scenario
    (again,) = middle.predicted([], 4, 5, 1)[0]
    np.testing.assert_array_equal(again, of(0.5).predicted([], 4, 5, 1)[0][0])


@pytest.mark.study
def test_humidity_from_an_image(scenario, tmp_path):
    even = HUMID | {"surroundings.sky": 260}  # the derivatives above are those below a clear one
    humid = even | {"atmosphere.humidity": 0.6}
    there = Scenario.read(scenario, **humid, **{"render.spp": 64, "render.seed": 3})
    mi_lcair.image(there).save(tmp_path / "humid.exr")
    datum = {"scene": scenario, "image": str(tmp_path / "humid.exr"), **EXACT}
    given = {
        "data": [datum | {"parameters": even}],
        "unknowns": {"scenario.air_humidity": {}},
        "render": {"spp": 4, "randomisations": 2},
    }
    found = mi_lcair.invert(given, advise=False)
    answer = found["scenario.air_humidity"]
    assert found.converged and answer.verdict == "determined"
    assert abs(answer.value - 0.6) < 4 * answer.standard_error < 0.01
