"""Temperatures of objects: the published formula, rendered plates, and draws of uncertainties."""

import json

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.stats import norm, qmc, truncnorm

import mi_lcair
from mi_lcair import formats
from mi_lcair.errors import InputError
from mi_lcair.physics.air.clear_air import ClearPaths, clear_air
from mi_lcair.physics.air.levels import Weather
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import brightness_temperature, in_band_radiance, spectral_radiance
from mi_lcair.rendering.images.files import from_csv, from_picture, read_exr
from tests.derivatives.grey_room import NAMED, load
from tests.rendering.images.flir_files import STATED, counts_of, fff, jpeg, kelvin_of

H, C, K = 6.62607015e-34, 299792458.0, 1.380649e-23  # CODATA 2018


def W(T, low, high):
    """In-band radiance of a blackbody by adaptive quadrature of Planck's law [W m^-2 sr^-1]."""

    def planck(x):
        return 2 * H * C**2 / x**5 / np.expm1(H * C / (x * K * T))

    return quad(planck, low * 1e-6, high * 1e-6, epsrel=1e-12)[0]


def apparent(T, limits, emissivity, reflected, transmittance=1.0, air_temperature=300.0):
    """Apparent temperature by the formula of camera makers (FLIR, Photon manual, Eq 2)."""
    total = (
        emissivity * transmittance * W(T, *limits)
        + (1 - emissivity) * transmittance * W(reflected, *limits)
        + (1 - transmittance) * W(air_temperature, *limits)
    )
    return brentq(lambda t: W(t, *limits) / total - 1, 20, 6000, xtol=1e-9)


@pytest.mark.parametrize("seed", range(12))
def test_the_published_formula(seed):
    """Random objects in MWIR and LWIR, emissivities 0.05 to 1, transmittances 0.2 to 1."""
    rng = np.random.default_rng(seed)
    limits = [(3.0, 5.0), (8.0, 12.0), (7.5, 13.0)][seed % 3]
    T, reflected, air = rng.uniform(250, 900), *rng.uniform(230, 330, 2)
    given = {
        "emissivity": rng.uniform(0.05, 1),
        "reflected": reflected,
        "transmittance": rng.uniform(0.2, 1),
        "air_temperature": air,
    }
    seen = apparent(T, limits, **given)
    result = mi_lcair.temperature(seen, f"{limits[0]}-{limits[1]}", **given)
    assert result.kelvin == pytest.approx(T, abs=2e-5 * T)
    assert result.transmittance == pytest.approx(given["transmittance"])


@pytest.mark.parametrize("emissivity, T", [(0.92, 310.0), (0.2, 500.0), (0.7, 265.0)])
def test_contributions_are_the_derivatives_of_the_formula(emissivity, T):
    """By hand: epsilon tau W'(T) dT is what changes in (1)."""
    limits, tau, reflected, air = (8.0, 12.0), 0.9, 290.0, 285.0
    given = {
        "emissivity": (emissivity, 0.02),
        "reflected": (reflected, 2.0),
        "transmittance": (tau, 0.01),
        "air_temperature": (air, 3.0),
    }
    seen = apparent(T, limits, *(number[0] for number in given.values()))
    result = mi_lcair.temperature(seen, "LWIR", sigma=0.3, **given)
    slope = lambda t: (W(t + 0.01, *limits) - W(t - 0.01, *limits)) / 0.02
    own, light, glow = (W(t, *limits) for t in (T, reflected, air))
    expected = {
        "apparent": 0.3 * slope(seen),
        "emissivity": 0.02 * tau * (own - light),
        "reflected": 2.0 * (1 - emissivity) * tau * slope(reflected),
        "transmittance": 0.01 * (emissivity * own + (1 - emissivity) * light - glow),
        "air_temperature": 3.0 * (1 - tau) * slope(air),
    }
    of = emissivity * tau * slope(T)
    computed = {row.quantity: abs(float(row.contribution)) for row in result.estimate.contributions}
    assert computed == pytest.approx({k: abs(v) / of for k, v in expected.items()}, rel=2e-3)
    assert float(result.sigma) == pytest.approx(np.sqrt(sum(v**2 for v in computed.values())))


@pytest.mark.parametrize("name", ["LWIR", "3.5-4.9"])
@pytest.mark.parametrize("distance, weather", [(20.0, {}), (700.0, {"humidity": 0.8})])
def test_computed_air(name, distance, weather):
    """Against the air's transmittance for Planck's spectrum and its path radiance."""
    chosen = band(name)
    air = ClearPaths("x", clear_air("us_standard", Weather(**weather)), 50, 0.0, True, distance)
    x = air.wavelengths_um
    parts = [
        weight * L * air.band_transmittance(chosen, [spectral_radiance(x, T)], [distance])[0, 0]
        for weight, T in ((0.8, 320.0), (0.2, 290.0))
        for L in [float(in_band_radiance(chosen, T))]
    ]
    total = sum(parts) + float(air.band_path_radiance(chosen, [distance])[0])
    seen = float(brightness_temperature(chosen, total))
    given = {"emissivity": 0.8, "reflected": 290, "distance": distance, **weather}
    result = mi_lcair.temperature(seen, chosen, **given)
    assert float(result.kelvin) == pytest.approx(320, abs=1e-4)
    spectrum = [spectral_radiance(x, float(result.kelvin))]
    mean = air.band_transmittance(chosen, spectrum, [distance])
    assert result.transmittance == pytest.approx(float(mean[0, 0]), rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("T, range_m", [(310, 30), (310, 1000), (285, 1000), (400, 3000)])
def test_a_rendered_grey_plate_has_its_temperature(tmp_path, T, range_m):
    """Emissivity 0.92, surroundings of 293 K, through air; within 20 mK."""
    scene, _ = load(tmp_path, NAMED, 0.92, plate=T, room=293)
    image = mi_lcair.render(scene, spp=64, atmosphere="us_standard", range_m=range_m)
    seen = brightness_temperature(scene.band, image.channels["apparent.Y"][7:9, 6:10])
    result = mi_lcair.temperature(seen, "LWIR", emissivity=0.92, reflected=293, distance=range_m)
    np.testing.assert_allclose(result.kelvin, T, atol=0.02)
    assert abs(seen - T).max() > 0.5  # what is corrected


CASES = {
    "transmittance": {"transmittance": (0.9, 0.02), "air_temperature": (285, 3)},
    "metal": {"transmittance": (0.98, 0.005), "air_temperature": (285, 3)},
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_the_uncertainty_is_that_of_draws(case):
    """256 draws of all quantities, evenly over their distributions: their scatter to 2 %."""
    sigma = 0.2
    given = {"emissivity": (0.3 if case == "metal" else 0.92, 0.015), "reflected": (293, 2)}
    given |= CASES[case]
    seen = np.array([[300.0, 330.0, 400.0]])
    result = mi_lcair.temperature(seen, "LWIR", sigma=sigma, **given)
    points = norm.ppf(qmc.Sobol(1 + len(given), seed=77).random(256))
    drawn = [
        mi_lcair.temperature(
            seen + sigma * noise,
            "LWIR",
            **{name: mean + z * spread for z, (name, (mean, spread)) in zip(point, given.items())},
        ).kelvin
        for noise, *point in points
    ]
    np.testing.assert_allclose(result.sigma, np.std(drawn, axis=0, ddof=1), rtol=0.02)
    assert {row.quantity for row in result.estimate.contributions} == {"apparent", *given}


@pytest.mark.parametrize("emissivity, sigma", [(0.1, 0.04), (0.2, 0.1), (0.5, 0.02), (1.0, 0.05)])
def test_the_interval_holds_95_percent_of_draws(emissivity, sigma):
    """20,000 draws by the formula. The linear answer is remarked where it fails."""
    seen, N, rng = 295.0, 20_000, np.random.default_rng(8)
    lwir, given = band("LWIR"), {"reflected": (290.0, 2.0), "air_temperature": (285.0, 2.0)}
    given |= {"emissivity": (emissivity, sigma), "transmittance": (0.9, 0.02)}
    result = mi_lcair.temperature(seen, lwir, sigma=0.2, **given)
    e, tau = (truncnorm.rvs(-m / s, (1 - m) / s, m, s, N, random_state=rng) for m, s in (
        given["emissivity"], given["transmittance"]
    ))  # fmt: skip
    around, air, read = (rng.normal(*pair, N) for pair in ((290, 2), (285, 2), (seen, 0.2)))
    arriving = (in_band_radiance(lwir, read) - (1 - tau) * in_band_radiance(lwir, air)) / tau
    own = (arriving - (1 - e) * in_band_radiance(lwir, around)) / e
    drawn = brightness_temperature(lwir, own[own > 0])
    low, high = result.interval_K
    assert 0.94 < np.mean((drawn >= low) & (drawn <= high)) < 0.96
    ends = np.quantile(drawn, (0.025, 0.975))
    assert [low, high] == pytest.approx(ends, abs=0.05 * np.ptp(ends))
    remarked = [line for line in result.remarks if "the linear uncertainty is wrong: 95 %" in line]
    assert len(remarked) == (emissivity != 0.5)
    assert result.as_dict()["interval_K"] == pytest.approx([low, high])


def test_the_remark_names_the_pixel_at_which_the_linear_uncertainty_fails():
    """The cold pixel, whose interval is not that of 2 sigma; that of the hot one is wider."""
    seen = np.array([[289.9, 330.0]])
    result = mi_lcair.temperature(seen, "LWIR", emissivity=(0.92, 0.02), reflected=(293, 2))
    (remark,) = [line for line in result.remarks if "linear uncertainty is wrong" in line]
    assert remark.startswith(f"at {result.kelvin[0, 0]:.4g} K")


def test_the_interval_in_computed_air_is_that_of_draws():
    given = {"emissivity": (0.9, 0.03), "reflected": (290, 3), "distance": (1500, 300)}
    given |= {"humidity": (0.6, 0.2), "air_temperature": (285, 3)}
    result = mi_lcair.temperature(320.0, "LWIR", **given)
    points = norm.ppf(qmc.Sobol(len(given), seed=7).random(128))
    drawn = [
        mi_lcair.temperature(
            320.0, "LWIR", **{k: min(m + z * s, 0.98 if k == "humidity" else 1e4)
                              for z, (k, (m, s)) in zip(point, given.items())}
        ).kelvin
        for point in points
        if point[0] < 3.3
    ]  # fmt: skip
    ends = np.quantile(drawn, (0.025, 0.975))
    assert result.interval_K == pytest.approx(ends, abs=0.1 * np.ptp(ends))


def test_contributions_of_computed_air():
    """Central differences of the temperature over a tenth of each uncertainty."""
    seen, sigma = 330.0, 0.2
    given = {
        "emissivity": (0.92, 0.015),
        "reflected": (293, 2),
        "distance": (800, 40),
        "humidity": (0.6, 0.05),
        "air_temperature": (288, 2),
    }

    def kelvin(name, value):
        values = {"apparent": seen} | {key: mean for key, (mean, _) in given.items()}
        values[name] = value
        return float(mi_lcair.temperature(values.pop("apparent"), "LWIR", **values).kelvin)

    result = mi_lcair.temperature(seen, "LWIR", sigma=sigma, **given)
    computed = {row.quantity: abs(float(row.contribution)) for row in result.estimate.contributions}
    expected = {
        name: abs(kelvin(name, mean + spread / 20) - kelvin(name, mean - spread / 20)) * 10
        for name, (mean, spread) in {"apparent": (seen, sigma), **given}.items()
    }
    assert computed == pytest.approx(expected, rel=5e-3)
    assert float(result.sigma) == pytest.approx(np.linalg.norm([*computed.values()]))


def test_an_emissivity_of_1_with_an_uncertainty():
    """The derivative at the bound is that below it."""
    given = {"reflected": 280.0, "sigma": 0.0}
    bound, below = (
        mi_lcair.temperature(310.0, "LWIR", emissivity=(value, 0.01), **given).sigma
        for value in (1.0, 0.999)
    )
    assert bound == pytest.approx(below, rel=0.01) and bound > 0.1


def test_conditions_that_do_not_count_are_not_stated():
    """A body of emissivity 1 reflects nothing, and air of a transmittance of 1 emits nothing."""
    result = mi_lcair.temperature(310.0, "LWIR", emissivity=1)
    assert list(result.conditions) == ["emissivity", "transmittance"]
    through = mi_lcair.temperature(
        310.0, "LWIR", emissivity=1, transmittance=0.9, air_temperature=310
    )
    assert through.kelvin == pytest.approx(310, abs=1e-3)
    assert list(through.conditions) == ["emissivity", "transmittance", "air_temperature"]


@pytest.mark.parametrize("suffix", [".tif", ".csv", ".exr"])
def test_images_are_read_and_written(tmp_path, suffix):
    """NaN and 0 are nothing. What is written is the object's temperature, or nothing."""
    seen = np.array([[300.0, 310.0, np.nan], [0.0, 320.0, 305.0]])
    formats.write_tiff(tmp_path / "seen.tif", seen)
    result = mi_lcair.temperature(
        tmp_path / "seen.tif", "LWIR", emissivity="0.9+-2%", reflected="293 ± 2"
    )
    assert np.isnan(result.kelvin[0, 2]) and np.isnan(result.kelvin[1, 0])
    assert [str(number) for number in result.conditions.values()][:2] == [
        "0.9 +- 0.018",
        "293 +- 2 K",
    ]
    path = tmp_path / f"object{suffix}"
    result.save(path)
    if suffix == ".exr":
        channels, header = read_exr(path)
        written = np.where(channels["temperature.Y"] == 0, np.nan, channels["temperature.Y"])
        np.testing.assert_allclose(channels["sigma_K.Y"][0, :2], result.sigma[0, :2], rtol=1e-6)
        assert header["band"] == "LWIR"
        again = mi_lcair.temperature(path, emissivity=1)
        np.testing.assert_allclose(again.kelvin, result.kelvin, rtol=1e-6)
    else:
        written = {".tif": from_picture, ".csv": from_csv}[suffix](str(path))
    np.testing.assert_allclose(written, result.kelvin, rtol=1e-6)


def test_one_number_is_shown_with_its_error():
    """The sum of both contributions in squares, and their table from the largest share on."""
    result = mi_lcair.temperature(305.2, "LWIR", emissivity=(0.92, 0.02), reflected=(293, 2))
    assert result.summary().endswith(f": {result.headline}") and " +- 0.3" in result.summary()
    table = result.columns()
    assert table["quantity"].tolist() == ["emissivity", "reflected"]
    assert np.linalg.norm(table["contribution_K"]) == pytest.approx(float(result.sigma))
    assert table["share"].sum() == pytest.approx(1)
    assert result.sections() and result.as_dict()["estimate"]["unit"] == "K"


@pytest.mark.parametrize("scale, offset", [(0.01, 0.0), (1.0, 273.15), (0.04, 250.0)])
def test_counts_and_degrees_celsius(scale, offset):
    kelvin = np.array([[290.0, 300.0], [310.0, offset or np.nan]])  # 0 is a value with an offset
    values = np.nan_to_num((kelvin - offset) / scale)
    given = {"emissivity": 0.9, "reflected": 270}
    result = mi_lcair.temperature(values.tolist(), "LWIR", scale=scale, offset=offset, **given)
    expected = mi_lcair.temperature(kelvin, "LWIR", **given)
    np.testing.assert_allclose(result.kelvin, expected.kelvin, rtol=1e-9)


def test_impossible_pixels_are_counted():
    """Pixels colder than what reflection alone gives have no temperature."""
    seen = np.array([[300.0, 150.0, 140.0]])
    result = mi_lcair.temperature(seen, "LWIR", emissivity=0.5, reflected=290)
    assert np.isnan(result.kelvin).tolist() == [[False, True, True]]
    assert result.remarks[0].startswith("2 of 3 pixels are colder")
    assert json.dumps(result.as_dict())


@pytest.mark.parametrize(
    "given, what",
    [
        ({"image": 45.0, "emissivity": 1, "reflected": None}, "the warmest pixel is 45 K"),
        ({"reflected": 80.0}, "reflected is 80 K"),
        ({"transmittance": 0.9, "air_temperature": 75.0}, "air_temperature is 75 K"),
        ({"reflected": 200.0}, None),
        ({"emissivity": 1, "reflected": None}, None),
    ],
)
def test_kelvin_that_are_celsius_are_remarked(given, what):
    arguments = {"image": 300.0, "emissivity": 0.9, "reflected": 290} | given
    arguments = {name: value for name, value in arguments.items() if value is not None}
    remarks = mi_lcair.temperature(arguments.pop("image"), "LWIR", **arguments).remarks
    assert [f"{what}, colder than any sky; is it in degrees Celsius?"] * bool(what) == list(remarks)


@pytest.mark.parametrize(
    "given, words",
    [
        (
            {"emissivity": (0.9, 1e30)},
            "standard uncertainty of emissivity = 1e.30; must lie in 0..1",
        ),
        ({"reflected": (290, 1e30)}, "standard uncertainty of reflected = 1e.30 K; must lie in"),
        ({"sigma": 1e30}, "sigma = 1e.30 K; must lie in"),
        ({"image": "300+-1e30"}, "= 1e.30 K; must lie in"),
        ({"image": "300+--1"}, "= -1 K; must lie in"),
        ({"emissivity": 0}, "emissivity = 0; must be positive and at most 1"),
        ({"emissivity": 1.2}, "emissivity = 1.2; must be positive"),
        ({"transmittance": 0}, "transmittance = 0; must be positive"),
        ({"transmittance": 1.5}, "transmittance = 1.5; must be positive and at most 1"),
        ({"distance": 2e6}, "distance = 2e.06 m; must be positive and at most 200000"),
        ({"reflected": 20}, "reflected = 20 K; must lie in 60..6000"),
        ({"reflected": None}, "reflected is missing"),
        (
            {"emissivity": 1, "reflected": None, "transmittance": 0.9},
            "air_temperature is missing: air of a transmittance below 1 emits",
        ),
        ({"emissivity": "0.9+-"}, "emissivity '0.9.-' is no number"),
        ({"emissivity": (0.9, -1)}, "standard uncertainty of emissivity = -1"),
        ({"emissivity": "nan"}, "emissivity = nan"),
        ({"transmittance": 0.9, "distance": 10}, "cannot be combined"),
        ({"humidity": 0.5}, "humidity needs distance"),
        ({"atmosphere": "us_standard"}, "unknown quantity 'atmosphere'"),
        ({"distance": 100, "air_temperature": 400}, "temperature = 400 K"),
        ({"image": 150.0, "emissivity": 0.5}, "1 of 1 pixels are colder"),
        ({"image": 20.0}, "scale=0.01 for counts of 0.01 K, offset=273.15 for degrees Celsius"),
        ({"scale": 0}, "scale = 0; must be positive"),
        ({"image": np.full((2, 2), np.nan)}, "holds no temperature"),
        ({"image": np.array([np.inf, 300.0])}, "has infinite values"),
        ({"image": "none.tif"}, "none.tif"),
        ({"image": "300+-1", "sigma": 2.0}, "gives its uncertainty"),
        ({"band": None}, "its band is not known"),
        ({"band": "total"}, "band total"),
        ({"wind": 3}, "unknown quantity 'wind'"),
        ({"window": 0.9}, "window_temperature is missing"),
        ({"window": 1.1, "window_temperature": 290}, "window = 1.1; must be positive"),
        ({"emissivity": None}, "contains no emissivity"),
    ],
)
def test_bad_input_is_one_line(given, words):
    arguments = {"image": 300.0, "band": "LWIR", "emissivity": 0.9, "reflected": 290} | given
    arguments = {
        key: value for key, value in arguments.items() if key == "band" or value is not None
    }
    with pytest.raises(InputError, match=words.replace("+", ".")) as error:
        mi_lcair.temperature(arguments.pop("image"), **arguments)
    assert "\n" not in str(error.value)


# Radiometric files
# -----------------

SETTINGS = [  # emissivity, distance, humidity, reflected, air, window, its temperature
    (0.95, 1.0, 0.5, 293.15, 293.15, 1.0, 293.15),
    (0.3, 1.0, 0.5, 293.15, 293.15, 1.0, 293.15),
    (0.95, 100.0, 0.9, 283.15, 303.15, 1.0, 293.15),
    (0.3, 30.0, 0.1, 283.15, 273.15, 1.0, 293.15),
    (0.6, 10.0, 0.5, 303.15, 293.15, 0.8, 300.0),
    (0.8, 300.0, 0.3, 263.15, 288.15, 1.0, 293.15),
    (0.3, 0.5, 0.7, 303.15, 298.15, 0.95, 310.0),
    (0.95, 30.0, 0.98, 243.15, 283.15, 0.9, 283.15),
]
NAMES = ["emissivity", "distance", "humidity", "reflected", "air", "window", "window_K"]
OWN = dict(zip(NAMES, (*NAMES[:4], "air_temperature", "window", "window_temperature")))


@pytest.mark.parametrize("setting", SETTINGS)
def test_the_makers_formula(tmp_path, setting):
    """Counts by the formula in counts, rounded, against the formula solved in counts."""
    stated = dict(zip(NAMES, setting))
    truth = np.linspace(310.0, 420.0, 30)
    counts = np.round([[counts_of(T, stated) for T in truth]])
    path = tmp_path / "photo.jpg"
    path.write_bytes(jpeg(fff(counts, "swapped", **stated)))
    result = mi_lcair.temperature(path)
    formula = np.array([kelvin_of(n, stated) for n in counts[0]])
    np.testing.assert_allclose(result.kelvin[0], formula, atol=2e-4)  # single precision
    assert abs(np.mean(result.kelvin[0] - truth)) < 0.02


def test_options_replace_what_the_file_states(tmp_path):
    path = tmp_path / "photo.fff"
    stated = STATED | dict(zip(NAMES, SETTINGS[4]))
    path.write_bytes(fff([[counts_of(350.0, stated)]]))  # with other conditions in the file
    given = {OWN[name]: stated[name] for name in NAMES}
    result = mi_lcair.temperature(path, **given)
    assert result.headline.value == pytest.approx(350, abs=0.05)
    assert abs(mi_lcair.temperature(path).headline.value - 350) > 2
    # With a band Planck's law counts, in computed air; the curve of this camera is like 8-12 um
    given["air_temperature"], given["distance"] = 280.0, 10.0
    in_band, own = (mi_lcair.temperature(path, b, **given) for b in ("8-12", None))
    assert in_band.band.name == "8-12" and own.band.name == "7.5-14"
    assert 1e-4 < abs(in_band.headline.value - own.headline.value) < 1.5
    assert 1e-4 < abs(in_band.transmittance - own.transmittance) < 0.02
    without = mi_lcair.temperature(path, transmittance=0.9, air_temperature=290)
    assert without.transmittance == 0.9 and "distance" not in without.conditions
    for changed, words in (
        ({"scale": 0.01}, "leave scale and offset out"),
        ({"humidity": 2}, "humidity = 2"),
        ({"window": 0.9}, "window_temperature is missing"),
    ):
        with pytest.raises(InputError, match=words):
            mi_lcair.temperature(path, **changed)
    path.write_bytes(fff([[20000]], emissivity=0.0))
    with pytest.raises(InputError, match="^photo.fff, unless you .*: emissivity = 0; must be pos"):
        mi_lcair.temperature(path)


@pytest.mark.slow
def test_intervals_hold_the_truth_of_synthetic_files(tmp_path):
    """Files whose conditions differ from those that are stated as their uncertainties say."""
    path, truth, inside, apart = tmp_path / "photo.fff", (330.0, 312.0), [], []
    sigma = {"emissivity": 0.03, "reflected": 4.0, "air": 4.0, "distance": 5.0, "humidity": 0.1}
    middle = dict(zip(NAMES, (0.8, 30.0, 0.5, 290.0, 290.0, 0.9, 295.0)))
    sigma |= {"window": 0.02, "window_K": 3.0}
    given = {OWN[name]: (middle[name], sigma[name]) for name in NAMES}
    for point in norm.ppf(qmc.Sobol(len(sigma), seed=3).random(128)):
        real = {name: middle[name] + z * sigma[name] for name, z in zip(NAMES, point)}
        path.write_bytes(fff([[round(counts_of(T, real)) for T in truth]]))
        result = mi_lcair.temperature(path, spots=["0,0", "1,0"], **given)
        low, high = result.regions["from_K"][:2], result.regions["to_K"][:2]
        inside += list((low <= truth) & (truth <= high))
        (low,), (high,) = result.differences["from_K"], result.differences["to_K"]
        apart.append(low <= truth[0] - truth[1] <= high)
    assert 0.93 <= np.mean(inside) <= 0.97 and 0.93 <= np.mean(apart) <= 0.97
