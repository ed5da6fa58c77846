"""Surfaces whose emissivity is known by wavelength and angle."""

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.spectra.files import by_angle
from mi_lcair.physics.spectra.parameters import spectral_parameters
from tests.plugins.bins.test_by_bin import X, planck, plate, radiance, room, thermal
from tests.plugins.small_scenes import blackbody

ANGLES = np.linspace(0, 90, 10)
FINE = np.linspace(3, 5, 20001)
VALUES = (0.55 + 0.3 * np.sin(2 * X))[:, None] * (1 - 0.6 * np.sin(np.radians(ANGLES)) ** 4)


def write(folder, values=VALUES) -> str:
    rows = "".join(
        f"{x:.9g},{angle:g},{value:.9g}\n"
        for x, row in zip(X, values)
        for angle, value in zip(ANGLES, row)
    )
    (folder / "d.csv").write_text("wavelength_um,theta_deg,emissivity\n" + rows)
    (folder / "own.toml").write_text('[d.spectral]\nemissivity = "d.csv"\n')
    return str(folder / "own.toml")


def emissivity(theta_deg: float) -> np.ndarray:
    of_angle = [np.interp(theta_deg, ANGLES, row) for row in VALUES]
    return np.interp(FINE, X, of_angle)


def in_band(factor, T: float) -> float:
    weight = planck(FINE, T)
    return blackbody(T, "MWIR") * np.trapezoid(weight * factor, FINE) / np.trapezoid(weight, FINE)


@pytest.mark.parametrize("theta_deg", [0.0, 65.0])
def test_emission_and_reflection(tmp_path, theta_deg):
    """epsilon(theta) L(T) + (1 - epsilon(theta)) L(T_0) in a room of blackbodies."""
    shell = {
        "type": "sphere",
        "radius": 40.0,
        "flip_normals": True,
        "bsdf": {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}},
        "emitter": thermal(350.0, group="shell"),
    }
    loaded = plate(write(tmp_path), "d", 500.0, theta_deg=theta_deg, bounces=1, shell=shell)
    loaded.mi.integrator().bins = 128
    L, error = radiance(loaded, 4096)
    own = emissivity(theta_deg)
    assert abs(L - in_band(own, 500.0) - in_band(1 - own, 350.0)) < 1e-4 * L + 3 * error
    assert error < 1e-3 * L


def test_sun_is_reflected_by_both_angles(tmp_path):
    """f = rho(theta_i) rho(theta_r) / (pi m) at each wavelength."""
    sun = {"type": "sun", "azimuth_deg": 90.0, "elevation_deg": 25.0, "band": "MWIR", "air": "none"}
    file, values = write(tmp_path), []
    for light in ({}, {"sun": sun}):
        loaded = plate(file, "d", 50.0, theta_deg=50.0, bounces=1, **light)
        loaded.mi.integrator().bins = 128
        values.append(radiance(loaded, 256)[0])
    (emitter,) = (e for e in loaded.mi.emitters() if e.group == "sun")
    cos = np.linspace(0, 1, 2001)
    rho = 1 - np.stack([emissivity(np.degrees(np.arccos(c))) for c in cos[::20]])
    mean = 2 * np.trapezoid(rho * cos[::20, None], cos[::20], axis=0)
    f = (1 - emissivity(65.0)) * (1 - emissivity(50.0)) / (np.pi * mean)
    spectrum = emitter.spectra()[0].spectrum.at(FINE) * emitter.solid_angle
    expected = np.trapezoid(spectrum * f, FINE) * np.sin(np.radians(25.0))
    assert values[1] - values[0] == pytest.approx(expected, rel=1e-3)


@pytest.mark.slow
def test_closed_room(tmp_path):
    L, error = radiance(room(write(tmp_path), "dd", 400.0, False), 16384, 3)
    assert abs(L - blackbody(400, "MWIR")) < 3.5 * error + 1e-5 * L
    assert error < 1e-3 * L


def test_the_row_is_that_of_the_hemisphere(tmp_path):
    write(tmp_path)
    spectrum = spectral_parameters("own", {"emissivity": "d.csv"}, tmp_path)
    sin2 = np.linspace(0, 1, 20001)
    of_angle = np.interp(np.degrees(np.arcsin(np.sqrt(sin2))), ANGLES, VALUES[7])
    assert spectrum.rows["emissivity"][7] == pytest.approx(np.trapezoid(of_angle, sin2), rel=1e-5)
    assert spectrum.at(X)["emissivity"] == pytest.approx(spectrum.rows["emissivity"], rel=1e-9)
    assert spectrum.emitted_at(X, np.cos(np.radians([0.0, 25.0, 90.0]))) == pytest.approx(
        np.stack([VALUES[:, 0], (VALUES[:, 2] + VALUES[:, 3]) / 2, VALUES[:, -1]], axis=1)
    )


@pytest.mark.parametrize(
    "text,says",
    [
        ("3,0,0.5\n4,0,0.5\n4,30,0.4\n", "must have the same wavelengths"),
        ("3,0,0.5\n3,0,0.5\n4,0,0.5\n", "must be rising"),
        ("3,0,0.5\n4,0,1.5\n", "emissivity"),
        ("3,0,0.5\n3,30,0.5\n", "two rows or more"),
        ("3,0,0.5\n4,95,0.5\n", "theta_deg"),
    ],
)
def test_bad_tables(tmp_path, text, says):
    (tmp_path / "bad.csv").write_text("wavelength_um,theta_deg,emissivity\n" + text)
    with pytest.raises(InputError, match=says):
        by_angle(tmp_path / "bad.csv")
    (tmp_path / "plain.csv").write_text("wavelength_um,emissivity\n3,0.5\n4,0.6\n")
    assert by_angle(tmp_path / "plain.csv") is None
