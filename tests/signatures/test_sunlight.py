"""Signatures in sunlight: the sun is a source of its own, in recorded launches too."""

import numpy as np
import pytest

from mi_lcair import scenes
from mi_lcair.api.estimates import sensitivities
from mi_lcair.api.intensities import signature
from mi_lcair.api.scenes import parameters
from mi_lcair.api.sweeps import trend
from mi_lcair.physics.bands import band
from mi_lcair.physics.sun import sunlight
from mi_lcair.rendering.parameters.values import set_values
from mi_lcair.rendering.scene import load
from tests.plugins.paths.test_path_tracer import check

E = sunlight().in_band_radiance(band("MWIR"))
SUN = """<emitter type="sun" id="sun">
    <float name="elevation_deg" value="{elevation}"/> <float name="azimuth_deg" value="{azimuth}"/>
    <string name="band" value="MWIR"/> <string name="air" value="{air}"/>
</emitter>"""

DOME = """<emitter type="sky" id="dome">
    <string name="band" value="MWIR"/> <string name="atmosphere" value="midlat_summer"/>
    <float name="sun_azimuth_deg" value="30"/> <float name="sun_elevation_deg" value="45"/>
</emitter>"""


@pytest.fixture
def sunlit(tmp_path):
    """sunlit(name, elevation, azimuth, air, more, ...): a bundled scene with a sun.

    more: further elements of the scene.
    """

    def make(name, elevation=60, azimuth=30, air="none", more="", **parameters):
        text = scenes.path(name).read_text(encoding="utf-8")
        head, rest = text.split("\n", 1)
        sun = SUN.format(elevation=elevation, azimuth=azimuth, air=air)
        file = tmp_path / f"{name}.xml"
        file.write_text(
            f'{head}\n<path value="{scenes.FOLDER}"/>\n{sun}{more}\n{rest}', encoding="utf-8"
        )
        return load(file, band="MWIR", **parameters)

    return make


def test_the_sun_is_told_apart(sunlit):
    """A white plate of 0.02 m^2 in sunlight, beside a hot one that does not shade it."""
    scene = sunlit("two_plates", emitter_sampling="false")
    dark = load("two_plates", band="MWIR")
    found = signature(scene, spp=2**4, by_spectrum=True)
    expected = 0.02 * E * np.sin(np.radians(60)) / np.pi
    assert found.scene.by_group["sun"] == pytest.approx(expected, rel=2e-3)
    areas = found.effective_areas
    source = next(source for source in areas.sources if source.group == "sun")
    area = areas.area[1, areas.sources.index(source)]
    assert area * source.in_band == pytest.approx(expected, rel=2e-3)
    assert found.scene.by_group["plate"] == pytest.approx(
        signature(dark, spp=2**4).scene.by_group["plate"], rel=0.02
    )


@pytest.mark.parametrize(
    "name, emitter_sampling, more",
    [("two_plates", "true", DOME), ("a340_landing", "false", "")],
)
def test_recorded_launches(sunlit, name, emitter_sampling, more):
    scene = sunlit(name, 45, air="us_standard", more=more, emitter_sampling=emitter_sampling)
    found = [check(scene, seed)[0] for seed in (1, 2)]
    check(scene, split="image", by_spectrum=True)
    assert not np.array_equal(*found)


def test_trend(sunlit):
    """The intensity of a plate in sunlight from two sides: only its front is lit."""
    scene = sunlit("two_plates", emitter_sampling="false")
    found = trend(scene, [90.0], [90.0, 30.0], resolution=32, spp=16)
    expected = 0.02 * E * np.sin(np.radians(60)) / np.pi * np.array([1, 0.5])
    np.testing.assert_allclose(found.parts("group")["sun"], expected, rtol=0.02)


def test_derivatives(sunlit):
    """The intensity is linear in each source and in the emissivity of a plate."""
    scene = sunlit("two_plates", 45, more=DOME, emitter_sampling="false")
    set_values(scene, {"diffuse.emissivity": 0.5})
    values = parameters(scene)
    assert (values["sun.irradiance"].unit, values["sky.scale"].value) == ("W m^-2", 1.0)
    assert values["sun.irradiance"].value == pytest.approx(E)
    names = ["sun.irradiance", "sky.scale", "diffuse.emissivity"]
    found = sensitivities(scene, names, spp=2**4, seed=3)
    here = signature(scene, spp=2**4, seed=3).target
    set_values(scene, {"diffuse.emissivity": 0.3})
    there = signature(scene, spp=2**4, seed=3).target
    slope = (here.intensity - there.intensity) / 0.2
    expected = [here.by_group["sun"] / E, here.by_group["sky"], slope]
    np.testing.assert_allclose(found.derivative, expected, rtol=0.02)
