"""Frames: seeds, photon transfer, saturation, non-uniformity correction."""

from dataclasses import replace

import numpy as np
import pytest

from mi_lcair.camera.electronics.calibration import two_point
from mi_lcair.camera.electronics.frames import Pattern, counts, frame, saturated, signal_of
from mi_lcair.camera.electronics.response import (
    apparent_temperature,
    electron_band,
    electrons,
    electrons_per_kelvin,
)
from mi_lcair.camera.measures import photon_transfer
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
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
BAND = electron_band(band("3.5-5"), IMAGER, 0.8)


def test_seed_and_number_make_the_frame():
    pattern = Pattern.of(IMAGER, 7)
    one = lambda seed, number: frame(IMAGER, pattern, 1e6, seed, number)
    assert np.array_equal(one(7, 3), one(7, 3))
    assert not np.array_equal(one(7, 3), one(7, 4))
    assert not np.array_equal(one(7, 3), one(8, 3))
    assert np.array_equal(Pattern.of(IMAGER, 7).gain, pattern.gain)


def test_photon_transfer():
    measured = photon_transfer(IMAGER, seed=1)
    assert measured.electrons_per_count == pytest.approx(IMAGER.electrons_per_count, rel=0.01)
    assert measured.read_noise_e == pytest.approx(1000, rel=0.03)


def test_noise_of_a_pixel():
    camera = replace(IMAGER, dark_current_e_s=2e6, gain_nonuniformity=0.0)
    pattern = Pattern.of(camera, 0)
    frames = [
        counts(camera, frame(camera, pattern, 5e4, 0, k)) * camera.electrons_per_count
        for k in range(60)
    ]
    noise = np.sqrt(np.var(frames, axis=0, ddof=1).mean())
    assert noise == pytest.approx(float(camera.noise(5e4)), rel=0.01)
    assert camera.dark == pytest.approx(2e4)


def test_full_well():
    quiet = replace(IMAGER, read_noise_e=0.0, offset_nonuniformity_e=0.0, gain_nonuniformity=0.0)
    signal = np.where(np.arange(80) < 20, 6e6, 1e6) * np.ones((60, 1))
    recorded = counts(quiet, frame(quiet, Pattern.of(quiet, 0), signal, 0))
    assert np.all(recorded[:, :20] == quiet.largest_count)
    assert recorded.max() == recorded[0, 0] and recorded[0, 40] < quiet.largest_count
    assert saturated(quiet, signal) == 0.25


def test_non_uniformity_correction():
    """What is left of the fixed pattern is the noise of the frames of the uniform scenes."""
    pattern = Pattern.of(IMAGER, 5)
    correction = two_point(IMAGER, pattern, BAND, 295.0, seed=5)
    signal = float(electrons(BAND, 301.0))
    frames = np.mean([frame(IMAGER, pattern, signal, 5, k) for k in range(64)], axis=0)
    raw, corrected = (
        np.std(apparent_temperature(BAND, values))
        for values in (frames, correction.applied(frames))
    )
    slope = electrons_per_kelvin(BAND, 301.0)
    assert raw == pytest.approx(np.hypot(0.02 * signal, 5000) / slope, rel=0.05)
    # Each scene and the frames are means of 64; beyond the scenes' middle their errors grow
    assert corrected < 2 * float(IMAGER.noise(signal)) / 8 / slope
    assert correction.applied(frames).mean() == pytest.approx(signal, rel=1e-3)


def test_correction_that_saturates():
    slow = replace(IMAGER, integration_time_ms=30.0)
    band_of_slow = electron_band(band("3.5-5"), slow, 0.8)
    with pytest.raises(InputError, match="305 K, which gives .* saturates the well of 4.98 Me"):
        two_point(slow, Pattern.of(slow, 0), band_of_slow, 295.0, seed=0)


def test_counts_are_inverted():
    signal = np.linspace(0, 4e6, 50)
    assert signal_of(IMAGER, counts(IMAGER, signal).astype(float)) == pytest.approx(
        signal, abs=0.51 * IMAGER.electrons_per_count
    )
