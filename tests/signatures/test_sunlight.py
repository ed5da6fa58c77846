"""Signatures in sunlight: the sun is a source of its own, in recorded launches too."""

import numpy as np
import pytest

from mi_lcair import scenes
from mi_lcair.physics.bands import band
from mi_lcair.physics.sunlight import sunlight
from mi_lcair.rendering.scene import load
from mi_lcair.signatures.signature import signature
from mi_lcair.signatures.trend import trend
from tests.plugins.paths.test_recording import check

E = sunlight().in_band_irradiance(band("MWIR"))
SUN = """<emitter type="sun" id="sun">
    <float name="elevation_deg" value="{elevation}"/> <float name="azimuth_deg" value="{azimuth}"/>
    <string name="band" value="MWIR"/> <string name="air" value="{air}"/>
</emitter>"""


@pytest.fixture
def sunlit(tmp_path):
    """sunlit(name, elevation, azimuth, air, ...): a bundled scene with a sun."""

    def make(name, elevation=60, azimuth=30, air="none", **parameters):
        text = scenes.path(name).read_text(encoding="utf-8")
        head, rest = text.split("\n", 1)
        sun = SUN.format(elevation=elevation, azimuth=azimuth, air=air)
        file = tmp_path / f"{name}.xml"
        file.write_text(f'{head}\n<path value="{scenes.FOLDER}"/>\n{sun}\n{rest}', encoding="utf-8")
        return load(file, band="MWIR", **parameters)

    return make


def test_the_sun_is_told_apart(sunlit):
    """A white plate of 0.02 m^2 in sunlight, beside a hot one that does not shade it."""
    scene = sunlit("two_plates", emitter_sampling="false")
    dark = load("two_plates", band="MWIR")
    found = signature(scene, spp=2**4, by_spectrum=True)
    expected = 0.02 * E * np.sin(np.radians(60)) / np.pi
    assert found.by_group["sun"] == pytest.approx(expected, rel=2e-3)
    areas = found.effective_areas
    source = next(source for source in areas.sources if source.group == "sun")
    area = areas.area[1, areas.sources.index(source)]
    assert area * source.in_band == pytest.approx(expected, rel=2e-3)
    assert found.by_group["plate"] == pytest.approx(
        signature(dark, spp=2**4).by_group["plate"], rel=0.02
    )


@pytest.mark.parametrize(
    "name, emitter_sampling", [("two_plates", "true"), ("a340_landing", "false")]
)
def test_recorded_launches(sunlit, name, emitter_sampling):
    scene = sunlit(name, air="us_standard", emitter_sampling=emitter_sampling)
    found = [check(scene, seed)[0] for seed in (1, 2)]
    check(scene, split="image", by_spectrum=True)
    assert not np.array_equal(*found)


def test_trend(sunlit):
    """The intensity of a plate in sunlight from two sides: only its front is lit."""
    scene = sunlit("two_plates", emitter_sampling="false")
    found = trend(scene, [90.0], [90.0, 30.0], resolution=32, spp=16)
    expected = 0.02 * E * np.sin(np.radians(60)) / np.pi * np.array([1, 0.5])
    np.testing.assert_allclose(found.parts("group")["sun"], expected, rtol=0.02)
