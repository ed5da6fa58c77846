"""Contrasts of scenarios against closed forms and against renders."""

import mitsuba as mi
import numpy as np
import pytest
from click.testing import CliRunner

import mi_lcair
from mi_lcair.cli import main
from mi_lcair.detection.scenario import Scenario
from mi_lcair.errors import InputError
from mi_lcair.estimate import with_error
from mi_lcair.knowing.budgets.budget import result_of
from mi_lcair.physics.blackbody import brightness_temperature, in_band_radiance, spectral_radiance
from mi_lcair.rendering.parameters.values import set_values
from mi_lcair.rendering.sampling import Sampling
from tests.detection.disc_scenario import AREA, disc, triangles, write_disc
from tests.detection.disc_scenario import AREA as DISC_AREA
from tests.knowing.budgets.plate_scene import TEMPERATURE, plate_scene, row, slope, triangle_areas

# Apparent temperature, detection range, signal-to-noise ratio and NETD in closed form
# ------------------------------------------------------------------------------------

mi.set_variant("llvm_ad_mono")

T, COLD, RANGE = 400.0, 294.0, 1000.0  # disc and background [K], and range of the scenario [m]
NEI = 1e-8
CAMERA = {
    "focal_length_mm": 100.0, "f_number": 4.0, "pitch_um": 15.0, "width": 48, "height": 40,
    "integration_time_ms": 0.15, "well_Me": 4.98, "quantum_efficiency": 0.75,
    "read_noise_e": 500.0, "dark_current_e_s": 2e8,
}  # fmt: skip
TABLE = {f"camera__{name}": value for name, value in CAMERA.items()}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("disc")
    write_disc(path)
    return path


def blackbody_disc(folder, **changes):
    few = {"render__resolution": 16, "render__spp": 256, "sensor__nei": NEI}
    return disc(folder, **few | changes)


def contributions(scenario, of, **stated):
    """Budget of a result, and what each quantity contributes to it."""
    budget = mi_lcair.budget(scenario, {"sigma": stated}, of=of)
    return budget, {name: row(budget, name).contribution for name in stated}


def planck(scenario):
    """In-band radiance of disc and background, and the slope of the disc's."""
    band = scenario.sensor.detector().band
    return *(float(in_band_radiance(band, kelvin)) for kelvin in (T, COLD)), slope(band, T)


def test_apparent_temperature(folder):
    """That of a blackbody in vacuum is its own; 1 % less light is B / (100 dB/dT) less."""
    scenario = blackbody_disc(folder)
    stated = {"self.temperature": 2.0, "scenario.transmittance": "1 %", "scenario.range_m": 10.0}
    found, parts = contributions(scenario, "apparent_temperature", **stated)
    hot, _, per_kelvin = planck(scenario)
    assert found.value == pytest.approx(T, abs=1e-3) and found.unit == "K"
    assert parts["self.temperature"] == pytest.approx(2, rel=1e-4)
    assert parts["scenario.transmittance"] == pytest.approx(0.01 * hot / per_kelvin, rel=1e-3)
    assert parts["scenario.range_m"] == pytest.approx(0, abs=1e-6)
    # All paths that meet the disc see the same radiance
    assert row(found, "noise of the rendering").contribution < 2e-3
    assert "apparent temperature 400 +- " in found.summary()


def test_apparent_temperature_of_two(tmp_path):
    """Half of the triangles are hotter: the mean radiance counts, by area, and has no noise."""
    areas = triangle_areas()
    is_hot = np.arange(len(areas)) % 2 == 0
    for hotter, noise in ((T + 60, 0.2), (T + 0.5, 2e-3)):
        write_disc(tmp_path, np.where(is_hot, hotter, T))
        scenario = blackbody_disc(tmp_path)
        name = f"self@{T:g}.temperature"
        found, parts = contributions(scenario, "apparent_temperature", **{name: 1.0})
        band, share = scenario.sensor.detector().band, areas[is_hot].sum() / areas.sum()
        hot, cold = (float(in_band_radiance(band, kelvin)) for kelvin in (hotter, T))
        mean = share * hot + (1 - share) * cold
        expected = float(brightness_temperature(band, mean))
        assert found.value == pytest.approx(expected, abs=3 * noise)
        assert row(found, "noise of the rendering").contribution < noise
        of_cold = (1 - share) * slope(band, T) / slope(band, expected)
        assert parts[name] == pytest.approx(of_cold, rel=0.01)


def test_facets_with_errors_of_their_own(folder):
    """The mean of n even triangles with independent errors: sigma sqrt(sum a^2) / sum a."""
    found = mi_lcair.budget(
        blackbody_disc(folder), {"facets": {"self": 3.0}}, of="apparent_temperature"
    )
    areas = triangle_areas()
    expected = 3 * np.sqrt(np.sum(areas**2)) / areas.sum()
    assert row(found, "self facets").contribution == pytest.approx(expected, rel=0.05)


def test_tolerance_in_irradiance(folder):
    """An absolute tolerance is one of the contrast, also where electrons are counted."""
    noisy = {"render__spp": None, "render__tolerance_W_m2": 1e-5, "render__max_spp": 4096}
    found = mi_lcair.budget(
        blackbody_disc(folder, **TABLE | noisy), {"sigma": {"self.temperature": 1.0}}, of="snr"
    )
    assert found.paths < 4096 * 16 * 16 and not found.remarks


@pytest.mark.parametrize("at_optics", [1.0, 0.8])
def test_detection_range(folder, at_optics):
    """R = sqrt(tau A (B(T) - B(T_0)) / (snr nei)) in vacuum."""
    scenario = blackbody_disc(folder, sensor__optics_transmittance=at_optics, sensor__snr=5.0)
    stated = {"sensor.nei": "6 %", "sensor.snr": 0.1, "self.temperature": 1.0}
    stated |= {"scenario.background_temperature": 1.5, "sensor.optics_transmittance": 0.01}
    found, parts = contributions(scenario, "detection_range", **stated)
    hot, cold, per_kelvin = planck(scenario)
    range_m = np.sqrt(at_optics * AREA * (hot - cold) / (5 * NEI))
    assert found.value == pytest.approx(range_m, rel=2e-3) and found.unit == "m"
    expected = {
        "sensor.nei": -0.03,
        "sensor.snr": -0.5 * 0.1 / 5,
        "self.temperature": 0.5 * per_kelvin / (hot - cold),
        "scenario.background_temperature": -0.75 * slope(scenario.sensor.detector().band, COLD)
        / (hot - cold),
        "sensor.optics_transmittance": 0.005 / at_optics,
    }  # fmt: skip
    for name, relative in expected.items():
        assert parts[name] == pytest.approx(found.value * relative, rel=3e-3), name
    noise = row(found, "noise of the rendering").contribution
    of_contrast = mi_lcair.budget(scenario, {"sigma": {"self.temperature": 1.0}})
    relative = row(of_contrast, "noise of the rendering").contribution / of_contrast.value
    assert noise == pytest.approx(found.value * relative / 2, rel=2e-3)


def test_a_range_through_air_grows_with_the_transmittance(folder):
    """A factor f of the transmittance t at R is f^(ln t(r) / ln t(R)) at r."""
    scenario = blackbody_disc(folder, atmosphere__table="us_standard")
    found, parts = contributions(scenario, "detection_range", **{"scenario.transmittance": 1e-5})
    contrast = mi_lcair.contrast(scenario)
    detection = contrast.detection_ranges()[-1]
    assert found.value == pytest.approx(detection.largest_m, rel=1e-6)
    steps = found.value * np.array([0.999, 1.001])
    irradiance = contrast.rows[-1].irradiance
    low, high = (irradiance.at(contrast.air.path(r)) for r in steps)
    band, tau = scenario.sensor.detector().band, contrast.transmittance
    there = contrast.air.transmittance_mean(band, found.value)
    d_target = low["target"].value * np.log(there) / np.log(tau)
    d_range = (high["total"].value - low["total"].value) / (steps[1] - steps[0])
    assert parts["scenario.transmittance"] == pytest.approx(
        -1e-5 / tau * d_target / d_range, rel=0.01
    )


def test_signal_to_noise_of_a_sensor(folder):
    """tau |E| / nei, whose relative uncertainties are those of its factors."""
    scenario = blackbody_disc(folder, sensor__optics_transmittance=0.9)
    stated = {"sensor.nei": "5 %", "sensor.optics_transmittance": 0.02, "scenario.range_m": 10.0}
    found, parts = contributions(scenario, "snr", **stated)
    contrast = mi_lcair.budget(scenario, {"sigma": {"self.temperature": 1.0}})
    assert found.value == pytest.approx(0.9 * contrast.value / NEI, rel=1e-6)
    relative = {"sensor.nei": -0.05, "sensor.optics_transmittance": 0.02 / 0.9}
    for name, expected in (relative | {"scenario.range_m": -0.02}).items():
        assert parts[name] == pytest.approx(found.value * expected, rel=1e-3), name
    assert f"ratio {with_error(found.value, found.sigma)} (one standard" in found.summary()


@pytest.mark.parametrize("of", ["snr", "detection_range"])
def test_a_contrast_of_uncertain_sign(folder, of):
    """A disc 2 +- 2 K above a background of 294 +- 1.5 K, against 100,000 draws of closed forms."""
    scenario = blackbody_disc(folder, sensor__nei=1e-9, target__parameters={"temperature": 296.0})
    stated = {"self.temperature": 2.0, "scenario.background_temperature": 1.5}
    found, _ = contributions(scenario, of, **stated)
    band, rng = scenario.sensor.detector().band, np.random.default_rng(0)
    disc_B, behind_B = (
        np.interp(rng.normal(kelvin, sigma, 100_000), x, in_band_radiance(band, x))
        for kelvin, sigma, x in ((296, 2, np.arange(280, 310.0)), (294, 1.5, np.arange(280, 310.0)))
    )
    drawn = AREA * np.abs(disc_B - behind_B) / (1e-9 * RANGE**2)  # signal-to-noise ratio
    if of == "detection_range":
        drawn = RANGE * np.sqrt(drawn / scenario.sensor.detector().snr)
    curved = found.second_order
    assert curved.sigma == pytest.approx(drawn.std(), rel=0.03)
    assert curved.interval == pytest.approx(np.quantile(drawn, (0.025, 0.975)), rel=0.03, abs=30)
    assert found.value + curved.shift == pytest.approx(drawn.mean(), rel=0.02)
    assert curved.interval[0] > 0 and curved.other_sign == pytest.approx(0.21, abs=0.01)
    assert any("other sign with a probability of 21 %" in remark for remark in found.remarks)


def test_a_range_in_air_follows_from_the_signals_at_many_ranges(folder):
    """Also where the contrast has the other sign, and where nothing is detected: at 0 m."""
    scenario = blackbody_disc(
        folder, atmosphere__table="us_standard", target__parameters={"temperature": 299.0}
    )
    with result_of(scenario, Sampling(), of="detection_range") as number:
        number.start()
        name, ranges = "scenario.background_temperature", []
        for kelvin in (294.0, 296.5, 291.0, 299.4):
            there = number.linear_at({name: kelvin})
            ranges.append(there.value)
            (of_signals,) = number.results(there.smooth[None])
            assert of_signals == pytest.approx(there.value, rel=0.01)
        silent = number.linear_at({"sensor.nei": 1.0})
        assert silent.value == 0 == number.results(silent.smooth[None])[0]
        (slope, _), h = number.closed_derivative("sensor.nei", 1e-9), 1e-10
        ends = [number.at({"sensor.nei": NEI + step}) for step in (-h, h)]
        assert slope == pytest.approx((ends[1] - ends[0]) / (2 * h), rel=1e-3)
    assert len(set(ranges)) == 4 and ranges[0] == pytest.approx(number.value)


def electrons(scenario, kelvin):
    """Electrons of a blackbody that fills a pixel, integrated over photons."""
    band = scenario.sensor.detector().band
    x = np.linspace(band.lower_um, band.upper_um, 20_001)
    h, c, k = 6.62607015e-34, 299792458.0, 1.380649e-23
    photons = 2e18 * c / x**4 / np.expm1(1e6 * h * c / (x * k * kelvin))  # per s m^2 sr um
    pupil = np.pi / (4 * CAMERA["f_number"] ** 2)
    area, seconds = (15e-6) ** 2, 0.15e-3
    return np.trapezoid(photons, x) * CAMERA["quantum_efficiency"] * pupil * area * seconds


def test_netd(folder):
    """sqrt(S + dark + read^2 + count^2 / 12) / (dS/dT), from the photons of a blackbody."""
    scenario = blackbody_disc(folder, **TABLE)
    stated = {"camera.read_noise_e": "10 %", "camera.quantum_efficiency": 0.02}
    stated |= {"camera.f_number": 0.05, "camera.dark_current_e_s": "20 %", "camera.pitch_um": 0.1}
    found, parts = contributions(scenario, "netd", **stated)
    signal, dark = electrons(scenario, COLD), 2e8 * 0.15e-3
    slope_e = (electrons(scenario, COLD + 0.01) - electrons(scenario, COLD - 0.01)) / 0.02
    count = 4.98e6 / (2**14 - 1) / (1 - 1 / 64)
    noise = np.sqrt(signal + dark + 500.0**2 + count**2 / 12)
    assert found.value == pytest.approx(noise / slope_e, rel=1e-3) and found.unit == "K"
    of_signal = 1 - signal / (2 * noise**2)  # relative change of the NETD for -1 of the signal
    relative = {
        "camera.read_noise_e": 0.1 * 500.0**2 / noise**2,
        "camera.quantum_efficiency": -0.02 / 0.75 * of_signal,
        "camera.f_number": 2 * 0.05 / 4 * of_signal,
        "camera.dark_current_e_s": 0.2 * dark / (2 * noise**2),
        "camera.pitch_um": -2 * 0.1 / 15 * of_signal,
    }
    for name, expected in relative.items():
        assert parts[name] == pytest.approx(found.value * expected, rel=3e-3), name


def test_signal_to_noise_of_a_camera(folder):
    """It is that of the range table of `image`; its noise is that of a pixel of the background."""
    scenario = blackbody_disc(folder, **TABLE)
    stated = {"camera.read_noise_e": "10 %", "self.temperature": 1.0}
    found, parts = contributions(scenario, "snr", **stated)
    ranges = mi_lcair.image(scenario).ranges
    (of_image,) = (entry.snr for entry in ranges if entry.range_m == RANGE)
    assert found.value == pytest.approx(of_image, rel=5e-3)
    count = 4.98e6 / (2**14 - 1) / (1 - 1 / 64)
    variance = electrons(scenario, COLD) + 2e8 * 0.15e-3 + 500.0**2 + count**2 / 12
    relative = -0.1 * 500.0**2 / variance
    assert parts["camera.read_noise_e"] == pytest.approx(found.value * relative, rel=2e-3)
    hot, hotter, cold = (electrons(scenario, kelvin) for kelvin in (T, T + 0.1, COLD))
    relative = (hotter - hot) / 0.1 / (hot - cold)
    assert parts["self.temperature"] == pytest.approx(found.value * relative, rel=3e-3)


def test_what_cannot_be_used(folder, tmp_path):
    sigma = {"sigma": {"self.temperature": 1.0}}
    bare = disc(folder, render__resolution=8)
    for scenario, of, message in (
        (bare, "netd", r"NETD: needs a table \[camera\]"),
        (bare, "snr", r"needs a table \[camera\], or nei of \[sensor\]"),
        (bare, "detection_range", "needs nei"),
        (bare, "range", "unknown result of a budget 'range'"),
        (plate_scene(tmp_path), "snr", "snr is a result of a scenario"),
        (blackbody_disc(folder, sensor__nei=1e4), "detection_range", "detected at no range"),
    ):
        with pytest.raises(InputError, match=message):
            mi_lcair.budget(scenario, sigma, of=of)
    for name in ("camera.f_number", "scenario.nei"):
        with pytest.raises(InputError, match=f"unknown quantity of .* '{name}'"):
            mi_lcair.budget(blackbody_disc(folder), {"sigma": {name: 1e-9}}, of="snr")


def test_command(folder, monkeypatch):
    monkeypatch.chdir(folder)
    (folder / "sigma.toml").write_text('[sigma]\n"self.temperature" = 2\n')
    arguments = ["budget", "disc.toml", "-u", "sigma.toml", "--of", "apparent_temperature"]
    result = CliRunner().invoke(main, [*arguments, "-D", "render.resolution=8", "--spp", "16"])
    assert result.exit_code == 0 and "apparent temperature  400 +- 2 K" in result.stdout


mi.set_variant("llvm_ad_mono")


def test_contrast_in_closed_form(tmp_path):
    """A blackbody disc in vacuum: contrast = A (B(T) - B(T_0)) / R^2."""
    write_disc(tmp_path)
    scenario = disc(tmp_path, render__resolution=32, render__spp=256)
    stated = {
        "sigma": {"self.temperature": 1.0},
        "scenario": {
            "background_temperature": 2.0,
            "range_m": 10,
            "transmittance": 0.02,
            "nei": 1e-9,
        },
    }
    found = mi_lcair.budget(scenario, stated)
    band = scenario.sensor.detector().band
    B = lambda T: float(in_band_radiance(band, T))
    scale, expected = DISC_AREA / 1000**2, found.value
    assert found.unit == "W m^-2"
    assert expected == pytest.approx(scale * (B(400) - B(294)), rel=3e-3)
    contributions = {
        "self.temperature": scale * slope(band, 400),
        "scenario.background_temperature": -2 * scale * slope(band, 294),
        "scenario.range_m": -2 * expected / 1000 * 10,
        "scenario.transmittance": 0.02 * scale * B(400),
        "scenario.nei": 1e-9,
    }
    for name, contribution in contributions.items():
        assert row(found, name).contribution == pytest.approx(contribution, rel=4e-3), name
    assert sum(row.share for row in found.rows) == pytest.approx(1)


@pytest.mark.parametrize("air", ["vacuum", "us_standard"])
def test_transmittance_by_wavelength(tmp_path, air):
    """An interval of wavelengths changes its own part of the irradiance, and all add up.

    In vacuum the part is A L(T) / R^2, by Planck's law over the interval.
    """
    write_disc(tmp_path)
    given = {"render__resolution": 16, "render__spp": 64, "atmosphere__table": air}
    scenario = disc(tmp_path, **given)
    ends = [3.0, 3.7, 4.15, 5.0]
    names = [f"transmittance@{a}-{b}" for a, b in zip(ends, ends[1:])]
    of_all = dict.fromkeys([*names, "transmittance"], "2 %")
    found = mi_lcair.budget(scenario, {"scenario": of_all})
    parts = [row(found, f"scenario.{name}").contribution for name in of_all]
    assert sum(parts[:-1]) == pytest.approx(parts[-1], rel=1e-3)
    if air == "vacuum":
        for a, b, part in zip(ends, ends[1:], parts):
            x = np.linspace(a, b, 2001)
            radiance = np.trapezoid(spectral_radiance(x, 400.0), x)
            assert part == pytest.approx(0.02 * DISC_AREA * radiance / 1e6, rel=4e-3)
    with pytest.raises(InputError, match="must name two rising wavelengths within 3-5 um"):
        mi_lcair.budget(scenario, {"scenario": {"transmittance@4-6": 0.1}})


@pytest.mark.slow
def test_contrast_by_sources_and_by_renders():
    """The derivative from weights of the sources is that of contrasts that are rendered anew.

    The value is that of `mi_lcair.contrast` within the errors: its randomisations are independent,
    and the other's are blocks of one lattice. Differences of renders with these steps scatter by
    10 % from seed to seed, because the choice of lobes changes with the parameters.
    """
    scenario = Scenario.read(
        "a340_landing/position_3",
        **{"render.resolution": 32, "render.spp": 256, "render.max_bounces": "[1, 2]"},
    )
    with result_of(scenario, {}) as number:
        number.start()
        total = mi_lcair.contrast(scenario).rows[-1].total
        assert number.value == pytest.approx(total.value, abs=4 * total.standard_error)
        for name, step in (("bare_aluminum.epsilon", 0.08), ("bare_aluminum.b", 0.04)):
            (found,), (error,) = number.derivatives([name], [step])
            ends = [number.at({name: number.known[name].value + s}) for s in (step, -step)]
            tolerance = 4 * error + 0.2 * abs(found)
            assert found == pytest.approx((ends[0] - ends[1]) / (2 * step), abs=tolerance)
        # Temperatures and radiances by sources, and with everything rendered
        for name, step in (("terrain.temperature", 3.0), ("sky.radiance", 0.1)):
            value = number.known[name].value + step
            total = number.numbers.render({name: value})
            rendered = number.linear(total, number.areas_of(total), {}).value
            assert number.at({name: value}) - number.value == pytest.approx(
                rendered - number.value, rel=1e-3
            )


@pytest.mark.slow
def test_a_contrast_with_too_many_temperatures(tmp_path):
    """The derivative then comes from differences, and its error is not known."""
    temperatures = np.linspace(395, 405, len(triangles()))
    write_disc(tmp_path, temperatures)
    scenario = disc(tmp_path, render__resolution=32)
    found = mi_lcair.budget(scenario, {"sigma": {"self.temperature": 1.0}})
    slopes = [slope(scenario.sensor.detector().band, T) for T in temperatures]
    expected = DISC_AREA * np.average(slopes, weights=triangle_areas()) / 1000**2
    found_row = row(found, "self.temperature")
    assert found_row.contribution == pytest.approx(expected, rel=0.01)
    assert np.isnan(found_row.sensitivity_error)
    assert found.as_dict()["estimate"]["contributions"][0]["sensitivity_error"] is None


def test_weather_of_a_contrast(tmp_path):
    """The contribution of weather is the difference of contrasts in two weathers.

    The disc reflects more than half of the sun and of the sky, whose light crosses the same air.
    """
    write_disc(tmp_path)
    text = (tmp_path / "disc.xml").read_text().replace('"blackbody"', '"0.4"')
    (tmp_path / "disc.xml").write_text(text)
    given = {
        "render__resolution": 16,
        "render__spp": 256,
        "observer__range_m": 5000,
        "observer__elevation_deg": 20,
        "target__height_m": 1500,
        "target__parameters__temperature": 290,
        "atmosphere__table": "us_standard",
        "surroundings__sky": "clear",
        "surroundings__ground": "290,0.8",
        "surroundings__sun": "30,10",
    }
    found = mi_lcair.budget(disc(tmp_path, **given), {"scenario": {"air_humidity": 0.02}})
    high, low = (
        mi_lcair.contrast(disc(tmp_path, **given, atmosphere__humidity=0.4584 + end))
        for end in (0.02, -0.02)
    )
    difference = (high.rows[0].total.value - low.rows[0].total.value) / 2
    assert abs(difference) > 4e-3 * abs(found.value)
    assert row(found, "scenario.air_humidity").contribution == pytest.approx(difference, rel=0.03)
    with pytest.raises(InputError, match="unknown quantity.*scenario.co2"):
        mi_lcair.budget(disc(tmp_path), {"scenario": {"co2": 10.0}})


@pytest.mark.slow
@pytest.mark.parametrize("sky, elevation", [("clear", -10), ("260", 10)])
def test_surroundings_are_behind_the_target_too(tmp_path, sky, elevation):
    """Contributions are differences of contrasts of scenarios with other surroundings."""
    write_disc(tmp_path)
    text = (tmp_path / "disc.xml").read_text().replace('"blackbody"', '"0.6"')
    (tmp_path / "disc.xml").write_text(text)

    def scenario(sky=sky, kelvin=290.0, emissivity=0.8):
        words = {"surroundings__sky": sky, "surroundings__ground": f"{kelvin},{emissivity}"}
        place = {"observer__elevation_deg": elevation, "target__height_m": 400}
        return disc(tmp_path, **words, **place, render__resolution=32, render__spp=64)

    sigma = {"ground.temperature": 1.0, "ground.emissivity": 0.02}
    if sky != "clear":
        sigma["sky.temperature"] = 1.0
    found = mi_lcair.budget(scenario(), {"sigma": sigma})
    other = {
        "ground.temperature": ({"kelvin": 291.0}, {"kelvin": 289.0}),
        "ground.emissivity": ({"emissivity": 0.82}, {"emissivity": 0.78}),
        "sky.temperature": ({"sky": "261"}, {"sky": "259"}),
    }
    for name in sigma:
        high, low = (mi_lcair.contrast(scenario(**k)).rows[-1].total.value for k in other[name])
        tolerance = 0.02 * abs(high - low) / 2 + 1e-9
        assert row(found, name).contribution == pytest.approx((high - low) / 2, abs=tolerance), name
    if sky == "clear" and elevation < 0:  # black would be the contrast without any sky behind
        contribution = mi_lcair.budget(scenario(), {"sigma": {"sky.scale": 0.05}}).rows[0]
        assert contribution.contribution < 0


# Intensities whose sources cannot be told apart
# ----------------------------------------------

mi.set_variant("llvm_ad_mono")


def test_a_scene_whose_sources_have_no_spectra(tmp_path):
    """In the band `total` everything is rendered: dI/dT = 4 I / T."""
    found = mi_lcair.budget(
        plate_scene(tmp_path, band="total"), {"sigma": {"plate.temperature": 3}}
    )
    contribution = row(found, "plate.temperature").contribution
    assert contribution == pytest.approx(4 * found.value / TEMPERATURE * 3, rel=1e-3)
    (check,) = found.checks
    assert check.holds and check.plus == pytest.approx(contribution, rel=0.05)


SKIES = {
    "night": {"sky": "clear", "ground_temperature": 290.0, "ground_emissivity": 0.8},
    "high": {"sky": "clear", "ground_temperature": 290.0, "height_m": 2000.0},
    "even": {"sky": "260", "ground_temperature": 290.0, "ground_emissivity": 0.8},
}


@pytest.mark.slow
@pytest.mark.parametrize("words", SKIES.values(), ids=SKIES)
def test_sky_and_ground_in_a_budget(words):
    """Contributions are differences of intensities at other values, from the same paths."""
    grey = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.5}}
    emitter = {"type": "thermal", "band": "MWIR", "temperature": 250.0, "group": "plate"}
    up = mi.ScalarTransform4f().rotate([0, 1, 0], 90)
    plate = {"type": "rectangle", "to_world": up, "bsdf": grey, "emitter": emitter}
    look = mi.ScalarTransform4f().look_at(origin=[20, 0, 0], target=[0, 0, 0], up=[0, 0, 1])
    film = {"type": "hdrfilm", "width": 8, "height": 8, "pixel_format": "luminance"}
    parts = {
        "type": "scene",
        "integrator": {"type": "bounce_path", "max_bounces": 1, "emitter_sampling": True},
        "sensor": {"type": "orthographic", "to_world": look, "film": film},
        "plate": plate,
        "sky": {"type": "sky", "band": "MWIR", **words},
    }
    scene = mi_lcair.load(mi.load_dict(parts, optimize=False))
    sigma = {"ground.temperature": 2.0, "ground.emissivity": 0.02}
    sigma |= {"sky.temperature": 2.0} if words["sky"] == "260" else {"sky.scale": 0.05}
    found = mi_lcair.budget(scene, {"sigma": sigma}, spp=1024, seed=3)
    for name, step in sigma.items():
        value, results = mi_lcair.parameters(scene)[name].value, []
        ends = (value - step, value + step if name != "ground.emissivity" else value)
        for end in ends:
            set_values(scene, {name: end})
            results.append(mi_lcair.signature(scene, spp=1024, seed=3).target.intensity)
        set_values(scene, {name: value})
        slope = (results[1] - results[0]) / (ends[1] - ends[0])
        assert row(found, name).contribution == pytest.approx(slope * step, rel=0.02)
