"""The bundled scenes rendered, against their exact answers.

Standard errors come from the render itself; "inside 3 standard errors" has a significance of 0.27 %
per comparison, and seeds are fixed.
"""

import json

import numpy as np
import pytest

import mi_lcair
from benchmarks.methods.propagation import exact
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance


def radiance(name, temperature):
    return float(in_band_radiance(band(name), temperature))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["total", "MWIR", "LWIR"])
def test_two_plates(name):
    """Within 0.2 % and 3 standard errors of L_bb A F (thesis A.1), after one reflection."""
    result = mi_lcair.signature(
        mi_lcair.load("two_plates", band=name, resolution=64), spp=512, seed=1
    )
    expected = exact.two_plates_intensity(radiance(name, 800))
    assert result.intensity == pytest.approx(expected, rel=2e-3)
    assert abs(result.intensity - expected) < 3 * result.standard_error
    assert result.target.by_bounce[0] == 0
    assert result.target.by_group["plate"] == pytest.approx(result.intensity, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("sampling", ["true", "false"])
def test_open_box(sampling):
    """Reflection and the floor's own emission together (thesis A.2), with emitter sampling on and
    off.
    """
    scene = mi_lcair.load("open_box", resolution=64, emitter_sampling=sampling)
    result = mi_lcair.signature(scene, spp=512, seed=2)
    expected = exact.open_box_intensity(radiance("total", 800), radiance("total", 300))
    assert abs(result.intensity - expected) < 3 * result.standard_error
    assert result.intensity == pytest.approx(expected, rel=2e-3)
    emitted = exact.open_box_intensity(0, radiance("total", 300))
    assert result.target.by_bounce[0] == pytest.approx(emitted, rel=2e-4)


@pytest.mark.slow
@pytest.mark.parametrize("opening", list(exact.CAVITY_BLOCKS))
def test_cavity(opening):
    """After N = 0..4 reflections and in the limit, one render per opening, within 0.15 % of the
    sphere's formula.
    """
    scene = mi_lcair.load("cavity", opening=opening, resolution=32)
    result = mi_lcair.signature(scene, spp=128, seed=3)
    measured = np.array(result.scene.up_to_bounce) / result.window_area / radiance("total", 800)
    for bounces in range(5):
        assert measured[bounces] == pytest.approx(
            exact.cavity_emissivity(opening, bounces), rel=1.5e-3
        ), f"N = {bounces}"
    assert measured[-1] == pytest.approx(exact.cavity_emissivity(opening), rel=1.5e-3)


METAL = {"alpha": 0.1, "gamma": 2, "n": 10, "k": 30, "rho_d": 0}


@pytest.fixture
def metal(tmp_path):
    """A fit's JSON file of a rough microfacet metal."""
    path = tmp_path / "metal.json"
    entry = {"model": "microfacet", "parameters": METAL, "form": "standard", "band": "MWIR"}
    path.write_text(json.dumps(entry))
    return str(path)


@pytest.mark.slow
@pytest.mark.parametrize(
    "material, name, resolution, spp",
    [
        ("bare_aluminum", "MWIR", 24, 256),
        ("bare_aluminum", "LWIR", 24, 256),
        ("gloss_black", "MWIR", 24, 256),
        ("gloss_black", "LWIR", 24, 256),
        ("rough_paint", "MWIR", 8, 4096),
        ("sandblasted_steel", "MWIR", 8, 4096),
        ("metal", "MWIR", 8, 4096),
    ],
)
def test_furnace(material, name, resolution, spp, metal):
    """Every pixel within 0.2 % or 10 standard errors of the blackbody, the mean within 0.02 %,
    whatever the material. Student's t with 3 degrees of freedom exceeds 10 once in 500 pixels.

    Of a broad lobe one sample in a hundred falls below the horizon and brings nothing. Only the
    mean of thousands of samples is then normally distributed.
    """
    material = metal if material == "metal" else material
    result = mi_lcair.render(
        mi_lcair.load("furnace", material=material, band=name, resolution=resolution),
        spp=spp,
        seed=4,
        parts=True,
    )
    expected = radiance(name, 300)
    allowed = np.maximum(2e-3 * expected, 10 * result.channels["stderr.Y"])
    assert np.all(np.abs(result.channels["Y"] - expected) <= allowed)
    assert result.mean == pytest.approx(expected, rel=2e-4)
    assert min(result.channels["bounce00.Y"].min(), result.channels["Y"].min()) >= 0


@pytest.mark.slow
@pytest.mark.parametrize("lobe", ["mirror", "diffuse"])
@pytest.mark.parametrize("material", ["bare_aluminum", "smooth_paint", "metal"])
def test_furnace_of_lower_rungs(material, lobe, metal):
    """The isothermal answer holds on every rung of the fidelity ladder."""
    material = metal if material == "metal" else material
    scene = mi_lcair.load("furnace", material=material, lobe=lobe, resolution=16)
    result = mi_lcair.render(scene, spp=128, seed=5)
    assert result.mean == pytest.approx(radiance("MWIR", 300), rel=2e-4)


@pytest.mark.slow
def test_furnace_temperature():
    result = mi_lcair.render(mi_lcair.load("furnace", temperature=800, resolution=16), spp=64)
    assert result.mean == pytest.approx(radiance("MWIR", 800), rel=1e-3)
    assert result.channels["temperature.Y"].mean() == pytest.approx(800, abs=0.2)
