"""Bolometers: scale, noise, lag, drift, shutter, and noise of rows and columns."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

import mi_lcair
from mi_lcair.detection.camera.bolometer import Bolometer, housing_changes, lagged
from mi_lcair.detection.camera.electronics import Pattern, counts, electron_band, frame, signal_of
from mi_lcair.detection.camera.image import Shot
from mi_lcair.detection.camera.sequence import FilmedFlight
from mi_lcair.detection.scenario import Scenario
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import BOLTZMANN, LIGHT_SPEED, PLANCK
from mi_lcair.physics.imager import Imager
from tests.detection.camera.plate_scenario import plate
from tests.detection.camera.test_sequence import flown

DESCRIPTION = Imager(
    focal_length_mm=20.0,
    f_number=1.2,
    pitch_um=12.0,
    width=64,
    height=48,
    detector="bolometer",
    netd_mK=50.0,
    netd_f_number=1.0,
    span_K=(233.15, 413.15),
    time_constant_ms=10.0,
)
LWIR = electron_band(band("LWIR"), DESCRIPTION)
BOLOMETER = Bolometer.of(DESCRIPTION, LWIR)
CAMERA = {
    "detector": "bolometer",
    "pitch_um": 12.0,
    "netd_mK": 50.0,
    "span_K": [233.15, 413.15],
    "bits": 16,
}


def described(folder, **camera) -> Scenario:
    """A small plate at 300 K before 300 K and a bolometer, with other entries of [camera]."""
    plate(folder, 0.1, 0.1)
    entries = {"focal_length_mm": 20.0, "f_number": 1.2, "width": 64, "height": 48} | CAMERA
    changes = {f"camera.{name}": value for name, value in (entries | camera).items()}
    changes |= {"sensor.band": "LWIR", "background.temperature": 300.0, "render.spp": 4}
    return Scenario.read(folder / "disc.toml", **changes, **{"target.parameters.temperature": 300})


def power(kelvin: float, f_number: float) -> float:
    """Power of a blackbody on a pixel, W: Planck's law between 8 and 12 um, integrated here."""

    def radiance(um):
        x = um * 1e-6
        exponent = PLANCK * LIGHT_SPEED / (x * BOLTZMANN * kelvin)
        return 1e-6 * 2 * PLANCK * LIGHT_SPEED**2 / x**5 / np.expm1(exponent)

    return quad(radiance, 8, 12)[0] * np.pi / (4 * f_number**2) * (12e-6) ** 2


def test_scale_and_noise_follow_from_powers():
    """The span's ends give the first and last count; the noise is a NETD at f/1 and 300 K."""
    levels = [power(kelvin, 1.2) for kelvin in (233.15, 413.15)]
    assert counts(BOLOMETER, np.array(levels)).tolist() == [0, 2**14 - 1]
    assert signal_of(BOLOMETER, 0.0) == pytest.approx(levels[0], rel=1e-4)
    slope = (power(300.05, 1.0) - power(299.95, 1.0)) / 0.1
    assert BOLOMETER.nep == pytest.approx(0.050 * slope * 1.0, rel=1e-4)
    slower = replace(DESCRIPTION, netd_f_number=1.4)
    assert Bolometer.of(slower, LWIR).nep == pytest.approx(0.050 * slope / 1.4**2, rel=1e-4)
    thin = replace(DESCRIPTION, lens="thin", netd_f_number=None)
    own = Bolometer.of(thin, electron_band(band("LWIR"), thin))
    scale = (4 * 1.2**2 / (4 * 1.2**2 + 1)) / 1.2**2
    assert own.nep == pytest.approx(0.050 * slope * scale, rel=1e-4)


def test_span_is_that_of_scenes_through_warm_optics(tmp_path):
    """Even scenes at its ends give the first and last count, beside what the optics emit."""
    scenario = described(tmp_path, optics_temperature=300.0)
    sensor = replace(scenario.sensor, optics_transmittance=0.6)
    camera = Shot.of(replace(scenario, sensor=sensor), 0).camera
    levels = [0.6 * power(kelvin, 1.2) + 0.4 * power(300, 1.2) for kelvin in (233.15, 413.15)]
    assert counts(camera.imager, np.array(levels)).tolist() == [0, 2**16 - 1]
    assert counts(camera.imager, levels[1] * 0.999) < 2**16 - 1


@pytest.mark.parametrize(
    "entries, message",
    [
        ({"span_K": (295.0, 400.0)}, "of 290 K, which gives .* less than .* widen span_K"),
        ({"span_K": (200.0, 305.0)}, "of 310 K, which gives .* saturates .* widen span_K"),
        ({"netd_mK": 5e3}, "e-10 W with a noise of .* lower netd_mK"),
    ],
)
def test_correction_needs_scenes_within_the_span(tmp_path, entries, message):
    with pytest.raises(InputError, match=message):
        Shot.of(described(tmp_path, nuc=True, **entries), 0)


def test_noise_of_frames():
    quiet = Pattern.of(BOLOMETER, 0)
    level = power(300, 1.2)
    recorded = np.array([frame(BOLOMETER, quiet, level, 1, k) for k in range(30)])
    assert recorded.std() == pytest.approx(BOLOMETER.nep, rel=5 / np.sqrt(2 * recorded.size))
    assert recorded.mean() == pytest.approx(level, abs=5 * BOLOMETER.nep / recorded.size**0.5)


def followed(times, signals, integration_ms=None, tau_ms=10.0):
    imager = replace(BOLOMETER, time_constant_ms=tau_ms, integration_time_ms=integration_ms)
    scenes = (np.full((1, 1), value) for value in signals)
    return np.array([seen[0, 0] for seen in lagged(imager, np.asarray(times), scenes)])


def test_step_response():
    """1 - exp(-t / tau) after a step, which takes a nanosecond."""
    times = np.array([0, 1e-9, 0.002, 0.010, 0.016, 0.05, 0.2])
    seen = followed(times, [0, 1, 1, 1, 1, 1, 1])
    assert seen[1:] == pytest.approx(1 - np.exp(-times[1:] / 0.01), abs=1e-6)
    at_once = followed(times, [0, 1, 1, 1, 1, 1, 1], tau_ms=0.0)
    assert at_once.tolist() == [0, 1, 1, 1, 1, 1, 1]


@pytest.mark.parametrize("integration_ms", [0.05, 5.0])
def test_step_response_with_integration(integration_ms):
    """The mean of 1 - exp(-t / tau) over the end of each interval."""
    times = np.array([0, 1e-9, 0.016, 0.033, 0.05])
    seen = followed(times, [0, 1, 1, 1, 1], integration_ms)
    window = 1e-3 * integration_ms
    for time, value in zip(times[2:], seen[2:]):
        mean = quad(lambda t: 1 - np.exp(-t / 0.01), time - window, time)[0] / window
        assert value == pytest.approx(mean, abs=1e-6)


def test_lag_solves_the_equation_of_a_pixel():
    """dx/dt = (scene - x) / tau, solved step by step, for a scene between uneven moments."""
    times, scene = np.array([0, 0.004, 0.02, 0.03, 0.07]), np.array([2.0, 5.0, 1.0, 1.5, 8.0])

    def change(time, x):
        return (np.interp(time, times, scene) - x) / 0.01

    solved = solve_ivp(change, (0, 0.07), [2.0], t_eval=times, max_step=1e-4, rtol=1e-9)
    assert followed(times, scene) == pytest.approx(solved.y[0], rel=1e-6)


def test_offset_after_a_shutter(tmp_path):
    """The offset is that of the housing's change since the last event, or since the first frame."""
    (tmp_path / "housing.csv").write_text("time_s,temperature_K\n0,300\n100,310\n")
    warm = replace(
        BOLOMETER, housing=str(tmp_path / "housing.csv"), drift_mK_K=30.0, shutter_s=(45.0, 20.0)
    )
    times = np.array([5.0, 15.0, 25.0, 35.0, 49.9, 50.0, 70.0, 105.0])  # first frame at 5 s
    changes = housing_changes(warm, times, 0)
    assert changes == pytest.approx([0, 1, 0, 1, 2.49, 0, 2, 5.5], abs=1e-9)
    every = replace(warm, shutter_s=None, shutter_every_s=40.0)
    expected = [0, 1, 2, 3, 0.49, 0.5, 2.5, 2.0]
    assert housing_changes(every, times, 0) == pytest.approx(expected, abs=1e-9)
    slope = (power(300.05, 1.0) - power(299.95, 1.0)) / 0.1
    pattern = Pattern.of(warm, 0, slope)
    plain = Pattern.of(warm, 0)
    moved = frame(warm, pattern, 1e-9, 1, warmer_K=2.0) - frame(warm, plain, 1e-9, 1)
    assert moved == pytest.approx(np.full((48, 64), 0.060 * slope), rel=1e-6)


def test_variance_of_the_walk():
    """K^2 t / tau, over 4000 walks: three standard errors of a variance are 6.7 %."""
    walking = replace(BOLOMETER, housing_walk_K=0.5, housing_walk_s=60.0, drift_mK_K=1.0)
    times = np.arange(0, 600, 20.0)
    walks = np.array([housing_changes(walking, times, seed) for seed in range(4000)])
    assert walks[:, [3, 29]].var(axis=0) == pytest.approx([0.25, 0.25 * 580 / 60], rel=0.05)
    steps = np.diff(walks, axis=1)
    assert abs(np.mean(steps[:, 1:] * steps[:, :-1])) < 4 * 0.25 / 3 / np.sqrt(steps[:, 1:].size)
    np.testing.assert_array_equal(housing_changes(walking, times[:9], 7), walks[7, :9])


def test_shutter_events_between_frames_and_at_them():
    """The walk since an event is K^2 t / tau also between frames; rounding misses no event."""
    walking = replace(
        BOLOMETER, housing_walk_K=1.0, housing_walk_s=60.0, drift_mK_K=1.0, shutter_s=(50.0,)
    )
    changes = [housing_changes(walking, np.array([0, 60.0, 120.0]), seed) for seed in range(4000)]
    assert np.var(changes, axis=0) == pytest.approx([0, 10 / 60, 70 / 60], rel=0.08)
    for seconds in (0.1, 1e-12):
        often = replace(walking, shutter_s=None, shutter_every_s=seconds)
        assert not housing_changes(often, np.arange(200) / 10, 0).any()


SIGMAS = {"sigma_vh_mK": 30.0, "sigma_v_mK": 15.0, "sigma_h_mK": 12.0, "sigma_tv_mK": 10.0}
SIGMAS |= {"sigma_th_mK": 8.0, "sigma_t_mK": 6.0}


def test_given_components_are_in_the_frames(tmp_path):
    """200 frames hold the stated components within 4 standard errors of each, and netd as tvh."""
    scenario = described(tmp_path, **SIGMAS)
    made = mi_lcair.image(scenario, frames=200, seed=3)
    frames, rows, columns = made.counts.shape
    count = {"t": frames - 1, "v": rows - 1, "h": columns - 1}
    for name, given in {"sigma_tvh_mK": 50.0, **SIGMAS}.items():
        letters = name.split("_")[1]
        relative = 1 / np.sqrt(2 * np.prod([count[letter] for letter in letters]))
        own = 1e3 * getattr(made.noise, f"sigma_{letters}")
        assert own == pytest.approx(given, rel=4 * relative + 0.02), name
    assert made.measures.netd == pytest.approx(0.050, rel=1e-3)
    assert made.measures.as_dict()["noise_W"] == pytest.approx(
        Bolometer.of(scenario.camera, made.band).nep * np.hypot(50, 39.4) / 50, rel=0.01
    )
    assert "power.Y" in made.channels and "power_W" in made.columns()
    assert mi_lcair.image(scenario, seed=3).noise is None


def test_frames_of_a_flight_lag(tmp_path):
    """A plate that warms within a second, and the response of a first-order detector to a ramp."""
    temperatures = ((0, 280), (1, 300), (2, 300), (5, 300))
    path = "".join(f"{time},-1000,0,90,0,0,0,{kelvin}\n" for time, kelvin in temperatures)
    entries = CAMERA | {"netd_mK": 1e-3, "time_constant_ms": 2000.0}
    changes = {f"camera.{name}": value for name, value in entries.items()}
    columns = "time_s,x_m,y_m,z_m,yaw_deg,pitch_deg,roll_deg,temperature.self"
    scenario = flown(tmp_path, path, columns, **changes, **{"sensor.band": "LWIR"})
    at_once = replace(scenario, camera=replace(scenario.camera, time_constant_ms=0.0))
    late, now = (
        np.array(list(FilmedFlight(each, 0).counts()), float)[:, 24, 32]
        for each in (scenario, at_once)
    )
    times, ramp = np.arange(1, 6), 2 * np.expm1(1 / 2)
    assert (late - now[0])[1:] / (now - now[0])[5] == pytest.approx(
        1 - ramp * np.exp(-times / 2), abs=1e-3
    )


def test_noise_in_kelvin_holds_what_is_new_in_each_frame(tmp_path):
    """Root of 50^2 + 40^2 mK in the middle, and divided by the illumination in the corner."""
    made = mi_lcair.image(described(tmp_path, sigma_t_mK=40.0, vignetting=0.5), seed=3)
    noise, light = made.channels["noise_K.Y"], made.scenario.camera.illumination
    assert noise[24, 32] * light[24, 32] == pytest.approx(np.hypot(0.050, 0.040), rel=0.01)
    assert noise[0, 0] / noise[24, 32] == pytest.approx(light[24, 32] / light[0, 0], rel=0.01)


def test_noise_that_pixels_share_weakens_a_matched_filter(tmp_path):
    """The filter's output in 4000 drawn frames; the table over range has the image's ratio."""
    sigmas = {"sigma_tv_mK": 40.0, "sigma_th_mK": 30.0, "sigma_t_mK": 20.0}
    scenario = described(tmp_path, **sigmas, focal_length_mm=100.0)
    scenario = replace(scenario, background=replace(scenario.background, temperature=290.0))
    made = mi_lcair.image(scenario, seed=2)
    contrast = made.channels["power.Y"] - made.channels["power.background.Y"].astype(float)
    random, unit = np.random.default_rng(9), Bolometer.of(scenario.camera, made.band).nep / 50
    outputs = []
    for _ in range(4000):
        rows, columns = random.standard_normal(48), random.standard_normal(64)
        pixels = np.linalg.norm(contrast) * random.standard_normal()  # their sum, weighted
        output = 40 * rows @ contrast.sum(axis=1) + 30 * columns @ contrast.sum(axis=0)
        outputs.append(50 * pixels + output + 20 * random.standard_normal() * contrast.sum())
    expected = np.sum(contrast**2) / (unit * np.std(outputs))
    assert made.measures.snr == pytest.approx(expected, rel=0.04)
    own = next(row for row in made.ranges if row.range_m == scenario.observer.range_m)
    assert own.snr == pytest.approx(made.measures.snr, rel=2e-3)
    assert own.peak_snr == pytest.approx(made.measures.peak_snr, rel=2e-3)


@pytest.mark.parametrize(
    "entries, message",
    [
        ({"read_noise_e": 100.0}, "detector and read_noise_e cannot be combined"),
        ({"netd_mK": None}, "detector needs netd_mK and span_K"),
        ({"detector": "photon"}, "integration_time_ms is missing"),
        ({"span_K": (300.0, 200.0)}, "lower temperature first"),
        ({"drift_mK_K": 3.0}, "drift_mK_K needs housing or housing_walk_K"),
        ({"housing_walk_K": 3.0}, "housing_walk_s is missing"),
        ({"shutter_s": (3.0,), "shutter_every_s": 5.0}, "shutter_s and shutter_every_s"),
        ({"time_constant_ms": -1.0}, "time_constant_ms = -1; must lie in"),
    ],
)
def test_descriptions_that_contradict_themselves(entries, message):
    with pytest.raises(InputError, match=message):
        replace(DESCRIPTION, **entries)


def test_housings_that_cannot_be_used(tmp_path):
    file = tmp_path / "housing.csv"
    imager = replace(BOLOMETER, housing=str(file), drift_mK_K=1.0)
    for rows, message in (
        ("0,300\n5,301\n", "has the housing from 0 to 5 s; the frames last from 0 to 9 s"),
        ("0.5,300\n20,301\n", "has the housing from 0.5 to 20 s"),
        ("0,300\n0,301\n", "time_s must rise"),
        ("0,30\n10,30\n", "temperature_K = 30 K"),
    ):
        file.write_text(f"time_s,temperature_K\n{rows}")
        with pytest.raises(InputError, match=message):
            housing_changes(imager, np.array([0.0, 9.0]), 0)


def test_drift_needs_times(tmp_path):
    scenario = described(tmp_path, housing_walk_K=1.0, housing_walk_s=1.0, drift_mK_K=5.0)
    with pytest.raises(InputError, match="frame_rate_hz is missing"):
        mi_lcair.image(scenario, frames=2)


def test_a_preset_gives_what_is_not_given(tmp_path):
    named = described(tmp_path)
    preset = {"camera.preset": "microbolometer_12um", "camera.width": 64}
    own = Scenario.read(tmp_path / "disc.toml", **preset).camera
    assert (own.width, own.height, own.netd_mK, own.shutter_every_s) == (64, 512, 40, 180)
    own = Scenario.read(tmp_path / "disc.toml", **preset, **{"camera.shutter_s": [3.0]}).camera
    assert own.shutter_every_s is None and own.shutter_s == (3.0,) and named.camera.preset is None
    with pytest.raises(InputError, match="unknown preset of .camera. 'insb'.* insb_mwir"):
        Scenario.read(tmp_path / "disc.toml", **{"camera.preset": "insb"})


def test_a_table_of_the_housing_replaces_a_walk(tmp_path):
    (tmp_path / "housing.csv").write_text("time_s,temperature_K\n0,300\n9,301\n")
    walk = {"housing_walk_K": 1.0, "housing_walk_s": 1.0}
    camera = described(tmp_path, **walk, housing=str(tmp_path / "housing.csv")).camera
    assert (camera.housing_walk_K, camera.housing_walk_s) == (None, None)


def test_assumptions_of_a_preset_are_named(tmp_path):
    described(tmp_path)
    changes = {"preset": "insb_mwir", "width": 32, "height": 32, "well_Me": 8.0}
    changes = {f"camera.{name}": value for name, value in changes.items()}
    scenario = Scenario.read(tmp_path / "disc.toml", **changes, **{"render.spp": 4})
    made = mi_lcair.image(scenario, parameters=None)
    assert any("assumes focal_length_mm = 50 and read_noise_e = 500" in x for x in made.remarks)
