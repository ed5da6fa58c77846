"""A winter day of bare ground: NOAA SURFRAD, Alamosa (Colorado), 2016-01-01, ten-minute means.

Measured: the surface temperature from up- and downwelling longwave, with a standard uncertainty of
1.0 to 1.4 K that all rows share. First the inputs are `material = "soil"`, because the file does
not describe the ground, and the measured weather. Then conductivity, h, absorptance and wetness are
calibrated on the same day, and on its first half only, which then forecasts the second half. The
pyrgeometer stands for a camera of one pixel.
"""

import tempfile
from pathlib import Path

import numpy as np

import mi_lcair
from docs.studies.cases.comparison import Comparison, columns, plane, write_rows
from mi_lcair.toml_table import text_of

MATERIAL = "soil"
OTHERS = ("soil_dry", "sand")  # other names of bare ground, which a user might choose
TITLES = {"calibrated": "calibrated", "forecast": "second half from the first"}
UNKNOWNS = ("conductivity", "h", "absorptance", "wetness")


def tables(folder: Path, data: dict, material: str = MATERIAL) -> dict:
    """The tables of the heat balance, whose weather is written to a folder."""
    is_day = data["sun_elevation_deg"] > 0
    same = ("air_K", "wind_m_s", "relative_humidity", "pressure_hPa", "down_longwave_W_m2")
    weather = {"hour": data["hour_local"], **{name: data[name] for name in same}}
    for name, column in (("sun_W_m2", "direct_normal_W_m2"), ("diffuse_W_m2", "diffuse_W_m2")):
        weather[name] = np.where(is_day, np.maximum(data[column], 0), 0)
    weather["sun_elevation_deg"] = data["sun_elevation_deg"]
    weather["sun_azimuth_deg"] = 90 - data["sun_azimuth_deg"]
    write_rows(folder / "weather.csv", weather)
    heights = {"wind_height_m": 10.0, "air_height_m": 10.0}
    return {
        "target": {"scene": plane(folder)},
        "weather": {"file": str(folder / "weather.csv"), "ground_K": 280.0, **heights},
        "groups.ground": {"material": material},
        "run": {"rays": 64},
    }


def calibrated(folder: Path, hours: np.ndarray, kelvin: np.ndarray, chosen: np.ndarray):
    """The calibration of the first guess on the chosen rows."""
    write_rows(folder / "measured.csv", {"hour": hours[chosen], "ground": kelvin[chosen]})
    files = {"file": str(folder / f"{MATERIAL}.toml"), "measured": str(folder / "measured.csv")}
    unknowns = {f"ground.{key}": {} for key in UNKNOWNS}
    return mi_lcair.invert({"heat": files, "unknowns": unknowns})


def compare() -> list[Comparison]:
    """Uncalibrated, and calibrated with the heat.toml that `invert` writes."""
    data = columns("surfrad_alamosa.csv")
    order = np.argsort(data["hour_local"])
    data = {name: values[order] for name, values in data.items()}
    measured, results = data["surface_K"], []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for name in (MATERIAL, *OTHERS):
            (folder / f"{name}.toml").write_text(text_of(tables(folder, data, name)))
        hours = data["hour_local"]
        found = calibrated(folder, hours, measured, hours < 25)
        found.save(folder / "calibrated.toml")
        calibrated(folder, hours, measured, hours < 12).save(folder / "forecast.toml")
        for file in (MATERIAL, "calibrated", "forecast", *OTHERS):
            heat = mi_lcair.heat(folder / f"{file}.toml")
            is_shown = hours >= 12 if file == "forecast" else hours < 25
            at = hours[is_shown], heat.hours
            computed, error = (
                np.interp(*at, values[:, 0], period=24) for values in (heat.kelvin, heat.error_K)
            )
            reach = 0.8 if file == "calibrated" else 2.0
            title = TITLES.get(file, f'material = "{file}"')
            half = 1.96 * error
            shown = measured[is_shown]
            results.append(Comparison(f"SURFRAD, {title}", "K", computed, shown, half, reach))
        pairs = zip(found.names, found.value, found.lower, found.upper)
        notes = [f"{n} {v:.3g} ({low:.3g} to {high:.3g})" for n, v, low, high in pairs]
    note = f"SURFRAD, calibrated: {', '.join(notes)}; ground.h is the factor of the law."
    return [*results[:1], Comparison(**{**vars(results[1]), "note": note}), *results[2:]]
