"""Night of the Moon's equator by hour: Diviner's regolith temperatures without rocks.

Inputs are those of `material = "regolith"` (Hayne et al. 2017). Measured: nine points at the
equator, read off a figure, as collected by heat1d. No uncertainty is given for them. The model's
interval has the uncertainties of regolith and `model_K`.
"""

import tempfile
from pathlib import Path

import numpy as np

import mi_lcair
from docs.studies.cases.comparison import Comparison, columns, plane, write_rows

LUNATION_H = 2.551443e6 / 3600
STEPS = 480


def tables(folder: Path, latitude_deg: float = 0.0, **ground) -> dict:
    """The tables of a lunation that begins at noon. ground: further keys of its group."""
    hours = np.arange(STEPS + 1) * 24 / STEPS
    cos = np.cos(np.radians(latitude_deg)) * np.cos(np.radians(15 * hours))
    values = {
        "hour": hours,
        "sun_W_m2": np.where(cos > 0, 1361.0, 0.0),
        "sun_elevation_deg": np.degrees(np.arcsin(cos)),
        "sun_azimuth_deg": 0 * hours,
    }
    write_rows(folder / "moon.csv", values)
    weather = {"file": str(folder / "moon.csv"), "day_h": LUNATION_H, "air_K": 200.0}
    weather |= {"h_W_m2_K": 0.0, "sky_K": 0.0, "ground_K": 0.0}
    return {
        "target": {"scene": plane(folder)},
        "weather": weather,
        "groups": {"ground": {"material": "regolith"} | ground},
        "run": {"steps": STEPS, "rays": 64},
    }


def compare() -> Comparison:
    """The night's points; extremes in the note."""
    with tempfile.TemporaryDirectory() as folder:
        heat = mi_lcair.heat(tables(Path(folder)))
    hours = heat.hours / heat.hours[-1] * 24
    kelvin, error = heat.kelvin[:, 0], heat.error_K[:, 0]
    data = columns("moon_equator.csv")
    night = data["quantity"] == "diviner_night"
    at = data["hour_past_noon"][night]
    noon, midnight = (kelvin[np.argmin(abs(hours - h))] for h in (24.0, 12.0))
    return Comparison(
        "Moon, night at the equator",
        "K",
        np.interp(at, hours, kelvin),
        data["kelvin"][night],
        1.96 * np.interp(at, hours, error),
        reach=1.0,
        note=f"Moon: noon {noon:.1f} K (measured 385 +- 5), midnight {midnight:.1f} K (101 +- 5), "
        f"night's minimum {kelvin.min():.1f} K (95 +- 5). The lunation is periodic after "
        f"{heat.days} lunations, to {heat.drift_K:.2g} K.",
    )
