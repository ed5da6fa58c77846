"""Renders of the bundled scenes against their exact answers.

Standard errors come from the renders. A deviation of more than 3 standard errors has a probability
of 0.27 % per comparison. Seeds are fixed.
"""

import numpy as np
import pytest

import mi_lcair
from mi_lcair.benchmark.propagation import exact
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance


def radiance(name, temperature):
    return float(in_band_radiance(band(name), temperature))


@pytest.mark.parametrize("name", ["total", "MWIR", "LWIR"])
def test_two_plates(name):
    """The intensity is L_bb A F (thesis A.1) within 0.2 % and 3 standard errors.

    All of it comes after one reflection.
    """
    result = mi_lcair.signature(
        mi_lcair.load("two_plates", band=name, resolution=64), spp=4096, seed=1
    )
    expected = exact.two_plates_intensity(radiance(name, 800))
    assert result.intensity == pytest.approx(expected, rel=2e-3)
    assert abs(result.intensity - expected) < 3 * result.standard_error
    assert result.by_bounce[0] == 0
    assert result.by_group["plate"] == pytest.approx(result.intensity, rel=1e-6)


@pytest.mark.parametrize("sampling", ["true", "false"])
def test_open_box(sampling):
    """The intensity is the sum of reflection and emission of the floor (thesis A.2).

    This holds with and without emitter sampling.
    """
    scene = mi_lcair.load("open_box", resolution=64, emitter_sampling=sampling)
    result = mi_lcair.signature(scene, spp=4096, seed=2)
    expected = exact.open_box_intensity(radiance("total", 800), radiance("total", 300))
    assert abs(result.intensity - expected) < 3 * result.standard_error
    assert result.intensity == pytest.approx(expected, rel=2e-3)
    emitted = exact.open_box_intensity(0, radiance("total", 300))
    assert result.by_bounce[0] == pytest.approx(emitted, rel=2e-4)


@pytest.mark.parametrize("opening", list(exact.CAVITY_BLOCKS))
def test_cavity(opening):
    """After N = 0..4 reflections and in the limit the radiance is within 0.15 % of the formula.

    There is one render per opening.
    """
    scene = mi_lcair.load("cavity", opening=opening, resolution=32)
    result = mi_lcair.render(scene, spp=512, seed=3)
    measured = np.cumsum(result.by_bounce) / radiance("total", 800)
    for bounces in range(5):
        assert measured[bounces] == pytest.approx(
            exact.cavity_emissivity(opening, bounces), rel=1.5e-3
        ), f"N = {bounces}"
    assert measured[-1] == pytest.approx(exact.cavity_emissivity(opening), rel=1.5e-3)


@pytest.mark.parametrize("name", ["MWIR", "LWIR"])
@pytest.mark.parametrize("material", ["bare_aluminum", "gloss_black"])
def test_furnace(material, name):
    """The image shows a blackbody for every material.

    Every pixel is within 0.2 % or 4 standard errors of the blackbody's radiance, the mean within
    0.02 %.
    """
    result = mi_lcair.render(
        mi_lcair.load("furnace", material=material, band=name, resolution=48), spp=256, seed=4
    )
    expected = radiance(name, 300)
    allowed = np.maximum(2e-3 * expected, 4 * result.channels["stderr.Y"])
    assert np.all(np.abs(result.channels["Y"] - expected) <= allowed)
    assert result.mean == pytest.approx(expected, rel=2e-4)
    assert min(result.channels["bounce00.Y"].min(), result.channels["Y"].min()) >= 0


@pytest.mark.parametrize("lobe", ["mirror", "diffuse"])
def test_furnace_of_lower_rungs(lobe):
    """The isothermal answer holds for the simpler reflection models, mirror and diffuse, too."""
    result = mi_lcair.render(mi_lcair.load("furnace", lobe=lobe, resolution=32), spp=128, seed=5)
    assert result.mean == pytest.approx(radiance("MWIR", 300), rel=2e-4)


def test_furnace_temperature():
    result = mi_lcair.render(mi_lcair.load("furnace", temperature=800, resolution=16), spp=64)
    assert result.mean == pytest.approx(radiance("MWIR", 800), rel=1e-3)
    assert result.channels["temperature.Y"].mean() == pytest.approx(800, abs=0.2)
