"""Electrons of a camera, against closed forms and published numbers."""

import numpy as np
import pytest
from scipy.integrate import quad

from mi_lcair.camera.electronics.frames import signal_of
from mi_lcair.camera.electronics.response import (
    apparent_temperature,
    electron_band,
    electrons,
    electrons_per_kelvin,
    in_kelvin,
)
from mi_lcair.camera.measures import measured_netd, netd, shot_noise_netd, uniform_frames
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import BOLTZMANN, LIGHT_SPEED, PLANCK
from mi_lcair.physics.imager import Imager

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
        ("f_number", 0.3, "f_number = 0.3; must be 0.5 or more"),
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
