"""Intensities whose sources cannot be told apart."""

import mitsuba as mi
import pytest

import mi_lcair
from mi_lcair.rendering.parameters.values import set_values
from tests.uncertainty.plate_scene import (
    TEMPERATURE,
    plate_scene,
    row,
)

mi.set_variant("llvm_ad_mono")


def test_a_scene_whose_sources_have_no_spectra(tmp_path):
    """In the band `total` everything is rendered: dI/dT = 4 I / T."""
    found = mi_lcair.budget(
        plate_scene(tmp_path, band="total"), {"sigma": {"plate.temperature": 3}}
    )
    contribution = row(found, "plate.temperature").contribution
    assert contribution == pytest.approx(4 * found.value / TEMPERATURE * 3, rel=1e-3)
    (check,) = found.checks
    assert check.holds and check.plus == pytest.approx(contribution, rel=0.05)


SKIES = {
    "night": {"sky": "clear", "ground_temperature": 290.0, "ground_emissivity": 0.8},
    "high": {"sky": "clear", "ground_temperature": 290.0, "height_m": 2000.0},
    "even": {"sky": "260", "ground_temperature": 290.0, "ground_emissivity": 0.8},
}


@pytest.mark.slow
@pytest.mark.parametrize("words", SKIES.values(), ids=SKIES)
def test_sky_and_ground_in_a_budget(words):
    """Contributions are differences of intensities at other values, from the same paths."""
    grey = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.5}}
    emitter = {"type": "thermal", "band": "MWIR", "temperature": 250.0, "group": "plate"}
    up = mi.ScalarTransform4f().rotate([0, 1, 0], 90)
    plate = {"type": "rectangle", "to_world": up, "bsdf": grey, "emitter": emitter}
    look = mi.ScalarTransform4f().look_at(origin=[20, 0, 0], target=[0, 0, 0], up=[0, 0, 1])
    film = {"type": "hdrfilm", "width": 8, "height": 8, "pixel_format": "luminance"}
    parts = {
        "type": "scene",
        "integrator": {"type": "bounce_path", "max_bounces": 1, "emitter_sampling": True},
        "sensor": {"type": "orthographic", "to_world": look, "film": film},
        "plate": plate,
        "sky": {"type": "sky", "band": "MWIR", **words},
    }
    scene = mi_lcair.load(mi.load_dict(parts, optimize=False))
    sigma = {"ground.temperature": 2.0, "ground.emissivity": 0.02}
    sigma |= {"sky.temperature": 2.0} if words["sky"] == "260" else {"sky.scale": 0.05}
    found = mi_lcair.budget(scene, {"sigma": sigma}, spp=1024, seed=3)
    for name, step in sigma.items():
        value, results = mi_lcair.parameters(scene)[name].value, []
        ends = (value - step, value + step if name != "ground.emissivity" else value)
        for end in ends:
            set_values(scene, {name: end})
            results.append(mi_lcair.signature(scene, spp=1024, seed=3).target.intensity)
        set_values(scene, {name: value})
        slope = (results[1] - results[0]) / (ends[1] - ends[0])
        assert row(found, name).contribution == pytest.approx(slope * step, rel=0.02)
