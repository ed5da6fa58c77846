"""Measures of a laboratory: NETD, uniform frames, the slanted edge."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import erf

from mi_lcair.detection.camera.electronics import (
    Camera,
    Correction,
    Pattern,
    electron_band,
    electrons,
    signal_of,
)
from mi_lcair.detection.camera.measures import (
    edge_samples,
    measured,
    measured_mtf,
    measured_netd,
    netd,
    shot_noise_netd,
    slanted_edge_mtf,
    uniform_frames,
)
from mi_lcair.detection.camera.optics import OVERSAMPLING, Optics
from mi_lcair.physics.bands import band
from mi_lcair.physics.imager import Imager

# Measures of a target in an image, calculated by hand
# ----------------------------------------------------

IMAGER = Imager(
    focal_length_mm=100.0,
    f_number=4.0,
    pitch_um=15.0,
    width=4,
    height=2,
    integration_time_ms=4.0,
    well_Me=4.0,
    read_noise_e=700.0,
    gain_nonuniformity=0.01,
    offset_nonuniformity_e=2e3,
)
BAND = electron_band(band("MWIR"), IMAGER)
LEVEL = 1e5
SIGNAL = LEVEL + np.array([[0, 0, 3e5, 4e5], [0, -1e5, 4.1e6, 0]])
SHARE = np.array([[0, 0, 0.5, 1], [0, 0.49, 1, 0]])
ERROR = np.array([[9, 9, 0.1, 0.2], [9, 9, 0.4, 9]])


def measures(imager=IMAGER, signal=SIGNAL, share=SHARE, temperature=295.0, design=Correction()):
    electron = electron_band(band("MWIR"), imager)
    camera = Camera(
        imager=imager,
        band=electron,
        optics=Optics(imager, electron, np.ones_like),
        design=design,
        background=LEVEL,
        temperature=temperature,
        pattern=Pattern.of(imager, 3),
        correction=design,
        seed=3,
    )
    return measured(camera, signal, design.undone(LEVEL), share, ERROR, 2.5)


def test_noise_and_ratios():
    """Without correction, the fixed pattern of the background is noise: 1 % of it, and 2000."""
    result = measures()
    count = 4e6 / (16383 * 63 / 64)
    noise = np.sqrt(LEVEL + 700**2 + count**2 / 12 + 1000**2 + 2000**2)
    assert result.noise == pytest.approx(noise, rel=1e-9)
    assert result.peak_snr == pytest.approx(
        (4e6 - LEVEL) / noise, rel=1e-9
    )  # of 4.1e6, in the well
    squares = 3e5**2 + 4e5**2 + 1e5**2 + (4e6 - LEVEL) ** 2
    assert result.snr == pytest.approx(np.sqrt(squares) / noise, rel=1e-9)
    corrected = measures(replace(IMAGER, nuc=True))
    assert corrected.noise == pytest.approx(np.sqrt(LEVEL + 700**2 + count**2 / 12), rel=1e-9)


def test_pixels_on_the_target():
    """The error of the rendering is its rms over pixels that the target fills by half or more."""
    assert measures().render_error == pytest.approx(np.sqrt((0.01 + 0.04 + 0.16) / 3), rel=1e-9)
    # A target smaller than a pixel counts where it fills most
    assert measures(share=0.4 * SHARE).render_error == pytest.approx(np.sqrt(0.1), rel=1e-9)
    assert measures().pixels == 2.5 and measures().saturated == 1 / 8


def test_the_optics_emission_is_noise():
    """NETD of twice the electrons of the uniform scene: its own ones and as many of the optics."""
    signal = float(electrons(BAND, 295.0))
    warm = measures(design=Correction(np.array([1, 1, 1, 0.5]), signal))
    count = 4e6 / (16383 * 63 / 64)
    other = 700**2 + count**2 / 12
    cold = measures()
    assert warm.netd / cold.netd == pytest.approx(
        np.sqrt((2 * signal + other) / (signal + other)), rel=1e-9
    )
    assert warm.netd_shot / cold.netd_shot == pytest.approx(np.sqrt(2), rel=1e-9)
    assert warm.netd_measured == pytest.approx(warm.netd, rel=0.015)
    assert warm.background == LEVEL + signal and warm.glow == signal and cold.glow == 0
    pattern = np.hypot(0.01 * (LEVEL + signal), 2000)
    assert warm.noise == pytest.approx(np.hypot(np.sqrt(LEVEL + signal + other), pattern), rel=1e-9)
    assert measures(design=Correction(1.0, 4e6 - signal)).netd_measured is None  # a full well
    even = LEVEL * np.array([1, 1, 1, 0.5]) + signal + np.zeros((2, 1))
    assert measures(design=Correction(np.array([1, 1, 1, 0.5]), signal), signal=even).snr == 0


def test_netd():
    result = measures()
    assert result.netd == netd(IMAGER, BAND, 295.0) and result.temperature == 295
    assert result.netd_shot == shot_noise_netd(BAND, 295.0)
    # Frames show it in time, without the fixed pattern
    assert result.netd_measured == pytest.approx(result.netd, rel=0.015)
    assert result.mtf["measured"] == pytest.approx(result.mtf["predicted"], abs=0.01)


def test_netd_is_not_measured_where_the_uniform_scene_saturates():
    """The well must hold signal and dark current and six standard deviations of their noise."""
    signal = float(electrons(BAND, 295.0))
    noise = np.sqrt(signal + 4e4 + 700**2)
    for margin, is_measured in ((5.8, False), (6.3, True)):
        well = signal + 4e4 + margin * noise
        camera = replace(IMAGER, well_Me=1e-6 * well, dark_current_e_s=1e7, bits=16)
        assert (measures(camera).netd_measured is not None) == is_measured


def test_netd_is_not_measured_where_counts_hide_the_noise():
    """The noise must be half a count or more; it holds the count's own 12^-1/2."""
    short = replace(IMAGER, integration_time_ms=0.05, read_noise_e=0.0, bits=8)
    signal = float(electrons(electron_band(band("MWIR"), short), 295.0))
    for share, is_measured in ((0.48, False), (0.52, True)):
        # Without dark current the squared noise is signal + count^2 / 12
        count = np.sqrt(signal / (share**2 - 1 / 12))
        camera = replace(short, well_Me=1e-6 * count * 255 * 63 / 64)
        assert (measures(camera).netd_measured is not None) == is_measured


MEASURES_IMAGER = Imager(
    focal_length_mm=100.0,
    f_number=4.0,
    pitch_um=15.0,
    width=200,
    height=100,
    integration_time_ms=4.0,
    well_Me=4.0,
    read_noise_e=700.0,
    dark_current_e_s=1e7,
    offset_nonuniformity_e=2e4,
)
MEASURES_BAND = electron_band(band("MWIR"), MEASURES_IMAGER)


def slope(temperature):
    """Electrons per kelvin by a wide difference of fourth order."""
    e = electrons(MEASURES_BAND, temperature + np.array([-2.0, -1.0, 1.0, 2.0]))
    return (e[0] - 8 * e[1] + 8 * e[2] - e[3]) / 12


def test_netd_of_measures():
    """Noise over electrons per kelvin: shot noise, dark current, read noise, a count over 12^1/2"""
    signal = float(electrons(MEASURES_BAND, 295.0))
    count = 4e6 / (16383 * 63 / 64)
    noise = np.sqrt(signal + 4e4 + 700**2 + count**2 / 12)
    assert netd(MEASURES_IMAGER, MEASURES_BAND, 295.0) == pytest.approx(
        noise / slope(295.0), rel=1e-5
    )
    assert shot_noise_netd(MEASURES_BAND, 295.0) == pytest.approx(
        np.sqrt(signal) / slope(295.0), rel=1e-5
    )


def test_measured_netd():
    predicted = netd(MEASURES_IMAGER, MEASURES_BAND, 295.0)
    assert measured_netd(MEASURES_IMAGER, MEASURES_BAND, 295.0, seed=2) == pytest.approx(
        predicted, rel=0.015
    )


def test_uniform_frames():
    """64 x 64 pixels with the camera's pattern; each frame has noise of its own."""
    recorded = uniform_frames(MEASURES_IMAGER, 1e6, 5)
    assert recorded.shape == (16, 64, 64)
    signal = signal_of(MEASURES_IMAGER, recorded.astype(float))
    pattern = Pattern.of(replace(MEASURES_IMAGER, width=64, height=64), 5)
    error = float(MEASURES_IMAGER.noise(1e6)) / 4
    assert (signal.mean(axis=0) - 1e6 - pattern.offset).std() == pytest.approx(error, rel=0.06)
    temporal = signal - signal.mean(axis=0)
    assert temporal.std() == pytest.approx(
        float(MEASURES_IMAGER.noise(1e6)) * np.sqrt(15 / 16), rel=0.015
    )
    assert np.array_equal(
        uniform_frames(MEASURES_IMAGER, 1e6, 5, first=2, frames=1)[0], recorded[2]
    )


@pytest.mark.parametrize("slope", [0.08749, -0.2])
def test_samples_of_an_edge(slope):
    """Half of the image is bright; a sample's value is the share of its square."""
    size = 20
    samples = edge_samples(size, slope)
    side = OVERSAMPLING * size
    assert samples.shape == (side, side) and samples.mean() == pytest.approx(0.5, abs=1e-12)
    assert set(np.unique(samples[:, [0, -1]])) == {0, 1}
    for row in (0, 17, side - 1):
        # The edge crosses the row's middle at this column
        crossing = side / 2 + slope * (row + 0.5 - side / 2)
        assert side - samples[row].sum() == pytest.approx(crossing, abs=1e-12)


@pytest.mark.parametrize(
    "rows, start, gradient, sigma",
    [(120, 47, 0.08749, 0.6), (120, 47, -0.0951, 0.5), (24, 46, 0.08749, 0.6)],
)
def test_slanted_edge(rows, start, gradient, sigma):
    """The MTF of a Gaussian blur of sigma pixels, exp(-2 (pi sigma f)^2), from a tilted edge.

    The values are those at the pixels' centres, which no pixel's footprint blurs further. An
    edge off the middle of few rows leaves places without a pixel, which must not count.
    """
    y, x = np.mgrid[:rows, :100] + 0.5
    distance = (x - start - gradient * y) / np.hypot(1, gradient)
    frequency, value = slanted_edge_mtf(2 + 3 * (1 + erf(distance / (sigma * np.sqrt(2)))))
    assert frequency[0] == 0 and frequency[-1] == pytest.approx(0.5)
    assert value == pytest.approx(np.exp(-2 * (np.pi * sigma * frequency) ** 2), abs=0.01)


def test_mtf_on_the_image_of_an_edge():
    optics = Optics(MEASURES_IMAGER, MEASURES_BAND, np.ones_like)
    frequency, value = measured_mtf(optics)
    assert frequency[-1] == pytest.approx(1 / 0.03)  # half a cycle per pixel of 15 um
    assert value == pytest.approx(optics.mtf(frequency), abs=0.01)
