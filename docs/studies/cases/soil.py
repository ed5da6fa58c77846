"""Deep soil below air that swings by 20 K: the wave of a semi-infinite body in closed form.

The surface neither emits nor is in the sun. With h and the impedance Z = 1 / (k m) of the soil,
m^2 = i omega rho c / k, the surface swings by h Z / (1 + h Z) of the air [Carslaw and Jaeger,
Conduction of Heat in Solids, section 2.6].
"""

import tempfile
from pathlib import Path

import numpy as np

import mi_lcair
from docs.studies.cases.comparison import Comparison, plane, write_rows

SOIL = {"conductivity": 1.2, "density": 1800.0, "heat_capacity": 1100.0}
SWING_K, H, STEPS = 20.0, 8.0, 144


def compare() -> Comparison:
    """All steps of a day."""
    angle = 2 * np.pi * np.arange(STEPS + 1) / STEPS
    rows = {"hour": 24 * angle / (2 * np.pi), "air_K": 290 + SWING_K * np.cos(angle)}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_rows(folder / "air.csv", rows)
        weather = {"file": str(folder / "air.csv"), "h_W_m2_K": H, "sky_K": 290.0}
        heat = mi_lcair.heat(
            {
                "target": {"scene": plane(folder)},
                "weather": weather | {"ground_K": 290.0},
                "groups": {"ground": SOIL | {"thickness_mm": 3000.0, "emissivity": 0.0}},
                "sigma": {"model_K": 0},
                "run": {"steps": STEPS, "rays": 64},
            }
        )
    k, capacity = SOIL["conductivity"], SOIL["density"] * SOIL["heat_capacity"]
    Z = 1 / (k * np.sqrt(2j * np.pi / 86400 * capacity / k))
    exact = 290 + SWING_K * (H * Z / (1 + H * Z) * np.exp(1j * angle[1:])).real
    return Comparison("Soil, semi-infinite", "K", heat.kelvin[:, 0], exact, reach=0.02)
