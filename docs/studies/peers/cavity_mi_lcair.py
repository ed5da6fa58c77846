"""Radiance from the opening of a spherical cavity, in mi_lcair."""

import mi_lcair
from mi_lcair.physics import bands, blackbody

cavity = {
    "shape": {"kind": "sphere", "radius_m": 0.5, "aperture_radius_m": 0.1},
    "wall": {"emissivity": 0.5},
    "view": {"from": "normal", "spot_m": 0.01},
}
black = float(blackbody.in_band_radiance(bands.band("MWIR"), 300.0))


def run(case, effort, seed):
    result = mi_lcair.cavity(cavity)
    return {"radiance": (result.effective[0] * black, result.sigma[0] * black)}
