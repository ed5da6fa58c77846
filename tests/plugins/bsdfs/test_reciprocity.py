"""Sandford and Robertson's model is not reciprocal, f(i, r) != f(r, i): by how much, as a table.

The floor is reciprocal. The lobe is not: its reflectance rho_s and its norm H belong to the
source's angle, d / cos to the observer's. That is why paths are traced from the observer, and
emissivity is 1 - HDR, seen from the observer.
"""

import mitsuba as mi
import mpmath
import numpy as np
import pytest

from mi_lcair.physics.reflection import sandford_robertson_equations as sr
from tests.physics import thesis
from tests.physics.reflection.surfaces import MATERIALS, direction, surface
from tests.plugins.reflection_models import seen_at

# material, theta_i and theta_r [degrees], in the specular plane; f(i, r) / f(r, i) of the form
# thesis, and normalized
TABLE = [
    ("bare_aluminum", 30, 31, 0.99992, 0.99999),
    ("bare_aluminum", 60, 61, 0.999274, 0.999905),
    ("bare_aluminum", 40, 80, 0.991648, 0.998901),
    ("bare_aluminum", 80, 84, 0.866734, 0.983763),
    ("bare_aluminum", 70, 89, 0.100096, 0.886075),
    ("gloss_black", 30, 31, 0.985392, 0.986085),
    ("gloss_black", 60, 61, 0.946848, 0.952579),
    ("gloss_black", 40, 80, 0.329645, 0.364219),
    ("gloss_black", 80, 84, 0.366060, 0.665994),
    ("gloss_black", 70, 89, 0.00279016, 0.198114),
]
NUMBERS = {"bare_aluminum": MATERIALS[0], "gloss_black": MATERIALS[2]}  # MWIR


@pytest.mark.slow
@pytest.mark.parametrize("form", ["thesis", "normalized"])
@pytest.mark.parametrize("row", TABLE, ids=lambda row: "-".join(map(str, row[:3])))
@thesis.EXACT
def test_ratio_of_exchanged_directions(row, form):
    """The table against the printed equations in mpmath, and the plugin, by both ways to exchange
    the directions, against both.
    """
    material, i_deg, r_deg, *ratios = row
    expected = ratios[form == "normalized"]
    i, r = mpmath.radians(i_deg), mpmath.radians(r_deg)
    numbers = [mpmath.mpf(number) for number in NUMBERS[material]]
    exact = thesis.brdf(mpmath, i, r, mpmath.pi, *numbers, form) / thesis.brdf(
        mpmath, r, i, mpmath.pi, *numbers, form
    )
    assert float(exact) == pytest.approx(expected, rel=2e-6)

    bsdf = mi.load_dict(
        {"type": "sandford_robertson", "material": material, "band": "MWIR", "form": form}
    )
    observer, source = seen_at(np.radians(r_deg)), seen_at(np.radians(i_deg), np.pi)
    radiance, importance = mi.BSDFContext(), mi.BSDFContext(mi.TransportMode.Importance)
    forth = bsdf.eval(radiance, observer, source.wi)[0] / source.wi.z
    for back in (
        bsdf.eval(radiance, source, observer.wi)[0] / observer.wi.z,
        bsdf.eval(importance, observer, source.wi)[0] / source.wi.z,
    ):
        assert (forth / back)[0] == pytest.approx(expected, rel=2e-5)


def test_the_floor_is_reciprocal():
    S = surface(*MATERIALS[2])
    a, b = direction(np.radians([0, 20, 60])), direction(np.radians([80, 70, 89]), 2.0)
    np.testing.assert_allclose(sr.f_d(S, a, b), sr.f_d(S, b, a), rtol=1e-14)
