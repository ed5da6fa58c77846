"""Plumes whose transmittance depends on wavelength, against Beer-Lambert's law."""

from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.parameters.values import changed
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.window import Windows
from tests.plugins.bins.test_by_bin import SPECTRA, X, planck, plate, radiance, thermal, write
from tests.plugins.small_scenes import blackbody

FINE = np.linspace(3, 5, 20001)
KAPPA = 0.5 + 0.45 * np.sin(3 * X)  # absorption coefficient [1/m]


def file_of(folder, length, name="plume"):
    """The transmittance of a layer of this length [m]; the path of its file."""
    rows = [f"{x:.9g},{tau:.12g}" for x, tau in zip(X, np.exp(-KAPPA * length))]
    path = folder / f"{name}.csv"
    path.write_text("\n".join(["wavelength_um,transmittance", *rows]))
    return str(path)


def sphere(file, radius, temperature, **more):
    return {
        "type": "sphere",
        "radius": radius,
        "bsdf": {"type": "plume", "id": f"of_{Path(file).stem}", "spectrum": file, "band": "MWIR"},
        "emitter": thermal(temperature, group="plume"),
        **more,
    }


def mean(spectrum_and_temperature):
    """In-band radiance [W m^-2 sr^-1] of factors of blackbodies' spectra, at the wavelengths FINE.

    Rows of spectra are straight lines, and not their products: each is interpolated before.
    """
    total = 0.0
    for factor, T in spectrum_and_temperature:
        weight = planck(FINE, T)
        share = np.trapezoid(weight * factor, FINE) / np.trapezoid(weight, FINE)
        total += share * blackbody(T, "MWIR")
    return total


def passing(length):
    return np.interp(FINE, X, np.exp(-KAPPA * length))


@pytest.mark.parametrize("sampling", [False, True])
def test_plume_before_a_plate(tmp_path, sampling):
    """A line of sight crosses two shells of a plume; groups get their parts of the radiance."""
    file, tau = write(tmp_path, {"g": SPECTRA["g"]}), passing(0.7)
    hot = sphere(file_of(tmp_path, 0.7), 1.0, 900.0, center=[0, 0, 3])
    loaded = plate(file, "g", 400.0, plume=hot)
    loaded.mi.integrator().bins, loaded.mi.integrator().emitter_sampling = 128, sampling
    emissivity = np.interp(FINE, X, SPECTRA["g"][0])
    of_plate, of_plume = mean([(tau**2 * emissivity, 400.0)]), mean([(1 - tau**2, 900.0)])
    result = mi_lcair.signature(loaded, spp=16)
    groups = {name: e / result.window_area for name, e in result.scene.by_group.items()}
    assert groups == pytest.approx({"plate": of_plate, "plume": of_plume}, rel=1e-4)
    assert result.scene.intensity / result.window_area == pytest.approx(
        of_plate + of_plume, rel=1e-4
    )


def test_derivatives(tmp_path):
    """Two crossings before a plate: L = tau^2 eps B_plate + (1 - tau^2) B_plume, tau = 1 - s e."""
    file, tau = write(tmp_path, {"g": SPECTRA["g"]}), passing(0.7)
    hot = sphere(file_of(tmp_path, 0.7), 1.0, 900.0, center=[0, 0, 3])
    loaded = plate(file, "g", 400.0, plume=hot)
    loaded.mi.integrator().bins = 128
    emissivity, scale = np.interp(FINE, X, SPECTRA["g"][0]), 0.9
    passed, rates = 1 - scale * (1 - tau), {"scale": tau - 1, "offset": -1, "slope": 4 - FINE}
    names = [f"of_plume.{name}" for name in rates]
    with changed(loaded, {"of_plume.scale": scale}):
        result = mi_lcair.sensitivities(loaded, names, spp=16)
    value = mean([(passed**2 * emissivity, 400.0), (1 - passed**2, 900.0)])
    expected = [
        mean([(2 * passed * rate * emissivity, 400.0), (-2 * passed * rate, 900.0)])
        for rate in rates.values()
    ]
    area = mi_lcair.signature(loaded, spp=4).window_area
    assert result.value / area == pytest.approx(value, rel=1e-4)
    assert result.derivative / area == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("sampling", [False, True])
def test_light_that_a_plate_reflects_has_passed_plumes(tmp_path, sampling):
    """Two plumes enclose the plate and the observer, and a warm shell encloses the plumes."""
    file = write(tmp_path, {"g": SPECTRA["g"]})
    taus = passing(0.3), passing(1.1)
    shells = {
        "inner": sphere(file_of(tmp_path, 0.3, "inner"), 30.0, 500.0),
        "outer": sphere(file_of(tmp_path, 1.1, "outer"), 40.0, 700.0),
        "shell": {
            "type": "sphere",
            "radius": 50.0,
            "flip_normals": True,
            "bsdf": {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}},
            "emitter": thermal(600.0, group="shell"),
        },
    }
    loaded = plate(file, "g", 400.0, bounces=1, **shells)
    loaded.mi.integrator().bins, loaded.mi.integrator().emitter_sampling = 128, sampling
    emissivity = np.interp(FINE, X, SPECTRA["g"][0])
    reflected = 1 - emissivity
    expected = mean(
        [
            (emissivity, 400.0),
            (reflected * (1 - taus[0]), 500.0),
            (reflected * taus[0] * (1 - taus[1]), 700.0),
            (reflected * taus[0] * taus[1], 600.0),
        ]
    )
    L, error = radiance(loaded, 16384 if sampling else 64)
    assert abs(L - expected) < 1e-4 * L + 3 * error * sampling
    assert error < 2e-3 * L


def test_the_spectrum_of_a_pixel(tmp_path):
    plume = sphere(file_of(tmp_path, 1), 1.0, 900.0, center=[0, 0, 3])
    loaded = plate("", {"type": "diffuse"}, 400.0, plume=plume)
    windows = Windows.whole(loaded.sensor(0))
    total = measure(loaded, windows, Sampling(paths=64), Measurands.of(None, bins=21))
    got = np.array([total.mean(f"bin.{k}")[0] for k in range(21)])
    nodes, tau = np.linspace(3, 5, 21), passing(1.0)
    hats = np.maximum(1 - abs(FINE[:, None] - nodes) / 0.1, 0)
    of_plate = planck(FINE, 400.0) * blackbody(400, "MWIR") / np.trapezoid(planck(FINE, 400), FINE)
    of_plume = planck(FINE, 900.0) * blackbody(900, "MWIR") / np.trapezoid(planck(FINE, 900), FINE)
    exact = tau**2 * 0.5 * of_plate + (1 - tau**2) * of_plume
    assert got == pytest.approx(exact @ hats / hats.sum(axis=0), rel=5e-3)


@pytest.mark.parametrize("what", [{}, {"transmittance": 0.5}])
def test_bad_plumes(tmp_path, what):
    if what:
        what["spectrum"] = file_of(tmp_path, 1)
    with pytest.raises((InputError, RuntimeError), match="transmittance.*spectrum"):
        mi.load_dict({"type": "plume", **what})


def test_spectra_that_do_not_fit(tmp_path):
    file = file_of(tmp_path, 1)
    with pytest.raises((InputError, RuntimeError), match="spectrum needs band"):
        mi.load_dict({"type": "plume", "spectrum": file})
    with pytest.raises((InputError, RuntimeError), match="does not cover band LWIR"):
        mi.load_dict({"type": "plume", "spectrum": file, "band": "LWIR"})
