"""A camera's derived numbers, calculated by hand."""

from dataclasses import replace

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.imager import Detector, Imager

IMAGER = Imager(
    focal_length_mm=50.0,
    f_number=2.5,
    pitch_um=20.0,
    width=200,
    height=100,
    integration_time_ms=4.0,
    well_Me=3.0,
    fill_factor=0.81,
    read_noise_e=300.0,
    dark_current_e_s=5e6,
    bits=12,
)


def test_optics():
    assert IMAGER.solid_angle == pytest.approx(0.125663706, rel=1e-8)  # pi / 25
    assert IMAGER.pixel_area == pytest.approx(3.24e-10, rel=1e-12)
    assert IMAGER.pixel_angle == pytest.approx(4e-4, rel=1e-12)
    assert IMAGER.angle_deg(200) == pytest.approx(np.degrees(2 * np.arctan(0.04)))


def test_what_the_f_number_means():
    """A thin lens at f/2.5 has 1 / 26 less than pi / 25, as tan = 1 / (2 N) in place of sin."""
    thin = replace(IMAGER, lens="thin")
    assert thin.solid_angle == pytest.approx(np.pi / 26, rel=1e-12)
    assert thin.solid_angle == pytest.approx(np.pi * np.sin(np.arctan(0.2)) ** 2, rel=1e-12)


def test_relative_illumination():
    """cos^4 of 31 degrees is 0.54; rims hold back the square of the distance from the axis."""
    wide = replace(
        IMAGER, width=101, height=51, focal_length_mm=20 * 50e-3 / np.tan(np.radians(31))
    )
    assert np.all(wide.illumination == 1)
    falling = replace(wide, cos4=True).illumination
    assert falling.shape == (51, 101) and falling[25, 50] == 1
    assert falling[25, 100] == pytest.approx(np.cos(np.radians(31)) ** 4, rel=1e-12)
    assert falling[25, 100] == pytest.approx(0.54, abs=1e-3)
    angle = np.arctan(np.tan(np.radians(31)) * np.hypot(50, 25) / 50)
    assert falling[[0, 0, -1, -1], [0, -1, 0, -1]] == pytest.approx(np.cos(angle) ** 4, rel=1e-12)
    held_back = replace(wide, vignetting=0.3).illumination
    corner = np.hypot(50, 25) / np.hypot(50.5, 25.5)  # the middle of its pixel
    assert held_back[0, 0] == pytest.approx(1 - 0.3 * corner**2, rel=1e-12)
    assert held_back[25, 50 + 20] == pytest.approx(1 - 0.3 * 400 / (50.5**2 + 25.5**2), rel=1e-12)
    both = replace(wide, cos4=True, vignetting=0.3).illumination
    assert both == pytest.approx(falling * held_back, rel=1e-12)


def test_emissivity_of_the_optics():
    warm = replace(IMAGER, optics_temperature=290.0)
    assert IMAGER.emissivity_of_optics(0.8) == 0
    assert warm.emissivity_of_optics(0.8) == pytest.approx(0.2)
    grey = replace(warm, optics_emissivity=0.15)
    assert grey.emissivity_of_optics(0.85) == 0.15
    with pytest.raises(InputError, match="optics_emissivity = 0.15 and optics_transmittance = 0.9"):
        grey.emissivity_of_optics(0.9)


def test_electrons_and_counts():
    assert (IMAGER.seconds, IMAGER.well) == (0.004, 3e6)
    assert IMAGER.dark == pytest.approx(2e4, rel=1e-12)
    assert IMAGER.largest_count == 4095
    assert IMAGER.pedestal == pytest.approx(63.984375, rel=1e-12)
    assert IMAGER.electrons_per_count == pytest.approx(3e6 / 4031.015625, rel=1e-12)


def test_noise():
    quantisation = (3e6 / 4031.015625) ** 2 / 12
    expected = np.sqrt(1e6 + 2e4 + 9e4 + quantisation)
    assert IMAGER.noise(1e6) == pytest.approx(expected, rel=1e-12)
    assert IMAGER.noise(-5.0) == pytest.approx(np.sqrt(1.1e5 + quantisation), rel=1e-12)


def test_defaults_are_those_of_an_ideal_camera_of_14_bits():
    ideal = Imager(
        focal_length_mm=50.0,
        f_number=2.5,
        pitch_um=20.0,
        width=200,
        height=100,
        integration_time_ms=4.0,
        well_Me=3.0,
    )
    assert ideal.pixel_area == pytest.approx(4e-10) and ideal.quantum_efficiency == 1
    assert ideal.noise(0.0) == pytest.approx(3e6 / (16383 * 63 / 64) / np.sqrt(12), rel=1e-12)
    errors = ideal.jitter_urad, ideal.defocus_um, ideal.gain_nonuniformity
    assert (*errors, ideal.offset_nonuniformity_e, ideal.right_deg, ideal.up_deg) == (0,) * 6
    assert not ideal.nuc and ideal.least_pixels == 1 and ideal.projection == "perspective"


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"width": 8192, "height": 2049, "focal_length_mm": 100}, "8192 x 2049 pixels; a frame"),
        ({"width": 0}, "width = 0; must lie in 1..8192"),
        ({"height": 8193}, "height = 8193; must lie in 1..8192"),
        ({"right_deg": 45.1}, "right_deg = 45.1; must lie in -45..45"),
        ({"up_deg": -45.1}, "up_deg = -45.1; must lie in -45..45"),
        ({"f_number": 0.49}, "f_number = 0.49; must lie in 0.5..10000"),
        ({"integration_time_ms": 1e7}, "must be positive and at most 1e"),
        ({"gain_nonuniformity": 20.0}, "gain_nonuniformity = 20; must lie in 0..10"),
        ({"lens": "fish"}, "unknown lens 'fish'; known: "),
        ({"vignetting": 1.0}, "vignetting = 1; must lie in 0..0.99"),
        ({"cos4": True, "projection": "orthographic"}, 'cos4 needs projection = "perspective"'),
        ({"optics_temperature": -3.0}, "optics_temperature = -3 K; must be positive"),
        ({"optics_emissivity": 0.2}, "optics_emissivity needs optics_temperature"),
        ({"fill_factor": 0.0}, "fill_factor = 0; must be positive and at most 1"),
        ({"width": 1, "pitch_um": 4000.0}, "the height of the frame is 152 degrees"),
        ({"width": 1, "height": 1, "pitch_um": 0.08}, "the width of the frame is 9.17e-05 deg"),
    ],
)
def test_unusable(changes, message):
    with pytest.raises(InputError, match=message.replace(".", r"\.")):
        replace(IMAGER, **changes)


def test_the_bounds_themselves_are_allowed():
    for changes in (
        {"width": 8192, "height": 2048, "focal_length_mm": 100},
        {"right_deg": 45.0, "up_deg": -45.0, "f_number": 0.5, "fill_factor": 1.0, "bits": 16},
        {"width": 100, "pitch_um": 3700.0},  # 149.7 degrees
        {"width": 1, "height": 1, "pitch_um": 0.09},  # 1.03e-4 degrees
    ):
        replace(IMAGER, **changes)


# The detector: its solid angle, its threshold, and the values that it refuses
# ----------------------------------------------------------------------------


def test_solid_angle():
    """A hemisphere has 2 pi; a narrow cone has pi (angle / 2)^2 exactly."""
    assert Detector("MWIR").solid_angle is None
    assert Detector("MWIR", field_of_view_deg=180).solid_angle == pytest.approx(
        2 * np.pi, rel=1e-14
    )
    assert Detector("MWIR", field_of_view_deg=60).solid_angle == pytest.approx(
        2 * np.pi * (1 - np.sqrt(3) / 2), rel=1e-12
    )
    assert Detector("MWIR", field_of_view_deg=1e-6).solid_angle == pytest.approx(
        np.pi * np.radians(0.5e-6) ** 2, rel=1e-12
    )


def test_threshold():
    """The thesis's weakest signal, 5.72e-4 W/m^2, requires an nei of 5.72e-5 W/m^2.

    Source: thesis 4.3.5 and Eq 3.14.

    The sign of the signal does not matter. Optics with a transmittance of 0.5 lower the nei.
    """
    detector = Detector("LWIR", nei=5.72e-5)
    assert detector.band.name == "LWIR" and detector.snr == 10
    assert detector.nei_max(5.72e-4) == pytest.approx(5.72e-5) == detector.nei_max(-5.72e-4)
    assert detector.detects(np.array([5.73e-4, 5.71e-4, -5.73e-4])).tolist() == [True, False, True]
    behind = Detector("LWIR", optics_transmittance=0.5, nei=5.72e-5, snr=5)
    assert behind.signal(-4.0) == -2 and behind.nei_max(5.72e-4) == pytest.approx(5.72e-5)
    assert behind.detects(5.73e-4) and not behind.detects(5.71e-4)
    assert Detector("LWIR", nei=1.0, snr=1).detects(-1.0)
    with pytest.raises(InputError, match="nei is missing"):
        Detector("LWIR").detects(1.0)


@pytest.mark.parametrize(
    "name, value, message",
    [
        ("optics_transmittance", 0, "at most 1"),
        ("optics_transmittance", 1.01, "at most 1"),
        ("field_of_view_deg", 181, "at most 180"),
        ("field_of_view_deg", 0, "positive"),
        ("nei", 0, "positive and at most 10000"),
        ("nei", np.inf, "at most 10000"),
        ("nei", 10001, "positive and at most 10000"),
        ("snr", -1, "positive"),
        ("snr", np.nan, "positive"),
    ],
)
def test_unusable_of_detector(name, value, message):
    with pytest.raises(InputError, match=f"sensor: {name} = {value}.*; must be .*{message}"):
        Detector("MWIR", **{name: value})


def test_unusable_band():
    with pytest.raises(InputError, match="unknown band 'MWR'; known: MWIR"):
        Detector("MWR")
