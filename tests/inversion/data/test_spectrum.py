"""Temperature and emissivity from a spectrum."""

import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from tests.inversion.spectral_plate import (
    FIRST_GUESS,
    NODES,
    X,
    problem,
    spectrum,
    write_material,
    write_scene,
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("spectrum")
    write_material(folder, "true", 0.85 + 0.08 * np.sin(1.2 * (X - 8)))
    write_scene(folder)
    return folder


@pytest.mark.slow
def test_temperature_and_emissivity(folder):
    path = str(folder / "plate.xml")
    x, radiance = spectrum(path, 12, T=310.0, file="true.toml")
    found = mi_lcair.invert(problem(folder, path, x, radiance, 2), advise=False)
    assert found.converged
    temperature, *nodes = found.answers
    assert temperature.standard_error < 2 and temperature.lower < 310 < temperature.upper
    truth = 0.05 + 0.08 * np.sin(1.2 * (NODES - 8))
    assert FIRST_GUESS == 0.8 and [node.label for node in nodes][1] == "paint.at_8500nm"
    errors = [(a.value - value) / a.standard_error for a, value in zip(nodes, truth)]
    assert np.abs(errors).max() < 4


@pytest.mark.slow
def test_what_an_even_sky_cannot_separate_is_named(folder):
    """Under a black sky emissivity and temperature trade; structure of the sky separates them."""
    path = str(folder / "plate.xml")
    x, radiance = spectrum(path, 12, T=310.0, file="true.toml", S="250")
    found = mi_lcair.invert(
        problem(folder, path, x, radiance, 1, "250", 5e-3)
        | {"render": {"spp": 64, "iterations": 4}},
        advise=False,
    )
    assert not found.answers[0].is_determined
    assert any("`plate.temperature` and `paint.at_" in pair.words for pair in found.directions)


def test_bad_spectra(folder):
    path = str(folder / "plate.xml")
    x = np.linspace(8, 12, 5)
    for wavelengths, says in ((x + 0.2, "even over the scene's band 8-12 um"), (x[:2], "three")):
        tree = problem(folder, path, wavelengths, 0 * wavelengths + 8.0, 0)
        with pytest.raises(InputError, match=says):
            mi_lcair.invert(tree)
    tree = problem(folder, path, x, 0 * x + 8.0, 0)
    tree["unknowns"] = {"paint.emissivity": {}}
    with pytest.raises(InputError, match="paint.spectrum"):
        mi_lcair.invert(tree)
    tree["unknowns"] = {"plate.temperature": {"correlation_um": 1.0}}
    with pytest.raises(InputError, match="of spectra"):
        mi_lcair.invert(tree)
