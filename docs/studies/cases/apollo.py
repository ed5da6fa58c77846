"""Mean temperatures of the Moon's surface at Apollo 15 and 17 (26 and 20 degrees north).

Measured: the heat flow experiments, +- 5 K (Hayne et al. 2017, Table A2). Inputs are those of
`material = "regolith"` with the albedo of mare, 0.06.
"""

import tempfile
from pathlib import Path

import numpy as np

from docs.studies.cases.comparison import Comparison, columns
from docs.studies.cases.moon_equator import day

MARE = (0.06, 0, 0, 0.48, 0, 0, 0, 0, 0.25)


def compare() -> Comparison:
    """Means over a lunation; the depths below the surface are not computed."""
    data = columns("moon_equator.csv")
    mine = np.char.endswith(data["quantity"].astype(str), "surface_mean")
    means, errors = [], []
    for latitude in data["latitude_deg"][mine]:
        with tempfile.TemporaryDirectory() as folder:
            heat = day(Path(folder), float(latitude), albedo=list(MARE))
        means.append(heat.kelvin[:, 0].mean())
        rows = [row.contribution[:, 0].mean() for row in heat.estimate.contributions]
        errors.append(np.hypot(np.linalg.norm(rows), 5 / 1.96))
    return Comparison(
        "Moon, mean of the surface at Apollo 15 and 17", "K", np.array(means),
        data["kelvin"][mine], 1.96 * np.array(errors), 6.0,
        "Apollo: the stated 5 K of the measurement are part of the interval.",
    )  # fmt: skip
