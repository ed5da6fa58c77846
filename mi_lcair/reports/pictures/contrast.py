"""Line charts of the spectra of a contrast (thesis Figures 4.11-4.13 and 4.15-4.17)."""

import numpy as np

from mi_lcair.detection.contrast_result import Contrast
from mi_lcair.reports.line_charts import figure_of
from mi_lcair.results.charts import Curve, LineChart, by_wavelength

INTENSITY, IRRADIANCE = "W sr-1 um-1", "W m-2 um-1"


def figure(contrast: Contrast):
    """Figure of the spectra of the last row of a contrast."""
    return figure_of_entries(contrast.as_dict())


def figure_of_entries(entries: dict):
    """The figure of a contrast from the entries of its JSON."""
    bounces = entries["rows"][-1]["max_bounces"]
    title = f"{entries['scenario_name']}, {entries['band']}, up to {bounces} reflections"
    if entries["scenario"]["sensor"]["response"] is not None:
        title += "; spectra times the response"
    return figure_of(charts(entries), title)


def charts(entries: dict) -> list[LineChart]:
    """Spectra of the last row of a contrast from the entries of its JSON.

    They are the intensity before the air, the target's irradiance with the transmittance of the
    air, and the terms of the contrast, each times the response of the detector, so that the area
    below a curve is the value in band.
    """
    row, spectra = entries["rows"][-1], entries["spectrum"]
    columns = {name: np.array(values, dtype=float) for name, values in spectra.items()}
    x, response = columns["wavelength_um"], columns["response"]

    def weighted(name):
        return columns[name] * response

    def in_band(name):
        return f"{row[name]['value']:.4g}"

    intensity = Curve("intensity", weighted("intensity_W_sr_um"), INTENSITY)
    target = Curve("target", weighted("target_W_m2_um"), IRRADIANCE, 1)
    through = Curve("transmittance (right)", columns["transmittance"], "", 8, on_right=True)
    terms = [
        target,
        Curve("path", weighted("path_W_m2_um"), IRRADIANCE, 0),
        Curve("background, hidden", -weighted("background_W_m2_um"), IRRADIANCE, 2),
        Curve("contrast", weighted("total_W_m2_um"), IRRADIANCE),
    ]
    titles = (
        f"target before the air: {in_band('intensity_W_sr')} W/sr in band",
        f"target through {entries['range_m']:.5g} m of {entries['atmosphere']}: "
        f"{in_band('target_W_m2')} W/m² in band",
        f"contrast: {in_band('total_W_m2')} W/m² in band",
    )
    of_irradiance = "irradiance", IRRADIANCE
    return [
        by_wavelength(titles[0], x, "intensity", INTENSITY, [intensity]),
        by_wavelength(titles[1], x, *of_irradiance, [target, through]),
        by_wavelength(titles[2], x, *of_irradiance, terms, from_zero=False),
    ]
