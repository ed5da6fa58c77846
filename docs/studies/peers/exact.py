"""Exact answers of the jobs, in closed form or by quadrature, without mi_lcair's own formulas."""

import csv
from math import atan, expm1, log, pi, sqrt
from pathlib import Path

from scipy.constants import c, h, k
from scipy.integrate import quad

TABLE = Path(__file__).parents[1] / "cases/data/l_room_view_factors.csv"
STEP = {"pybsm": 20e6 / 2**14, "mi_lcair": 20e6 / ((2**14 - 1) * 63 / 64)}  # electrons of a count


def in_mwir(kelvin: float, power: int) -> float:
    """Integral of 2 h c^2 / x^5 / (exp(h c / (x k T)) - 1) from 3 to 5 um.

    power: 5 for the radiance [W m^-2 sr^-1]; 4 for photons, divided by h c [m^-2 s^-1 sr^-1].
    """
    scale = 2 * h * c**2 if power == 5 else 2 * c

    def spectral(um: float) -> float:
        x = um * 1e-6
        return scale / x**power / expm1(h * c / (x * k * kelvin)) * 1e-6

    return quad(spectral, 3, 5, epsrel=1e-12)[0]


def plate() -> dict[str, float]:
    """Radiance of a diffuse plate of 300 K and emissivity 0.4, 1.5 m below a black sphere.

    The sphere has 800 K and a radius of 0.5 m. It gives the irradiance pi L (r / d)^2.
    """
    return {"radiance": 0.4 * in_mwir(300, 5) + 0.6 * in_mwir(800, 5) * (0.5 / 1.5) ** 2}


def cavity() -> dict[str, float]:
    """Radiance from the opening of a diffuse spherical cavity of 300 K and emissivity 0.5.

    The opening of radius 0.1 m takes the share f of the sphere's area. Any two parts of a sphere
    see each other with the same kernel, so that the radiosity J is uniform, J = e + (1 - e)(1 - f)
    J.
    """
    f = (1 - sqrt(1 - (0.1 / 0.5) ** 2)) / 2
    return {"radiance": 0.5 / (1 - 0.5 * (1 - f)) * in_mwir(300, 5)}


def pixel(tool: str) -> dict[str, float]:
    """Electrons of 300 K and 302 K in a pixel of 15 um at f/2, and their ratio to the noise.

    The noise has shot noise of the target (pyBSM) or of the background (mi_lcair), 300 electrons of
    read noise and the rounding to counts.
    """
    per_photon = pi / (4 * 2**2 + 1) * (15e-6) ** 2 * 1e-3 * 0.7
    background, target = (in_mwir(kelvin, 4) * per_photon for kelvin in (300, 302))
    of_shot = target if tool == "pybsm" else background
    noise = sqrt(of_shot + 300**2 + STEP[tool] ** 2 / 12)
    return {"background": background, "target": target, "snr": (target - background) / noise}


def parallel(low: float, high: float, distance: float) -> float:
    """Area times view factor of squares in parallel planes, with a corner on one axis [m^2].

    low, high: their sides [m]. cos^2 / (pi r^2) is integrated over both squares in closed form.
    """

    def kernel(u: float, v: float) -> float:
        a, b = sqrt(u**2 + distance**2), sqrt(v**2 + distance**2)
        logarithm = distance**2 / 2 * log(u**2 + v**2 + distance**2)
        return (v * a * atan(v / a) + u * b * atan(u / b) - logarithm) / (2 * pi)

    sides = [(low - high, 1), (low, -1), (-high, -1), (0.0, 1)]
    return sum(s * t * kernel(u, v) for u, s in sides for v, t in sides)


def squares(has_sheet: bool) -> dict[str, float]:
    """View factors of parallel unit squares 1 m apart, also with a sheet of 0.5 m between them.

    For each direction the mid-points of the rays from one square to the other are uniform in a
    rectangle around the middle of the plane half-way, a quarter of which is the sheet's. The sheet
    therefore keeps a quarter of the radiation. It has two sides.
    """
    between = parallel(1, 1, 1.0)
    if not has_sheet:
        return {"low high": between, "high low": between}
    sheet = parallel(1, 0.5, 0.5)
    factors = {"low high": 0.75 * between, "low sheet": sheet, "sheet low": sheet / (2 * 0.5**2)}
    swapped = {"low": "high", "high": "low", "sheet": "sheet"}
    return factors | {
        " ".join(swapped[name] for name in pair.split()): value for pair, value in factors.items()
    }


def room() -> dict[str, float]:
    """View factors of the L-shaped room, from the table of quadratures."""
    text = TABLE.read_text(encoding="utf-8").splitlines()
    rows = csv.DictReader(line for line in text if not line.startswith("#"))
    return {f"{row['from']} {row['to']}": float(row["F"]) for row in rows}
