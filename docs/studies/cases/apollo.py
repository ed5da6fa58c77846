"""Mean temperatures of the Moon at Apollo 15 and 17 (26 and 20 degrees north), at the surface and
0.83 and 0.13 m below it.

Measured: the heat flow experiments, +- 5 K (Hayne et al. 2017, Table A2). Inputs are those of
`material = "regolith"` with the albedo of mare, 0.06, and 0.018 W/m^2 from the interior.
"""

import tempfile
from pathlib import Path

import numpy as np

import mi_lcair
from docs.studies.cases.comparison import Comparison, columns
from docs.studies.cases.moon_equator import tables
from mi_lcair.heating.temperatures.description import HeatDescription, default_sigmas
from mi_lcair.heating.temperatures.solve import BDF2, course, network_of

MARE = (0.06, 0, 0, 0.48, 0, 0, 0, 0, 0.25)
INTERIOR_W_M2, MEASURED_K = 0.018, 5.0


def means(latitude_deg: float, depth_m: float) -> tuple[float, float]:
    """Mean over a lunation at a depth, and the half width of its 95 % interval [K]."""
    with tempfile.TemporaryDirectory() as folder:
        ground = {"albedo": list(MARE), "back_W_m2": INTERIOR_W_M2}
        tree = tables(Path(folder), latitude_deg, **ground)
        description = HeatDescription.read(tree)
        network, _ = network_of(mi_lcair.load(tree["target"]["scene"]), description)
    sigmas = default_sigmas(network.weather.sky, network.tables)
    result = course(network, [network.column(*pair) for pair in sigmas.items()])
    if depth_m == 0:
        mean, changes = result.kelvin[:, 0].mean(), result.changes[:, :, 0].mean(axis=1)
    else:  # one more lunation, in which the ground below is recorded
        (cells,), levels = result.cells, []
        for k in range(len(result.kelvin)):
            result.step(k, BDF2, result.seconds)
            levels.append(np.vstack([cells.states[1][0], cells.states[1][1][:, 0]]))
        middles = np.cumsum(cells.wall.dz) - cells.wall.dz / 2
        mean, *changes = (np.interp(depth_m, middles, row) for row in np.mean(levels, axis=0))
    count = len(sigmas)  # the rest are those of the paths
    scatter = np.std(changes[count:], ddof=1) / np.sqrt(len(changes) - count)
    sigma = np.linalg.norm([*changes[:count], scatter, description.model_K])
    return float(mean), float(np.hypot(1.96 * sigma, MEASURED_K))


def compare() -> Comparison:
    """Surfaces and depths."""
    data = columns("moon_equator.csv")
    mine = np.char.startswith(data["quantity"].astype(str), "apollo")
    places = zip(data["latitude_deg"][mine], data["depth_m"][mine])
    computed, half = np.transpose([means(*map(float, place)) for place in places])
    pairs = zip(data["quantity"][mine], computed, data["kelvin"][mine])
    each = ", ".join(f"{name} {T:.1f} K ({exact:g})" for name, T, exact in pairs)
    note = f"Apollo: {each}. The stated 5 K of the measurement are part of the interval."
    return Comparison(
        "Moon, Apollo 15 and 17", "K", computed, data["kelvin"][mine], half, 6.0, note
    )
