"""Two-point correction: what it finds, what is left of the pattern, what it refuses."""

import re
from dataclasses import replace

import numpy as np
import pytest

from mi_lcair.detection.camera.electronics import (
    Correction,
    Pattern,
    apparent_temperature,
    electron_band,
    electrons,
    electrons_per_kelvin,
    frame,
    two_point,
)
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from tests.detection.camera.test_electronics import IMAGER

BAND = electron_band(band("3.5-5"), IMAGER, 0.8)


def test_without_a_correction_nothing_changes():
    assert Correction().applied(np.array([1.5, -2.0])).tolist() == [1.5, -2.0]
    assert Correction(gain=2.0, offset=1.0).applied(np.array([5.0])) == 2


def test_a_correction_is_undone():
    correction = Correction(gain=np.array([2.0, 0.5]), offset=3.0)
    assert correction.undone(10.0).tolist() == [23.0, 8.0]
    assert correction.applied(correction.undone(10.0)).tolist() == [10, 10]


def test_the_optics_are_corrected_with_the_pattern():
    """Illumination multiplies the gains; the optics' emission adds to the offsets."""
    pattern, level = Pattern.of(IMAGER, 5), 2e5
    design = Correction(np.linspace(0.6, 1, 80), level)
    correction = two_point(IMAGER, pattern, design, BAND, 295.0, seed=5)
    assert correction.gain == pytest.approx(pattern.gain * design.gain, abs=0.01)
    assert np.mean(correction.gain / pattern.gain / design.gain) == pytest.approx(1, abs=2e-4)
    rest = correction.offset - pattern.offset - level * pattern.gain
    assert abs(rest.mean()) < 5 * rest.std() / np.sqrt(rest.size)


def test_gains_and_offsets_are_those_of_the_pattern():
    """Their errors are those of two means of 64 frames, and a dead pixel has a gain of 1."""
    imager = replace(IMAGER, dark_current_e_s=2e7)
    pattern = Pattern.of(imager, 5)
    pattern.gain[3, 4] = 0.0
    correction = two_point(imager, pattern, Correction(), BAND, 295.0, seed=5)
    low, high = electrons(BAND, np.array([285.0, 305.0]))
    assert correction.gain[3, 4] == 1
    live = np.arange(pattern.gain.size).reshape(pattern.gain.shape) != 3 * 80 + 4
    errors = [np.sqrt((level + 2e5 + 1000**2) / 64) for level in (low, high)]
    gain_error = (correction.gain - pattern.gain)[live]
    assert gain_error.std() == pytest.approx(np.hypot(*errors) / (high - low), rel=0.05)
    assert abs(gain_error.mean()) < 4 * gain_error.std() / np.sqrt(gain_error.size)
    # The line through both scenes, at no signal
    offset_error = (correction.offset - pattern.offset)[live]
    spread = np.hypot(errors[0] * high, errors[1] * low) / (high - low)
    assert offset_error.std() == pytest.approx(spread, rel=0.05)
    assert abs(offset_error.mean()) < 4 * offset_error.std() / np.sqrt(offset_error.size)


def test_non_uniformity_correction():
    """What is left of the fixed pattern is the noise of the frames of the uniform scenes."""
    pattern = Pattern.of(IMAGER, 5)
    correction = two_point(IMAGER, pattern, Correction(), BAND, 295.0, seed=5)
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


def test_the_uniform_scenes_have_noise_of_their_own():
    """The frames of both scenes, and those of an image, are independent."""
    pattern = Pattern(np.ones((60, 80)), np.zeros((60, 80)))
    correction = two_point(IMAGER, pattern, Correction(), BAND, 295.0, seed=5)
    low, high = electrons(BAND, np.array([285.0, 305.0]))
    first, second = (correction.offset + correction.gain * level - level for level in (low, high))
    image = frame(IMAGER, pattern, low, 5, 0, 64) - low
    for one, other in ((first, second), (first, image), (second, image)):
        assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 5 / np.sqrt(one.size)


@pytest.mark.parametrize("changes, fits", [({"gain": 1.3}, True), ({"gain": 1.4}, False)])
def test_the_pixel_with_the_largest_gain_must_not_saturate(changes, fits):
    warm = float(electrons(BAND, 305.0))
    camera = replace(IMAGER, well_Me=1e-6 * 1.35 * warm)
    pattern = Pattern(np.full((60, 80), 1.0), np.zeros((60, 80)))
    pattern.gain[0, 0] = changes["gain"]
    if fits:
        two_point(camera, pattern, Correction(), BAND, 295.0, seed=0)
        camera = replace(camera, dark_current_e_s=100 * 0.06 * warm)  # 0.06 of it in 10 ms
    with pytest.raises(InputError, match="saturates"):
        two_point(camera, pattern, Correction(), BAND, 295.0, seed=0)


def test_correction_that_saturates():
    slow = replace(IMAGER, integration_time_ms=30.0)
    band_of_slow = electron_band(band("3.5-5"), slow, 0.8)
    level = f"{1e-6 * float(electrons(band_of_slow, 305.0)):.4g}"
    with pytest.raises(
        InputError, match=f"305 K, which gives {level} Me and saturates the well of 4.98 Me"
    ):
        two_point(slow, Pattern.of(slow, 0), Correction(), band_of_slow, 295.0, seed=0)


def test_scenes_that_noise_hides():
    """The scenes must differ by ten standard deviations of a frame of the warmer one."""
    low, high = electrons(BAND, np.array([285.0, 305.0]))
    read_noise = np.sqrt(((high - low) / 10) ** 2 - high)  # about
    pattern = Pattern.of(IMAGER, 0)
    quiet = replace(IMAGER, read_noise_e=0.97 * read_noise)
    two_point(quiet, pattern, Correction(), BAND, 295.0, seed=0)
    noisy = replace(IMAGER, read_noise_e=1.03 * read_noise)
    words = f"differ by {high - low:.3g} electrons with a noise of {float(noisy.noise(high)):.3g};"
    with pytest.raises(InputError, match=re.escape(words)):
        two_point(noisy, pattern, Correction(), BAND, 295.0, seed=0)
