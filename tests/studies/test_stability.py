"""The page on stability: its numbers that follow from formulas."""

from pathlib import Path

import numpy as np
import pytest
from drjit.llvm.ad import Array3f64

from docs.studies import float32_map, stability
from docs.studies.lobe import width_deg
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.physics.reflection import sandford_robertson_equations as sr
from tests.physics.reflection.surfaces import direction, surface

SMALLEST = np.finfo(np.float32).tiny  # smallest normal number


@pytest.mark.parametrize("name", ["SWIR", "MWIR", "LWIR"])
def test_the_coldest_radiance(name):
    """In Float64 it is the smallest normal number of Float32, within 0.01 K."""
    kelvin = stability.coldest(name)
    assert in_band_radiance(band(name), kelvin) < SMALLEST
    assert in_band_radiance(band(name), kelvin + 0.011) >= SMALLEST


@pytest.mark.parametrize("e", [0.0042, 0.005, 0.1])
def test_the_width_of_a_lobe(e):
    """At half of the width from the mirror direction the lobe is half as high.

    The incidence is normal.

    There the factors of the BRDF besides h change by less than the square of the width.
    """
    S = surface(0.1, 0.0, 0.0, e, "normalized")
    angles = np.radians([0.0, width_deg(e) / 2])
    i, r = direction(0 * angles, Vector=Array3f64), direction(angles, Vector=Array3f64)
    peak, half = sr.f(S, i, r).numpy() * np.cos(angles)
    assert half / peak == pytest.approx(0.5, rel=2 * e)


def test_every_field_of_the_page_is_filled():
    angles, widths = len(float32_map.FROM_HORIZON_DEG), len(float32_map.E)
    by_b = np.full((len(float32_map.B), widths), 1e-5)
    by_angle = np.full((3, angles, widths), 1e-4)
    template = Path(stability.__file__).with_name("stability.template.md")
    page = template.read_text(encoding="utf-8").format(**stability.fields(by_b, *by_angle))
    assert "{" not in page and "99 % needs 4602" in page
