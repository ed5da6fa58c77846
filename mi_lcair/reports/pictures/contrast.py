"""Line charts of the spectra of a contrast (thesis Figures 4.11-4.13 and 4.15-4.17)."""

from mi_lcair.detection.contrast_result import Contrast
from mi_lcair.reports.line_charts import Curve, LineChart, figure_of, label

WAVELENGTH = "wavelength (µm)"
INTENSITY, IRRADIANCE = "W sr-1 um-1", "W m-2 um-1"


def figure(contrast: Contrast):
    """Figure of the spectra of the last row of a contrast."""
    bounces = contrast.rows[-1].max_bounces
    title = f"{contrast.scenario.name}, {contrast.detector.band.label}, up to {bounces} reflections"
    if contrast.detector.band.response is not None:
        title += "; spectra times the response"
    return figure_of(charts(contrast), title)


def charts(contrast: Contrast) -> list[LineChart]:
    """Spectra of the last row of a contrast.

    They are the intensity before the air, the target's irradiance with the transmittance of the
    air, and the terms of the contrast, each times the response of the detector, so that the area
    below a curve is the value in band.
    """
    row = contrast.rows[-1]
    x, response = row.irradiance.wavelengths_um, contrast.detector.band.response_at
    spectra = row.irradiance.spectral(contrast.path)
    spectra = {name: values * response(x) for name, values in spectra.items()}
    transmittance, _ = contrast.path.at(x)
    intensity = Curve("intensity", spectra["intensity"], INTENSITY)
    target = Curve("target", spectra["target"], IRRADIANCE, 1)
    through = Curve("transmittance (right)", transmittance, "", 8, on_right=True)
    terms = [
        target,
        Curve("path", spectra["path"], IRRADIANCE, 0),
        Curve("background, hidden", -spectra["background"], IRRADIANCE, 2),
        Curve("contrast", spectra["total"], IRRADIANCE),
    ]
    irradiance = label("irradiance", IRRADIANCE)
    return [
        LineChart(
            f"target before the air: {row.intensity.value:.4g} W/sr in band",
            x,
            WAVELENGTH,
            label("intensity", INTENSITY),
            [intensity],
            from_zero=True,
        ),
        LineChart(
            f"target through {contrast.path.range_m:.5g} m of {contrast.air.name}: "
            f"{row.target.value:.4g} W/m² in band",
            x,
            WAVELENGTH,
            irradiance,
            [target, through],
            from_zero=True,
        ),
        LineChart(
            f"contrast: {row.total.value:.4g} W/m² in band", x, WAVELENGTH, irradiance, terms
        ),
    ]
