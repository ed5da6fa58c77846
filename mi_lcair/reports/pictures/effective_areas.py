"""Line charts of the spectral intensity of a signature."""

import numpy as np

from mi_lcair.reports.line_charts import figure_of
from mi_lcair.results.charts import Curve, LineChart, by_wavelength
from mi_lcair.signatures.effective_areas import PARTS, EffectiveAreas

UNIT = "W sr-1 um-1"
SPECTRAL = "_W_sr_um"  # end of the names of a spectrum's columns


def figure(areas: EffectiveAreas):
    """Figure of the spectral intensity of target and scene, and of their groups."""
    return figure_of_columns(areas.columns(), f"{areas.scene_name}, {areas.band.label}")


def figure_of_columns(columns: dict[str, np.ndarray], title: str):
    """Figure of the table of a spectrum, whose columns are those of `EffectiveAreas.columns`."""
    return figure_of(charts(columns), f"{title}, by what emitted it", across=True)


def charts(columns: dict[str, np.ndarray]) -> list[LineChart]:
    """Spectral intensity of target and scene, each with the groups that emit in the band."""
    x = np.asarray(columns["wavelength_um"], float)
    spectra = {
        name.removesuffix(SPECTRAL): np.asarray(values, float)
        for name, values in columns.items()
        if name.endswith(SPECTRAL)
    }
    groups = list(dict.fromkeys(name.partition(".")[2] for name in spectra if "." in name))
    result = []
    for part in (part for part in PARTS if part in spectra):
        curves = [Curve("total", spectra[part], UNIT)]
        for number, group in enumerate(groups):
            values = spectra.get(f"{part}.{group}")
            if values is not None and values.any():
                curves.append(Curve(group, values, UNIT, number))
        in_band = np.trapezoid(spectra[part] * columns.get("response", 1.0), x)
        title = f"{part}: {in_band:.5g} W/sr in band"
        result.append(by_wavelength(title, x, "spectral intensity", UNIT, curves))
    return result
