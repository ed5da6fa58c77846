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


def test_heat_and_size_follow_effective_areas(base):
    """The plumes' irradiance is proportional to the blackbody's radiance and to their area."""
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
    hot = sum(
        irradiances.areas.area[0, k]
        * irradiances.in_band(transmittance * spectral_radiance(irradiances.wavelengths_um, 800.0))
        / base.path.range_m**2
        for k, source in enumerate(irradiances.areas.sources)
        if source.group == "hot_parts"
    )
    gained = landing.from_areas(base, landing.larger_exhausts) - base.rows[-1].total.value
    assert gained == pytest.approx(0.44 * (irradiance(500.0) + hot), rel=1e-6)


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
    assert [landing.signed(value) for value in (0.04, -7.16, 11.6, -100.0)] == [
        "+0.0",
        "-7.2",
        "+12",
        "-100",
    ]


def test_every_field_of_the_page_is_filled(base):
    changes = {key: dict.fromkeys(landing.VARIATIONS, 0.1) for key in landing.CASES}
    text = Path(landing.__file__).with_name("landing.template.md").read_text(encoding="utf-8")
    rows = [replace(base.rows[0], max_bounces=count) for count in landing.BOUNCES]
    cases = {key: replace(base, rows=rows) for key in landing.CASES}
    page = text.format(**landing.fields(cases, changes))
    assert "{" not in page and page.count("| LWIR | 10 |") == 3
