"""The camera's MTF: its parts, energy, and the slanted edge."""

from functools import partial

import numpy as np
import pytest
from scipy.integrate import quad

from mi_lcair.detection.camera.electronics import electron_band
from mi_lcair.detection.camera.measures import measured_mtf
from mi_lcair.detection.camera.optics import (
    MARGIN,
    OVERSAMPLING,
    SEEING,
    SPILL,
    Optics,
    Turbulence,
    defocus,
    diffraction,
    jitter,
)
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import spectral_radiance
from mi_lcair.physics.imager import Imager

AROUND = ((MARGIN, MARGIN), (MARGIN, MARGIN))
PARTS = [
    {},
    {"jitter_urad": 50.0},
    {"defocus_um": 60.0},
    {"f_number": 2.0, "fill_factor": 0.7},
]


def optics(turbulence=None, **changes) -> Optics:
    camera = {
        "focal_length_mm": 100.0,
        "f_number": 4.0,
        "pitch_um": 15.0,
        "width": 64,
        "height": 64,
        "integration_time_ms": 10.0,
        "well_Me": 5.0,
    }
    imager = Imager(**(camera | changes))
    thermal = partial(spectral_radiance, temperature=300.0)
    return Optics(imager, electron_band(band("MWIR"), imager), thermal, turbulence)


def test_diffraction_is_the_autocorrelation_of_the_aperture():
    """Two circles of diameter 1, shifted by u: area of their lens over that of the circle."""
    for u in (0.0, 0.1, 0.5, 0.9, 1.0, 1.7):
        half = lambda x: 2 * np.sqrt(max(0.25 - x * x, 0))
        lens = 2 * quad(half, min(u / 2, 0.5), 0.5)[0]
        value = diffraction(np.array([u * 1e3 / (4.0 * 4.2)]), 4.0, np.array([4.2]), np.ones(1))
        assert value[0] == pytest.approx(lens / (np.pi / 4), abs=1e-7)


def test_diffraction_is_a_mean_over_the_spectrum():
    f = np.array([20.0, -20.0])
    parts = [diffraction(f, 4.0, np.array([um]), np.ones(1)) for um in (3.0, 5.0)]
    mean = diffraction(f, 4.0, np.array([3.0, 5.0]), np.array([2.0, 6.0]))
    assert mean == pytest.approx(0.25 * parts[0] + 0.75 * parts[1], rel=1e-12)


def test_parts_at_one_frequency():
    """50 urad x 100 mm = 5 um; 40 um / 4 = 10 um; 15 um sqrt(0.64) = 12 um."""
    camera = optics(jitter_urad=50.0, defocus_um=-40.0, fill_factor=0.64)
    for frequency in (25.0, -25.0):
        parts = camera.parts(np.array([frequency]))
        assert parts["jitter"][0] == pytest.approx(np.exp(-2 * (np.pi * 0.125) ** 2), rel=1e-12)
        assert parts["pixel"][0] == pytest.approx(np.sin(0.3 * np.pi) / (0.3 * np.pi), rel=1e-12)
        assert parts["defocus"] == pytest.approx(defocus(np.array([25.0]), 10.0), rel=1e-12)


@pytest.mark.parametrize(
    "wavelength, wave, expected",
    [(4.0, "plane", 0.432), (10.0, "plane", 0.539), (4.0, "spherical", 0.432 ** (3 / 8))],
)
def test_turbulence_in_a_long_exposure(wavelength, wave, expected):
    """10 cycles/mrad through 5 km of 1e-14 m^(-2/3): exp(-57.4 f^(5/3) cn2 R / wavelength^(1/3)).

    Fried's r0 of a plane wave is 9.33 cm at 4 um.
    """
    air = Turbulence(1e-14, wave, 5000.0)
    value = air.mtf(np.array([1e4, -1e4]), np.array([wavelength]), np.ones(1))
    assert value == pytest.approx(expected, abs=5e-4)
    weight = 1.0 if wave == "plane" else 3 / 8
    exponent = 57.4 * weight * 1e4 ** (5 / 3) * 1e-14 * 5000 * (1e-6 * wavelength) ** (-1 / 3)
    assert value == pytest.approx(np.exp(-exponent), rel=2e-3)


def test_turbulence_is_a_part_of_the_mtf():
    """At 40 cycles/mm and 100 mm: 4 cycles/mrad. Three times the path has the exponent thrice."""
    air = Turbulence(2e-14, "plane", 2000.0)
    camera = optics(air)
    frequency = np.array([0.0, 40.0])
    part = camera.parts(frequency)["turbulence"]
    alone = [air.mtf(np.array([4e3]), np.array([um]), np.ones(1))[0] for um in (3.0, 5.0)]
    # Weights of the spectrum add up to 1 within rounding
    assert part[0] == pytest.approx(1, rel=1e-12) and alone[0] < part[1] < alone[1]
    assert camera.mtf(frequency) == pytest.approx(optics().mtf(frequency) * part, rel=1e-12)
    further = camera.at(6000.0)
    assert further.parts(frequency)["turbulence"][1] == pytest.approx(part[1] ** 3, rel=1e-2)
    assert camera.parts(frequency)["turbulence"][1] == part[1]
    point = np.zeros((3, 3))
    point[1, 1] = 1
    assert further.seen(point, AROUND).max() < camera.seen(point, AROUND).max()
    assert optics().at(6000.0).turbulence is None


def test_turbulence_reaches_further():
    """What a half plane sends beyond r, by the integral of its MTF, is SPILL where it says."""
    camera = optics(Turbulence(3e-13, "plane", 5000.0), f_number=0.5)
    r0 = camera.turbulence.coherence_m(camera.mean_wavelength_um)
    assert camera.seeing_um == pytest.approx(camera.mean_wavelength_um / r0 * 0.1, rel=1e-9)
    reach = camera.seeing_um / 15 * (SEEING / SPILL) ** 0.6
    f = (np.arange(400_000) + 0.5) * 100 / 400_000
    wave = np.sin(2 * np.pi * f * 15e-3 * reach) / (np.pi * f)
    beyond = 0.5 - np.sum(camera.parts(f)["turbulence"] * wave) * (f[1] - f[0])
    assert beyond == pytest.approx(SPILL, rel=0.1)
    by_diffraction = camera.mean_wavelength_um * 0.5 / 15 / np.pi**3 / SPILL * 2
    assert camera.reach(1e9) == int(np.ceil(reach + by_diffraction))
    with pytest.raises(InputError, match="cn2 = 3e-10 spreads the light of a point over"):
        optics(Turbulence(3e-10, "plane", 5000.0)).check_spread()


@pytest.mark.parametrize(
    "fits, exceeds, message",
    [
        ({"jitter_urad": 1199}, {"jitter_urad": 1201}, "jitter_urad = 1201 spreads .* 32 pixels"),
        ({"defocus_um": -1919}, {"defocus_um": -1921}, "defocus_um = -1921 spreads .* 32 pixels"),
        ({"f_number": 48.0}, {"f_number": 48.1}, "f_number = 48.1 spreads .* 32.1 pixels"),
    ],
)
def test_a_spread_over_32_pixels(fits, exceeds, message):
    """Two standard deviations of jitter to each side, the disc of defocus, and 2 wavelength N."""
    optics(**fits).check_spread()
    with pytest.raises(InputError, match=message):
        optics(**exceeds).check_spread()


def test_jitter_and_defocus_are_transforms_of_their_spreads():
    frequency, sigma, diameter = 21.0, 6.0, 14.0
    turn = 2 * np.pi * frequency * 1e-3
    gauss = lambda x: np.exp(-(x**2) / 2 / sigma**2) / sigma / np.sqrt(2 * np.pi) * np.cos(turn * x)
    assert jitter(frequency, sigma) == pytest.approx(quad(gauss, -60, 60)[0], rel=1e-8)
    disc = lambda x: 8 / np.pi / diameter**2 * np.sqrt(diameter**2 / 4 - x * x) * np.cos(turn * x)
    assert defocus(frequency, diameter) == pytest.approx(
        quad(disc, -diameter / 2, diameter / 2)[0], rel=1e-6
    )
    assert defocus(0.0, diameter) == 1


@pytest.mark.parametrize("changes", PARTS)
def test_slanted_edge_measures_the_product_of_the_parts(changes):
    camera = optics(**changes)
    frequency, value = measured_mtf(camera)
    assert frequency[-1] == pytest.approx(500 / 15)
    assert value == pytest.approx(camera.mtf(frequency), abs=0.02)
    assert camera.mtf(frequency) == pytest.approx(
        np.prod(list(camera.parts(frequency).values()), axis=0)
    )


def test_energy_is_conserved():
    samples = np.zeros((90, 60))
    samples[40:47, 20:33] = np.random.default_rng(1).random((7, 13))
    for changes in PARTS[:3]:
        image = optics(**changes).seen(samples, ((70, 60), (80, 90)))
        assert image.shape == (30 + 130, 20 + 170)
        assert image.sum() * OVERSAMPLING**2 == pytest.approx(samples.sum(), rel=1e-3)


def test_the_frame_around_the_samples():
    """Where the frame is, and how wide it is, changes no pixel by more than SPILL from a side."""
    samples = np.random.default_rng(2).random((60, 90))
    camera = optics()
    wide = camera.seen(samples, ((100, 100), (100, 100)))
    for around in (((7, 3), (9, 60)), ((-4, 80), (50, -11)), ((0, -19), (-29, 0))):
        (top, bottom), (left, right) = around
        part = wide[100 - top : 120 + bottom, 100 - left : 130 + right]
        assert camera.seen(samples, around) == pytest.approx(part, abs=2 * SPILL)


def test_the_table_of_the_round_parts():
    """It ends at the diagonal of the frequencies of samples of 5 um, 100 cycles/mm on each axis."""
    frequency, product = optics(jitter_urad=50.0).profile
    assert frequency[-1] == pytest.approx(100 * np.sqrt(2), rel=1e-9) and len(frequency) == 8192
    exact = np.prod(
        list(optics(jitter_urad=50.0).round_parts(frequency[[9, 999]]).values()), axis=0
    )
    assert product[[9, 999]] == pytest.approx(exact, rel=1e-12)


def test_a_half_plane_beyond_reach_sends_no_more_than_spill():
    """The line spread function beyond r: 1/2 - integral of MTF sin(2 pi f r) / (pi f) over f."""
    camera = optics()
    reach = camera.reach(1e9)
    f = (np.arange(400_000) + 0.5) * 100 / 400_000  # cycles/mm, beyond the cut-off of 83
    wave = np.sin(2 * np.pi * f * 15e-3 * reach) / (np.pi * f)
    beyond = 0.5 - np.sum(camera.mtf(f) * wave) * (f[1] - f[0])
    assert beyond == pytest.approx(SPILL, rel=0.05)
    assert camera.reach(600) == int(np.ceil((600 * reach / 2) ** (1 / 3)))
    assert optics(f_number=0.5).reach(1) == MARGIN and optics(f_number=40.0).reach(1e9) == 384


def test_uniform_scene_stays_uniform():
    samples = np.ones((240, 240))
    image = optics(jitter_urad=50.0).seen(samples, AROUND)
    middle = image[MARGIN + 35 : -MARGIN - 35, MARGIN + 35 : -MARGIN - 35]
    # Diffraction brings 2 wavelength N / (pi^2 r) = 0.6 % from outside a radius of 38 pixels
    assert middle == pytest.approx(1, abs=6e-3)


def test_variance_of_independent_samples():
    """The sum over the samples of their variance times the square of their image."""
    camera = optics()
    variances = np.zeros((9, 12))
    expected = 0
    for row, column, variance in ((3, 5, 4.0), (4, 5, 1.0), (8, 11, 2.0)):
        variances[row, column] = variance
        point = np.zeros(variances.shape)
        point[row, column] = 1
        expected = expected + variance * camera.seen(point, AROUND) ** 2
    assert camera.variance(variances, AROUND) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_a_sample_in_the_middle_of_a_pixel_is_seen_symmetrically():
    samples = np.zeros((3 * OVERSAMPLING, 5 * OVERSAMPLING))
    samples[OVERSAMPLING + 1, 2 * OVERSAMPLING + 1] = 1
    image = optics(jitter_urad=50.0).seen(samples, AROUND)
    assert np.unravel_index(image.argmax(), image.shape) == (MARGIN + 1, MARGIN + 2)
    assert image == pytest.approx(image[::-1], abs=1e-15)
    assert image == pytest.approx(image[:, ::-1], abs=1e-15)


def test_image_of_a_point_with_jitter():
    """Integral of the MTF over both frequencies. The sample stands for the mean of its square."""
    camera = optics(jitter_urad=150.0, f_number=1.0, fill_factor=0.5)
    samples = np.zeros((OVERSAMPLING, OVERSAMPLING))
    samples[1, 1] = 1
    frequency = (np.arange(-400, 400) + 0.5) / 8  # cycles/mm, up to 50
    fx, fy = np.meshgrid(frequency, frequency)
    distance = np.hypot(fx, fy)
    transfer = (
        diffraction(distance, 1.0, camera.wavelengths_um, camera.weights)
        * np.exp(-2 * (np.pi * 15e-3 * distance) ** 2)
        * np.sinc(15e-3 * np.sqrt(0.5) * fx)
        * np.sinc(15e-3 * np.sqrt(0.5) * fy)
        / np.sinc(5e-3 * fx)
        / np.sinc(5e-3 * fy)
    )
    for pixels in (0, 1, 2):  # to the right of the point
        wave = np.cos(2 * np.pi * 15e-3 * pixels * fx)
        expected = np.sum(transfer * wave) / 64 * 5e-3**2
        assert camera.seen(samples, AROUND)[MARGIN, MARGIN + pixels] == pytest.approx(
            expected, rel=2e-3
        )
