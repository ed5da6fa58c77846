"""Files of temperatures: the CSV that an import takes, and VTK at one time or at all."""

import json
from os import PathLike
from pathlib import Path

import numpy as np

from mi_lcair.files import replacing
from mi_lcair.formats import csv
from mi_lcair.heating.temperatures.heat_result import Heat
from mi_lcair.sensitivity.temperatures.modes import AFTER, BEFORE


def write_csv(path: str | PathLike[str], heat: Heat, hour: float | None = None) -> None:
    """Write facet,kelvin,error_K of all facets of the scene, as `mi-lcair import` takes them.

    A column `by_NAME_K` for each uncertain input has the change for one standard uncertainty, see
    `mi_lcair.sensitivity.temperatures.modes`. Facets that exchange no heat keep their temperature,
    with the error 0. Those without an area have the mean temperature of the others.

    Parameters
    ----------
    path : path-like
    heat : Heat
    hour : float or None
        The nearest time is written; without one that of the warmest facet.
    """
    k = heat.row(hour)
    kelvin = heat.of_scene(heat.kelvin[k], heat.scene_kelvin)
    kelvin = np.where(np.isnan(kelvin), np.nanmean(kelvin), kelvin)
    columns = {"facet": np.arange(len(kelvin)), "kelvin": kelvin}
    changes = {f"{BEFORE}{name}{AFTER}": change for name, change in heat.changes.items()}
    for name, values in {"error_K": heat.error_K, **changes}.items():
        columns[name] = heat.of_scene(values[k])
    csv.write(path, columns)


def write_vtk(path: str | PathLike[str], heat: Heat, hour: float | None = None) -> None:
    """Write the facets with their temperatures at the time nearest to an hour, .vtp or .vtu."""
    heat.polygons.write(path, heat.columns(hour))


def write_series(path: str | PathLike[str], heat: Heat) -> None:
    """Write NAME.vtp.series, which ParaView opens, and a .vtp file for each time beside it."""
    path = Path(path)
    name = path.name.removesuffix(".series").removesuffix(".vtp")
    files = []
    for k, hour in enumerate(heat.hours):
        file = f"{name}_{k:04}.vtp"
        write_vtk(path.with_name(file), heat, float(hour))
        files.append({"name": file, "time": float(heat.seconds[k])})
    with replacing(path) as partial:
        text = json.dumps({"file-series-version": "1.0", "files": files}, indent=1)
        partial.write_text(f"{text}\n", encoding="utf-8")
