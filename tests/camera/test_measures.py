"""Measures of a laboratory: NETD, uniform frames, the slanted edge."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import erf

from mi_lcair.camera.electronics.frames import Pattern, signal_of
from mi_lcair.camera.electronics.response import electron_band, electrons
from mi_lcair.camera.measures import (
    edge_samples,
    measured_mtf,
    measured_netd,
    netd,
    shot_noise_netd,
    slanted_edge_mtf,
    uniform_frames,
)
from mi_lcair.camera.optics import OVERSAMPLING, Optics
from mi_lcair.physics.bands import band
from mi_lcair.physics.imager import Imager

IMAGER = Imager(
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
BAND = electron_band(band("MWIR"), IMAGER)


def slope(temperature):
    """Electrons per kelvin by a wide difference of fourth order."""
    e = electrons(BAND, temperature + np.array([-2.0, -1.0, 1.0, 2.0]))
    return (e[0] - 8 * e[1] + 8 * e[2] - e[3]) / 12


def test_netd():
    """Noise over electrons per kelvin: shot noise, dark current, read noise, a count over 12^1/2"""
    signal = float(electrons(BAND, 295.0))
    count = 4e6 / (16383 * 63 / 64)
    noise = np.sqrt(signal + 4e4 + 700**2 + count**2 / 12)
    assert netd(IMAGER, BAND, 295.0) == pytest.approx(noise / slope(295.0), rel=1e-5)
    assert shot_noise_netd(BAND, 295.0) == pytest.approx(np.sqrt(signal) / slope(295.0), rel=1e-5)


def test_measured_netd():
    predicted = netd(IMAGER, BAND, 295.0)
    assert measured_netd(IMAGER, BAND, 295.0, seed=2) == pytest.approx(predicted, rel=0.015)


def test_uniform_frames():
    """64 x 64 pixels with the camera's pattern; each frame has noise of its own."""
    recorded = uniform_frames(IMAGER, 1e6, 5)
    assert recorded.shape == (16, 64, 64)
    signal = signal_of(IMAGER, recorded.astype(float))
    pattern = Pattern.of(replace(IMAGER, width=64, height=64), 5)
    error = float(IMAGER.noise(1e6)) / 4
    assert (signal.mean(axis=0) - 1e6 - pattern.offset).std() == pytest.approx(error, rel=0.06)
    temporal = signal - signal.mean(axis=0)
    assert temporal.std() == pytest.approx(float(IMAGER.noise(1e6)) * np.sqrt(15 / 16), rel=0.015)
    assert np.array_equal(uniform_frames(IMAGER, 1e6, 5, first=2, frames=1)[0], recorded[2])


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
    optics = Optics(IMAGER, BAND, np.ones_like)
    frequency, value = measured_mtf(optics)
    assert frequency[-1] == pytest.approx(1 / 0.03)  # half a cycle per pixel of 15 um
    assert value == pytest.approx(optics.mtf(frequency), abs=0.01)
