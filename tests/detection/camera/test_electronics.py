"""Frames: seeds, photon transfer, noise, saturation, counts."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from mi_lcair.detection.camera.electronics import (
    Pattern,
    apparent_temperature,
    counts,
    electron_band,
    electrons,
    electrons_per_kelvin,
    frame,
    in_kelvin,
    saturated,
    signal_of,
)
from mi_lcair.detection.camera.measures import measured_netd, netd, shot_noise_netd, uniform_frames
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import BOLTZMANN, LIGHT_SPEED, PLANCK
from mi_lcair.physics.imager import Imager

IMAGER = Imager(
    focal_length_mm=100.0,
    f_number=4.0,
    pitch_um=15.0,
    width=80,
    height=60,
    integration_time_ms=10.0,
    well_Me=4.98,
    quantum_efficiency=0.75,
    read_noise_e=1000.0,
    gain_nonuniformity=0.02,
    offset_nonuniformity_e=5000.0,
)
MANY = 10**8  # averaged frames, whose noise is below an electron


def test_seed_and_number_make_the_frame():
    """The numbers below were printed by the first version; a seed keeps its frames."""
    pattern = Pattern.of(IMAGER, 7)
    assert pattern.gain[0, :2] == pytest.approx([0.9877976696219604, 1.0149712349220776], rel=1e-12)
    assert pattern.offset[0, 0] == pytest.approx(9759.298898668736, rel=1e-12)

    def recorded(seed, number):
        return frame(IMAGER, pattern, 1e6, seed, number)

    assert np.array_equal(recorded(7, 3), recorded(7, 3))
    assert not np.array_equal(recorded(7, 3), recorded(7, 4))
    assert not np.array_equal(recorded(7, 3), recorded(8, 3))
    assert np.array_equal(Pattern.of(IMAGER, 7).gain, pattern.gain)
    assert np.array_equal(frame(IMAGER, pattern, 1e6, 7), recorded(7, 0))
    assert recorded(7, 3)[0, 0] == pytest.approx(997180.4107912102, rel=1e-12)


def test_fixed_pattern():
    """Standard deviations as stated, gains around 1 and not negative, offsets around 0."""
    imager = replace(IMAGER, width=400, height=300)
    pattern = Pattern.of(imager, 3)
    count = pattern.gain.size
    assert pattern.gain.shape == pattern.offset.shape == (300, 400)
    assert pattern.gain.std() == pytest.approx(0.02, rel=5 / np.sqrt(2 * count))
    assert pattern.gain.mean() == pytest.approx(1, abs=5 * 0.02 / np.sqrt(count))
    assert pattern.offset.std() == pytest.approx(5000, rel=5 / np.sqrt(2 * count))
    assert abs(pattern.offset.mean()) < 5 * 5000 / np.sqrt(count)
    assert abs(np.corrcoef(pattern.gain.ravel(), pattern.offset.ravel())[0, 1]) < 0.02
    wild = Pattern.of(replace(imager, gain_nonuniformity=2.0), 3)
    assert wild.gain.min() == 0 and np.mean(wild.gain == 0) == pytest.approx(0.3085, abs=0.01)


def test_mean_of_a_pixel():
    """(signal x gain + dark current, at most the well) + offset, without noise."""
    camera = replace(IMAGER, dark_current_e_s=3e7, width=3, height=1)  # 3e5 electrons
    pattern = Pattern(np.array([[0.5, 1.0, 2.0]]), np.array([[1e4, -2e4, 5e3]]))
    for signal, expected in (
        (1e6, (5e5 + 3e5 + 1e4, 1e6 + 3e5 - 2e4, 2e6 + 3e5 + 5e3)),
        (3e6, (1.5e6 + 3e5 + 1e4, 3.3e6 - 2e4, 4.98e6 + 5e3)),
        (-1e6, (3e5 + 1e4, 3e5 - 2e4, 3e5 + 5e3)),
    ):
        recorded = frame(camera, pattern, signal, 1, averaged=MANY)
        assert recorded[0] == pytest.approx(expected, abs=2)
    dark = replace(camera, dark_current_e_s=0.0, read_noise_e=0.0)
    assert np.array_equal(frame(dark, pattern, 0.0, 1, averaged=MANY), pattern.offset)


def test_noise_of_averaged_frames():
    """Shot noise of signal and dark current, and the electronics' noise, each over sqrt(n)."""
    camera = replace(IMAGER, dark_current_e_s=2e6, gain_nonuniformity=0, offset_nonuniformity_e=0)
    recorded = frame(camera, Pattern.of(camera, 0), 5e5, 0, averaged=16)
    expected = np.sqrt((5e5 + 2e4 + 1000**2) / 16)
    assert recorded.std() == pytest.approx(expected, rel=5 / np.sqrt(2 * recorded.size))


def photon_transfer(imager, seed, levels=8, most=0.6, frames=64):
    """Electrons per count and read noise by the photon transfer curve.

    The variance in counts is mean / K + (read noise / K)^2 + 1/12, with K electrons per count
    (Janesick, Photon Transfer, 2007, chapter 5). K is the weighted slope of variances that were
    measured up to the fraction `most` of the full well. The read noise is that of frames without
    signal.
    """
    mean, variance = np.empty((2, levels + 1))
    for k, signal in enumerate(most * imager.well * np.arange(levels + 1) / levels):
        recorded = uniform_frames(imager, signal, seed, k * frames, frames).astype(float)
        mean[k], variance[k] = recorded.mean(), recorded.var(axis=0, ddof=1).mean()
    # The standard error of a variance is proportional to the variance
    _, slope = np.polynomial.polynomial.polyfit(mean[1:], variance[1:], 1, w=1 / variance[1:])
    return 1 / slope, np.sqrt(variance[0] - 1 / 12) / slope


def test_photon_transfer():
    per_count, read_noise = photon_transfer(IMAGER, seed=1)
    assert per_count == pytest.approx(4.98e6 / (16383 * 63 / 64), rel=0.01)
    assert read_noise == pytest.approx(1000, rel=0.03)


def test_noise_of_a_pixel():
    camera = replace(IMAGER, dark_current_e_s=2e6, gain_nonuniformity=0.0)
    pattern = Pattern.of(camera, 0)
    frames = [
        counts(camera, frame(camera, pattern, 5e4, 0, k)) * camera.electrons_per_count
        for k in range(60)
    ]
    noise = np.sqrt(np.var(frames, axis=0, ddof=1).mean())
    assert noise == pytest.approx(float(camera.noise(5e4)), rel=0.01)


def test_full_well():
    quiet = replace(IMAGER, read_noise_e=0.0, offset_nonuniformity_e=0.0, gain_nonuniformity=0.0)
    signal = np.where(np.arange(80) < 20, 6e6, 1e6) * np.ones((60, 1))
    recorded = counts(quiet, frame(quiet, Pattern.of(quiet, 0), signal, 0))
    assert np.all(recorded[:, :20] == quiet.largest_count)
    assert recorded.max() == recorded[0, 0] and recorded[0, 40] < quiet.largest_count
    assert saturated(quiet, signal) == 0.25
    # The well holds the dark current, too
    dark = replace(quiet, dark_current_e_s=3.99e8)
    assert saturated(dark, np.array([0.98e6, 0.99e6, 1e6, 2e6])) == 0.75


def test_an_absurd_signal_fills_the_well():
    recorded = frame(IMAGER, Pattern.of(IMAGER, 0), 1e30, 0)
    assert recorded.mean() == pytest.approx(4.98e6, rel=1e-3)


def test_counts():
    """16383 counts for the full well, 255.98 for none; 14 bits and a pedestal of a 64th."""
    electrons = np.array([-1e9, 0.0, 2.49e6, 4.98e6, 1e9])
    assert counts(IMAGER, electrons).tolist() == [0, 256, 8319, 16383, 16383]
    assert counts(IMAGER, electrons).dtype == np.uint16
    per_count = 4.98e6 / (16383 * 63 / 64)
    assert counts(IMAGER, 100.4 * per_count) == 356 and counts(IMAGER, 100.6 * per_count) == 357


def test_counts_are_inverted():
    camera = replace(IMAGER, dark_current_e_s=2e7)
    signal = np.linspace(0, 4e6, 50)
    recorded = counts(camera, signal + 2e5).astype(float)
    assert signal_of(camera, recorded) == pytest.approx(
        signal, abs=0.501 * camera.electrons_per_count
    )


# Electrons of a camera, against closed forms and published numbers
# -----------------------------------------------------------------

# The camera of the pyradi notebook on staring array modelling. Its well is too small for 30 ms.
PYRADI = {
    "focal_length_mm": 100.0,
    "f_number": 4.0,
    "pitch_um": 15.0,
    "width": 64,
    "height": 64,
    "integration_time_ms": 30.0,
    "quantum_efficiency": 0.75,
}
UNSATURATED = Imager(**PYRADI, well_Me=20.0)
BAND = electron_band(band("3.495-4.945"), UNSATURATED, 0.8)


def photons(wavelength, temperature):
    """Spectral photon radiance of a blackbody, s^-1 m^-2 sr^-1 m^-1; wavelength in m."""
    return (
        2
        * LIGHT_SPEED
        / wavelength**4
        / np.expm1(PLANCK * LIGHT_SPEED / (wavelength * BOLTZMANN * temperature))
    )


def test_electrons_are_the_integral_of_the_photon_radiance():
    integral, _ = quad(photons, 3.495e-6, 4.945e-6, args=(300.0,), epsrel=1e-10)
    expected = integral * np.pi / 64 * (15e-6) ** 2 * 0.03 * 0.75 * 0.8
    assert electrons(BAND, 300.0) == pytest.approx(expected, rel=1e-8)


def test_electrons_and_netd_of_the_published_camera():
    assert electrons(BAND, 300.0) == pytest.approx(7.40e6, abs=0.005e6)
    assert electrons_per_kelvin(BAND, 300.0) == pytest.approx(265e3, abs=0.5e3)
    assert shot_noise_netd(BAND, 300.0) == pytest.approx(10.2e-3, abs=0.05e-3)


def test_frames_of_the_published_camera():
    """7.40 Me where the well is large enough; the camera's own well of 4.98 Me is full."""
    recorded = [
        signal_of(camera, uniform_frames(camera, float(electrons(BAND, 300.0)), 1)).mean()
        for camera in (UNSATURATED, Imager(**PYRADI, well_Me=4.98))
    ]
    assert recorded == pytest.approx([7.40e6, 4.98e6], rel=1e-3)


def test_measured_netd():
    predicted = netd(UNSATURATED, BAND, 300.0)
    assert measured_netd(UNSATURATED, BAND, 300.0, seed=3) == pytest.approx(predicted, rel=0.03)


def test_rows_integrate_as_the_nodes_do():
    x = np.linspace(3.4, 5.0, 1601)
    assert BAND.integral(x, np.ones(len(x))) == pytest.approx(BAND.weights_um.sum(), rel=1e-6)


def test_response_multiplies_the_quantum_efficiency(tmp_path):
    file = tmp_path / "response.csv"
    file.write_text("wavelength_um,response\n3.5,0\n4,1\n4.5,0.5\n")
    shaped = electron_band(band(file), UNSATURATED, 0.8)
    parts = [
        quad(
            lambda um: photons(1e-6 * um, 300.0) * np.interp(um, [3.5, 4, 4.5], [0, 1, 0.5]),
            lower,
            upper,
        )[0]
        for lower, upper in ((3.5, 4), (4, 4.5))
    ]
    expected = 1e-6 * sum(parts) * np.pi / 64 * (15e-6) ** 2 * 0.03 * 0.75 * 0.8
    assert electrons(shaped, 300.0) == pytest.approx(expected, rel=1e-6)
    x = np.linspace(3.4, 5.0, 1601)
    assert shaped.integral(x, x) == pytest.approx(
        shaped.weights_um @ shaped.wavelengths_um, rel=1e-3
    )


def test_without_optics_nothing_is_lost():
    assert electrons(electron_band(band("3.495-4.945"), UNSATURATED), 300.0) == pytest.approx(
        electrons(BAND, 300.0) / 0.8, rel=1e-12
    )


def test_a_deviation_in_kelvin():
    """One kelvin more, one kelvin less, and a pixel without electrons."""
    at = electrons(BAND, np.array([300.0, 250.0]))
    for step in (1.0, -1.0):
        moved = electrons(BAND, np.array([300.0, 250.0]) + step)
        assert in_kelvin(BAND, at, moved - at) == pytest.approx(step, rel=1e-8)
    assert in_kelvin(BAND, 0.0, at[0]) == pytest.approx(300, rel=1e-9)


def test_apparent_temperature_is_the_inverse():
    temperatures = np.array([220.0, 300.0, 900.0])
    assert apparent_temperature(BAND, electrons(BAND, temperatures)) == pytest.approx(
        temperatures, rel=1e-9
    )
    assert apparent_temperature(BAND, -5.0) == 0


@pytest.mark.parametrize(
    "name, value, text",
    [
        ("focal_length_mm", 0.0, "focal_length_mm = 0; must be positive"),
        ("pitch_um", 0.0, "pitch_um = 0; must be positive"),
        ("well_Me", -1.0, "well_Me = -1; must be positive"),
        ("integration_time_ms", 0.0, "integration_time_ms = 0; must be positive"),
        ("quantum_efficiency", 1.5, "quantum_efficiency = 1.5; must be positive and at most 1"),
        ("width", 0, "width = 0; must lie in 1..8192"),
        ("f_number", 0.3, "f_number = 0.3; must lie in 0.5..10000"),
        ("focal_length_mm", 0.01, "the width of the frame is 178 degrees"),
        ("focal_length_mm", 1e9, "the width of the frame is 5.5e-08 degrees"),
        ("bits", 17, "bits = 17; must lie in 1..16"),
        ("jitter_urad", -1.0, "jitter_urad = -1; must be 0 or more"),
        ("projection", "fisheye", "unknown projection 'fisheye'; known: "),
    ],
)
def test_bad_values(name, value, text):
    with pytest.raises(InputError, match=text.replace(".", r"\.")):
        Imager(**(PYRADI | {"well_Me": 5.0, name: value}))
