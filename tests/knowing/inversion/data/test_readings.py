"""Images, spectra and contrasts in files, and the checks of what they hold."""

import json
from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest
from click.testing import CliRunner

import mi_lcair
from mi_lcair.cli import main
from mi_lcair.errors import InputError
from mi_lcair.knowing.inversion.data.readings import (
    Candidate,
    Measurement,
    Observation,
    check_radiance,
    check_size,
    is_on_plateau,
    measured_radiance,
    noise_of_netd,
)
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.rendering.images.files import check_kelvin, read_values
from tests.detection.disc_scenario import AREA, disc, triangles, write_disc
from tests.knowing.inversion.spectral_plate import (
    FIRST_GUESS,
    NODES,
    X,
    problem,
    spectrum,
    write_material,
    write_scene,
)

LWIR = band("LWIR")
PLAIN = {
    "channel": None,
    "quantity": "radiance",
    "scale": 1.0,
    "saturation": None,
    "mask": None,
    "sigma_image": None,
}
mi.set_variant("llvm_ad_mono")

SAMPLING = {"render.resolution": 32, "render.spp": 256}


def B(T):
    return in_band_radiance(LWIR, np.asarray(T, dtype=float))


def measurement(tmp_path, values, **changes):
    np.save(tmp_path / "a.npy", values)
    return SimpleNamespace(**PLAIN | {"image": str(tmp_path / "a.npy")} | changes)


def test_the_same_image_in_all_formats(tmp_path):
    """EXR, TIFF, CSV with three separators, and NPY give the same numbers."""
    from PIL import Image

    from mi_lcair.rendering.images.files import write_exr

    values = np.random.default_rng(1).uniform(20, 50, (5, 7)).astype(np.float32)
    np.save(tmp_path / "a.npy", values)
    write_exr(tmp_path / "a.exr", {"Y": values}, {"band": "LWIR"})
    Image.fromarray(values).save(tmp_path / "a.tiff", compression="tiff_deflate")
    np.savetxt(tmp_path / "a.csv", values, delimiter=",", fmt="%.9g")
    np.savetxt(tmp_path / "t.csv", values, delimiter="\t", fmt="%.9g")
    text = (tmp_path / "t.csv").read_text().replace(".", ",").replace("\t", ";")
    (tmp_path / "s.csv").write_text(text)
    for name in ("a.npy", "a.exr", "a.tiff", "a.csv", "t.csv", "s.csv"):
        found, what = read_values(str(tmp_path / name), None, "radiance", band("LWIR"))
        np.testing.assert_allclose(found, values, rtol=1e-7, err_msg=name)
        assert what == "radiance"
    counts = (values * 1000).astype(np.uint16)
    Image.fromarray(counts).save(tmp_path / "c.tif")
    found, _ = read_values(str(tmp_path / "c.tif"), None, "radiance", band("LWIR"))
    np.testing.assert_array_equal(found, counts)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.csv", "1,2\n3\n", "line 2: 1 numbers where the first row has 2"),
        ("a.csv", "a,b\n1,2\n", "line 1: is not a row of numbers"),
        ("a.npy", "text", "is no NumPy array"),
        ("a.tif", "text", "is no image that can be read"),
        ("a.gif", "text", "use .exr, .tif"),
    ],
)
def test_bad_images(tmp_path, name, content, message):
    (tmp_path / name).write_text(content)
    with pytest.raises(InputError, match=message):
        read_values(str(tmp_path / name), None, "radiance", band("LWIR"))


def test_a_missing_image_is_named_once(tmp_path):
    path = str(tmp_path / "missing.npy")
    with pytest.raises(InputError) as caught:
        read_values(path, None, "radiance", band("LWIR"))
    assert str(caught.value) == f"{path}: cannot be read: No such file or directory"


def test_an_image_that_is_larger_than_any_memory(tmp_path):
    """The header of the file states 728 TiB."""
    path = tmp_path / "a.npy"
    np.save(path, np.zeros((8, 16)))
    large = b"(10000000, 10000000), }"
    path.write_bytes(path.read_bytes().replace(b"(8, 16), }".ljust(len(large)), large))
    with pytest.raises(InputError, match="a.npy: has a size that does not fit into memory"):
        read_values(str(path), None, "radiance", band("LWIR"))


def test_pixels_that_count(tmp_path):
    """Finite, below the saturation after scaling, and not masked."""
    values = np.array([[1.0, np.nan, 4.0], [2.0, 3.0, 2.5]])
    np.save(tmp_path / "m.npy", np.array([[1, 1, 1], [0, 1, np.nan]]))
    one = measurement(tmp_path, values, scale=2.0, saturation=8.0, mask=str(tmp_path / "m.npy"))
    radiance, sigma, counts, _ = measured_radiance(one, LWIR, (2, 3))
    np.testing.assert_array_equal(counts, [[True, False, False], [False, True, False]])
    assert sigma is None and radiance[counts].tolist() == [2, 6]
    with pytest.raises(InputError, match="all pixels are masked, saturated or not finite"):
        measured_radiance(measurement(tmp_path, values, saturation=1.0), LWIR, (2, 3))


@pytest.mark.parametrize(("rounded", "is_plateau"), [(1e-6, True), (10.0, False)])
def test_pixels_with_the_same_largest_value_are_saturated(rounded, is_plateau):
    """Unless all values are so coarsely rounded that others are the same, too."""
    values = np.random.default_rng(2).normal(300, 5, size=(16, 16))
    values = np.minimum(rounded * np.round(values / rounded), 306.0)
    plateau = is_on_plateau(values, np.ones((16, 16), dtype=bool))
    np.testing.assert_array_equal(plateau, (values == 306.0) & is_plateau)
    assert not is_on_plateau(np.full((4, 4), 300.0), np.ones((4, 4), dtype=bool)).any()


def test_apparent_temperatures_become_radiances(tmp_path):
    """sigma dB/dT, with B by differences over 1 K."""
    kelvin = np.array([[290.0, 310.0]])
    np.save(tmp_path / "s.npy", np.array([[0.1, 0.2]]))
    one = measurement(
        tmp_path, kelvin, quantity="apparent_temperature", sigma_image=str(tmp_path / "s.npy")
    )
    radiance, sigma, counts, _ = measured_radiance(one, LWIR, (1, 2))
    np.testing.assert_allclose(radiance, B(kelvin))
    rate = B(kelvin + 0.5) - B(kelvin - 0.5)
    np.testing.assert_allclose(sigma, [[0.1, 0.2]] * rate, rtol=1e-4)
    assert counts.all()
    np.save(tmp_path / "s.npy", np.array([[0.1, 0.0]]))
    with pytest.raises(InputError, match="a standard deviation is not positive"):
        measured_radiance(one, LWIR, (1, 2))


def test_noise_of_a_netd_covers_any_share_of_shot_noise():
    """Against s0^2 (1 - f + f L / L0) for shares f: never below, and equal for one of them."""
    at_300 = 0.04 * (B(300.5) - B(299.5))
    radiance = np.append(B([30.0, 250.0, 300.0, 350.0, 1000.0]), [0.0, -1.0])
    noise = noise_of_netd(LWIR, radiance, 40.0)
    shares = np.linspace(0, 1, 11)[:, None]
    variances = at_300**2 * (1 - shares + shares * radiance / B(300.0))
    np.testing.assert_allclose(noise**2, variances.max(axis=0), rtol=1e-5)


def test_limits_of_apparent_temperatures():
    check_kelvin("a", np.array([30.0, 6000.0]))
    for kelvin in (29.9, 6001.0, np.nan):
        with pytest.raises(InputError, match=f"{kelvin:g} K; must lie in 30..6000"):
            check_kelvin("a", np.array([300.0, kelvin]))


def test_units_of_radiances():
    """Kelvin where the scene has a radiance, and a factor of more than a hundred."""
    predicted = np.full(5, float(B(300.0)))
    check_radiance("a", 0.02 * predicted, predicted, LWIR)
    check_radiance("a", 90 * predicted * 300 / 300, predicted, LWIR)
    for values, message in (
        (np.full(5, 280.0), "give quantity = 'apparent_temperature' if these are kelvin"),
        (np.full(5, 329.0), "give quantity = 'apparent_temperature' if these are kelvin"),
        (101 * predicted, "check unit, band and scale"),
        (0.0099 * predicted, "check unit, band and scale"),
    ):
        with pytest.raises(InputError, match=message):
            check_radiance("a", values, predicted, LWIR)
    check_radiance("a", np.full(5, 240.0), predicted, LWIR)  # not within 10 % of 300 K
    check_radiance("a", np.full(5, 1e9), np.zeros(5), LWIR)  # a dark scene tells nothing


def test_channels_of_an_exr(tmp_path):
    """Y if there are several, the only one otherwise; masks are of any band."""
    from mi_lcair.rendering.images.files import write_exr

    path, ones = str(tmp_path / "a.exr"), np.ones((2, 3))
    write_exr(path, {"Y": ones, "temperature.Y": 300 * ones}, {"band": "MWIR"})
    with pytest.raises(InputError, match="is of band MWIR, and not of band LWIR"):
        read_values(path, None, None, LWIR)
    assert read_values(path, None, "mask", LWIR)[0].tolist() == ones.tolist()
    values, quantity = read_values(path, "temperature.Y", None, band("MWIR"))
    assert values[0, 0] == 300 and quantity == "apparent_temperature"
    assert read_values(path, None, None, band("MWIR"))[1] == "radiance"
    write_exr(path, {"temperature.Y": 300 * ones}, {})
    assert read_values(path, None, None, LWIR)[1] == "apparent_temperature"
    write_exr(path, {"a.Y": ones, "b.Y": ones}, {})
    with pytest.raises(InputError, match="unknown channel of .* 'Y'; known: a.Y"):
        read_values(path, None, None, LWIR)


def test_size():
    check_size("a", np.zeros((2, 3)), (2, 3))
    with pytest.raises(InputError, match="has 3 x 2 pixels, and the scene's film 2 x 3"):
        check_size("a", np.zeros((2, 3)), (3, 2))


def test_a_grey_picture_in_colour(tmp_path):
    from PIL import Image

    grey = np.arange(6, dtype=np.uint8).reshape(2, 3)
    Image.fromarray(np.stack([grey] * 3, axis=-1)).save(tmp_path / "g.png")
    found, _ = read_values(str(tmp_path / "g.png"), None, "radiance", LWIR)
    np.testing.assert_array_equal(found, grey)
    Image.fromarray(np.stack([grey, grey, grey + 1], axis=-1)).save(tmp_path / "c.png")
    with pytest.raises(InputError, match="is a picture in colour"):
        read_values(str(tmp_path / "c.png"), None, "radiance", LWIR)


def test_an_image_that_is_larger_than_any_memory(tmp_path):
    """The header of the file states 728 TiB."""
    path = tmp_path / "a.npy"
    np.save(path, np.zeros((8, 16)))
    large = b"(10000000, 10000000), }"
    path.write_bytes(path.read_bytes().replace(b"(8, 16), }".ljust(len(large)), large))
    with pytest.raises(InputError, match="a.npy: has a size that does not fit into memory"):
        read_values(str(path), None, "radiance", band("LWIR"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("spectrum")
    write_material(folder, "true", 0.85 + 0.08 * np.sin(1.2 * (X - 8)))
    write_scene(folder)
    return folder


@pytest.mark.slow
def test_temperature_and_emissivity(folder):
    path = str(folder / "plate.xml")
    x, radiance = spectrum(path, 12, T=310.0, file="true.toml")
    found = mi_lcair.invert(problem(folder, path, x, radiance, 2), advise=False)
    assert found.converged
    temperature, *nodes = found.answers
    assert temperature.standard_error < 2 and temperature.lower < 310 < temperature.upper
    truth = 0.05 + 0.08 * np.sin(1.2 * (NODES - 8))
    assert FIRST_GUESS == 0.8 and [node.label for node in nodes][1] == "paint.at_8500nm"
    errors = [(a.value - value) / a.standard_error for a, value in zip(nodes, truth)]
    assert np.abs(errors).max() < 4


@pytest.mark.slow
def test_what_an_even_sky_cannot_separate_is_named(folder):
    """Under a black sky emissivity and temperature trade; structure of the sky separates them."""
    path = str(folder / "plate.xml")
    x, radiance = spectrum(path, 12, T=310.0, file="true.toml", S="250")
    found = mi_lcair.invert(
        problem(folder, path, x, radiance, 1, "250", 5e-3)
        | {"render": {"spp": 64, "iterations": 4}},
        advise=False,
    )
    assert not found.answers[0].is_determined
    assert any("`plate.temperature` and `paint.at_" in pair.words for pair in found.directions)


def test_bad_spectra(folder):
    path = str(folder / "plate.xml")
    x = np.linspace(8, 12, 5)
    for wavelengths, says in ((x + 0.2, "even over the scene's band 8-12 um"), (x[:2], "three")):
        tree = problem(folder, path, wavelengths, 0 * wavelengths + 8.0, 0)
        with pytest.raises(InputError, match=says):
            mi_lcair.invert(tree)
    tree = problem(folder, path, x, 0 * x + 8.0, 0)
    tree["unknowns"] = {"paint.emissivity": {}}
    with pytest.raises(InputError, match="paint.spectrum"):
        mi_lcair.invert(tree)
    tree["unknowns"] = {"plate.temperature": {"correlation_um": 1.0}}
    with pytest.raises(InputError, match="of spectra"):
        mi_lcair.invert(tree)


def entry(folder, contrast, sigma, **entries):
    return {
        "name": "disc",
        "scene": str(folder / "disc.toml"),
        "parameters": SAMPLING | {"target.parameters.temperature": 380} | entries,
        "contrast": contrast,
        "sigma": sigma,
    }


@pytest.mark.slow
@pytest.mark.parametrize("table", ["vacuum", "midlat_summer"])
def test_temperature_from_a_contrast(tmp_path, table):
    """The contrast of a disc of 400 K, measured 800 m away, gives its temperature back.

    The air weighs the spectrum. The standard error is that of the difference of two contrasts.
    """
    write_disc(tmp_path)
    changes = {"atmosphere__table": table, "observer__range_m": 800}
    of = lambda T: (
        mi_lcair.contrast(
            disc(
                tmp_path,
                target__parameters__temperature=T,
                render__resolution=32,
                render__spp=1024,
                **changes,
            )
        )
        .rows[-1]
        .total.value
    )
    measured, slope = of(400), (of(401) - of(399)) / 2
    sigma = 0.2 * slope
    own = {key.replace("__", "."): value for key, value in changes.items()}
    problem = {
        "data": [entry(tmp_path, measured, sigma, **own)],
        "unknowns": {"self.temperature": {}},
    }
    found = mi_lcair.invert(problem, advise=False)
    answer = found["self.temperature"]
    assert answer.value == pytest.approx(400, abs=0.15)
    assert answer.standard_error == pytest.approx(0.2, rel=0.15)
    assert answer.verdict == "determined" and found.data[0].quantity == "contrast (W m^-2)"
    if table == "vacuum":
        B = lambda T: float(in_band_radiance(band("MWIR"), T))
        assert found.data[0].predicted[0] == pytest.approx(
            AREA * (B(answer.value) - B(294)) / 800**2, rel=2e-3
        )
        # The command takes the temperature from the solution's file
        found.save(tmp_path / "s.json")
        command = ["contrast", tmp_path / "disc.toml", "-D", "observer.range_m=800", "--spp", "16"]
        command += ["-D", "target.parameters.temperature=380", "--solution", tmp_path / "s.json"]
        result = CliRunner().invoke(main, [*map(str, command), "--json"])
        assert result.exit_code == 0, result.output
        row = json.loads(result.stdout)["rows"][0]
        assert row["total_W_m2"]["value"] == pytest.approx(measured, rel=5e-3)


@pytest.mark.slow
def test_ground_below_and_behind_a_target(tmp_path):
    """Temperature of the ground from the contrast of a grey disc before it, in vacuum.

    The disc is upright: it reflects sky and ground by halves, and hides the ground.
    """
    write_disc(tmp_path)
    text = (tmp_path / "disc.xml").read_text().replace('"blackbody"', '"0.4"')
    (tmp_path / "disc.xml").write_text(text)
    B = lambda T: float(in_band_radiance(band("MWIR"), T))
    view = np.cos(np.radians(20)) * AREA / 1000**2
    of = lambda T: float(view * (0.4 * B(320) + 0.3 * (B(260) + B(T)) - B(T)))
    there = {
        "observer.elevation_deg": 20,
        "target.parameters.temperature": 320,
        "surroundings.sky": 260,
        "surroundings.ground": 290,
    }
    problem = {
        "data": [entry(tmp_path, of(300.0), 0.01 * abs(of(300.0)), **there)],
        "unknowns": {"ground.temperature": {}},
    }
    answer = mi_lcair.invert(problem, advise=False)["ground.temperature"]
    slope = (of(300.5) - of(299.5)) / of(300.0)
    assert answer.value == pytest.approx(300, abs=0.3)
    assert answer.standard_error == pytest.approx(0.01 / abs(slope), rel=0.1)


@pytest.mark.study
def test_weather_from_a_contrast(tmp_path):
    """Humidity from the contrast of a disc that reflects most of the sky, 5 km away.

    The standard error is that of the difference of two contrasts.
    """
    write_disc(tmp_path)
    text = (tmp_path / "disc.xml").read_text().replace('"blackbody"', '"0.4"')
    (tmp_path / "disc.xml").write_text(text)
    there = {
        "observer.range_m": 5000,
        "observer.elevation_deg": 20,
        "target.height_m": 1800,
        "target.parameters.temperature": 320,
        "atmosphere.table": "us_standard",
        "surroundings.sky": "clear",
        "surroundings.ground": 290,
    }
    changes = {name.replace(".", "__"): value for name, value in (SAMPLING | there).items()}
    of = lambda humidity: (
        mi_lcair.contrast(disc(tmp_path, **changes, atmosphere__humidity=humidity))
        .rows[-1]
        .total.value
    )
    measured, slope = of(0.7), (of(0.72) - of(0.68)) / 0.04
    sigma = 0.02 * abs(slope)
    problem = {
        "data": [entry(tmp_path, measured, sigma, **there)],
        "unknowns": {"scenario.air_humidity": {}},
    }
    found = mi_lcair.invert(problem, advise=False)
    answer = found["scenario.air_humidity"]
    assert answer.value == pytest.approx(0.7, abs=0.01)
    assert answer.standard_error == pytest.approx(0.02, rel=0.1)
    assert answer.verdict == "determined" and answer.unit == "1"
    assert found.data[0].predicted[0] == pytest.approx(measured, rel=2e-3)
    with pytest.raises(InputError, match="unknown parameter of the data's scenes"):
        dry = there | {"atmosphere.table": "vacuum"}
        mi_lcair.invert(problem | {"data": [entry(tmp_path, measured, sigma, **dry)]})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sensor": 1}, "a scenario has its observer"),
        ({"intensity": 1.0}, "has intensity and contrast; give one of"),
        ({"parameters": {"observer.range": 5}}, r"unknown key of \[observer\]"),
        ({"sigma": -1.0}, "must be positive"),
    ],
)
def test_bad_entries(tmp_path, changes, message):
    write_disc(tmp_path)
    problem = {
        "data": [entry(tmp_path, 1.0, 0.1) | changes],
        "unknowns": {"self.temperature": {}},
    }
    with pytest.raises(InputError, match=message):
        mi_lcair.invert(problem)


def test_facets_need_images(tmp_path):
    write_disc(tmp_path, [400.0] * len(triangles()))
    one = entry(tmp_path, 1.0, 0.1)
    one["parameters"].pop("target.parameters.temperature")
    with pytest.raises(InputError, match="facets of self are unknown, which needs images"):
        mi_lcair.invert({"data": [one], "unknowns": {"self.facets": {}}})


# Entries [[data]] and [[candidates]] that cannot be used
# -------------------------------------------------------

IMAGE = {"image": "a.npy", "quantity": "radiance", "netd_mK": 50.0}


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({}, "image, intensity, contrast, trend and spectrum are missing; give one"),
        (IMAGE | {"trend": "t.csv"}, "has image and trend; give one of"),
        (IMAGE | {"sigma": 0.1}, "gives its noise by netd_mK and sigma; give one of netd_mK"),
        ({"intensity": 0.0}, "gives its noise by nothing; give sigma"),
        ({"intensity": 1.0, "netd_mK": 50.0}, "gives its noise by netd_mK; give sigma"),
        ({"trend": "t.csv", "netd_mK": 50.0}, "gives its noise by netd_mK; give sigma"),
        (IMAGE | {"netd_mK": 0.0}, "netd_mK = 0; must be positive"),
        (IMAGE | {"netd_mK": 1e6}, "at most 100000"),
        ({"intensity": 1.0, "sigma": -1.0}, "sigma = -1; must be positive"),
        (IMAGE | {"scale": 0.0}, "scale = 0; must not be zero"),
        (IMAGE | {"sensor": -1}, "sensor = -1; "),
        ({"contrast": 1.0, "sigma": 1.0, "sensor": 1}, "a scenario has its observer"),
        ({"intensity": 1.0, "sigma": 1.0, "gain": True}, "gain needs image"),
        (IMAGE | {"offset_prior": (0.0, 1.0)}, "offset_prior needs offset = true"),
        (IMAGE | {"gain": True, "gain_prior": (1.0,)}, r"gain_prior = \[1.0\]; give 2 numbers"),
        (IMAGE | {"quantity": "counts"}, "unknown quantity 'counts'"),
        (IMAGE | {"name": "a, b"}, "name = 'a, b'; must have 1 to 64 characters"),
        (IMAGE | {"state": 65 * "s"}, "must have 1 to 64 characters"),
        (IMAGE | {"parameters": {"T": [1]}}, r"parameters: T = \[1\]; must be a text or a number"),
    ],
)
def test_unusable(entry, message):
    with pytest.raises(InputError, match=message):
        Measurement("cavity", **entry)


def test_usable():
    Measurement("cavity", **IMAGE | {"state": 64 * "s", "gain": True, "gain_prior": (1.0, 0.1)})
    Measurement("cavity", image="a.npy", sigma_image="s.npy")
    Measurement("cavity", trend="t.csv")
    Measurement("cavity", trend="t.csv", sigma=1.0)


def test_noise_of_candidates():
    assert Candidate("cavity", sigma=0.1).noises() == ["sigma"]
    with pytest.raises(InputError, match="netd_mK and sigma are missing; give one of them"):
        Candidate("cavity")
    with pytest.raises(InputError, match="has netd_mK and sigma; give one"):
        Candidate("cavity", sigma=0.1, netd_mK=50.0)


def test_parameters_of_a_scene_are_texts():
    one = Observation("cavity", parameters={"flag": True, "T": 310.5, "name": "x"})
    assert one.scene_parameters() == {"flag": "true", "T": "310.5", "name": "x"}


def test_shared_noise_belongs_to_an_image():
    for key in ("row_noise", "column_noise", "frame_noise"):
        with pytest.raises(InputError, match=f"{key} needs image; for a number raise sigma"):
            Measurement(scene="box.xml", intensity=1.0, sigma=0.1, **{key: 0.5})
        with pytest.raises(InputError, match=f"{key} = -1"):
            Measurement(scene="box.xml", image="a.exr", sigma=0.1, **{key: -1.0})
        entry = Measurement(scene="box.xml", image="a.exr", sigma=0.1, **{key: 0.5})
        assert getattr(entry, key) == 0.5
