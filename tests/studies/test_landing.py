"""The page of the landing airliner.

Results that are derived without a render agree with renders. Every field of the text is filled.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import mi_lcair
from docs.studies import landing
from mi_lcair.physics.blackbody import spectral_radiance
from mi_lcair.scenes.build import airliner

FEW = {"render.resolution": 48, "render.spp": 32, "render.max_bounces": 3}


@pytest.fixture(scope="module")
def base():
    return mi_lcair.contrast(landing.scenario(3, "LWIR", **FEW))


@pytest.mark.slow
@pytest.mark.parametrize(
    "change, rendered",
    [
        (landing.under("midlat_summer_clear"), {"target.parameters.sky": "midlat_summer_clear"}),
        (landing.through("us_standard"), {"atmosphere.table": "us_standard"}),
    ],
)
def test_changes_that_are_not_rendered(base, change, rendered):
    """Another sky and another atmosphere give the same result from effective areas and by a render.

    The render has the same paths.
    """
    anew = mi_lcair.contrast(landing.scenario(3, "LWIR", **FEW, **rendered)).rows[-1].total.value
    derived = landing.from_areas(base, change)
    assert derived == pytest.approx(anew, rel=1e-3)
    assert abs(derived / base.rows[-1].total.value - 1) > 0.05


def test_heat_follows_effective_areas(base):
    """The plumes' irradiance is proportional to the blackbody's radiance."""
    irradiances = base.rows[-1].irradiance
    plume = sum(
        irradiances.areas.area[0, k]
        for k, source in enumerate(irradiances.areas.sources)
        if source.group == "plume"
    )
    transmittance, _ = base.path.at(irradiances.wavelengths_um)

    def irradiance(temperature):
        return (
            plume
            * irradiances.in_band(
                transmittance * spectral_radiance(irradiances.wavelengths_um, temperature)
            )
            / base.path.range_m**2
        )

    gained = landing.from_areas(base, landing.heated("plume", 50.0)) - base.rows[-1].total.value
    assert gained == pytest.approx(irradiance(550.0) - irradiance(500.0), rel=1e-9)


@pytest.mark.slow
def test_larger_exhausts_are_larger(tmp_path):
    """Seen from the side a cone grows with its radius, a ring from behind with its square.

    The flank of a cone with base r and length l is pi r sqrt(r^2 + l^2).
    """

    def area(scene):
        result = mi_lcair.signature(scene, spp=1, facets=True).facets.table
        return {
            group: result["area_m2"][result["group"] == group].sum()
            for group in ("hot_parts", "plume")
        }

    larger = mi_lcair.load(landing.with_larger_exhausts(tmp_path))
    before, after = area(mi_lcair.load("a340_landing")), area(larger)
    flank = lambda radius: radius * np.hypot(radius, airliner.EXHAUST_LENGTH)
    base = airliner.EXHAUST_RADIUS
    assert after["hot_parts"] / before["hot_parts"] == pytest.approx(landing.WIDENING**2, rel=1e-4)
    growth = flank(landing.WIDENING * base) / flank(base)
    assert after["plume"] / before["plume"] == pytest.approx(growth, rel=1e-3)


def test_lost_jacobian(base):
    """The factor is close to that of a blackbody at 294 K, computed per wavenumber.

    The overcast sky is nearly such a blackbody.
    """
    nu = np.linspace(1e4 / 12, 1e4 / 8, 20001)  # cm^-1
    per_nu = spectral_radiance(1e4 / nu, 294.0) / nu**2  # W cm^-2 sr^-1 / cm^-1
    as_if = np.trapezoid((per_nu * 1e4)[::-1], (1e4 / nu)[::-1])
    right = np.trapezoid(per_nu * 1e4, nu)
    assert landing.lost_jacobian(base) == pytest.approx(right / as_if, rel=0.01)


def test_numbers():
    assert (
        landing.number(5.384e-3) == "5.38·10⁻³"
        and landing.number(-0.00061) == "-6.10·10⁻⁴"
        and landing.number(5e-5, 1) == "5·10⁻⁵"
    )
    assert [landing.signed(value) for value in (0.04, -7.16, 9.96, 11.6, -100.0)] == [
        "+0.0",
        "-7.2",
        "+10",
        "+12",
        "-100",
    ]


def test_every_field_of_the_page_is_filled(base):
    changes = landing.Changes(dict.fromkeys(landing.VARIATIONS, 0.1), 0.01)
    text = Path(landing.__file__).with_name("landing.template.md").read_text(encoding="utf-8")
    rows = [replace(base.rows[0], max_bounces=count) for count in landing.BOUNCES]
    cases = {key: replace(base, rows=rows) for key in landing.CASES}
    page = text.format(**landing.fields(cases, dict.fromkeys(landing.CASES, changes)))
    assert "{" not in page and page.count("| LWIR | 10 |") == 3
