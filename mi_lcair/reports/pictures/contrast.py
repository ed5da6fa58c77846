"""Plot of the spectra of a contrast (thesis Figures 4.11-4.13 and 4.15-4.17)."""

import numpy as np

from mi_lcair.detection.contrast_result import Contrast
from mi_lcair.drawing import new_figure, plain

IRRADIANCE = r"irradiance (W m$^{-2}$ µm$^{-1}$)"


def figure(contrast: Contrast):
    """Figure of the spectra of the last row of a contrast.

    The panels are the intensity, the apparent irradiance with the transmittance of the air, and the
    terms of the contrast.
    """
    row = contrast.rows[-1]
    x, spectra = row.irradiance.wavelengths_um, row.irradiance.spectral(contrast.path)
    transmittance, _ = contrast.path.at(x)
    figure = new_figure((7, 9), layout="constrained")
    intensity, through, parts = figure.subplots(3, 1, sharex=True)
    intensity.plot(x, spectra["intensity"], color="black", linewidth=1.2)
    intensity.set_title(
        f"(a) target before the air: {row.intensity.value:.4g} W/sr in band", fontsize=10
    )
    intensity.set_ylabel(r"intensity (W sr$^{-1}$ µm$^{-1}$)")
    intensity.set_ylim(0, 1.05 * max(spectra["intensity"].max(), 1e-300))

    through.plot(x, spectra["target"], color="C3", linewidth=1.2, label="apparent target")
    through.set_title(
        f"(b) target through {contrast.path.range_m:.5g} m of {plain(contrast.air.name)}:\n"
        f"{row.target.value:.4g} W/m² in band",
        fontsize=10,
    )
    through.set_ylabel(IRRADIANCE)
    through.set_ylim(0, 1.25 * max(spectra["target"].max(), 1e-300))
    beside = through.twinx()
    beside.plot(x, transmittance, color="C7", linewidth=0.8, label="transmittance (right)")
    beside.set_ylim(0, 1.25)
    beside.set_ylabel("transmittance")
    beside.set_yticks(np.linspace(0, 1, 5))
    lines = through.lines + beside.lines
    through.legend(
        lines,
        [line.get_label() for line in lines],
        fontsize=8,
        frameon=False,
        ncols=2,
        loc="upper center",
    )

    hidden = -spectra["background"]
    for label, values, color, width in (
        ("target", spectra["target"], "C3", 1),
        ("path", spectra["path"], "C0", 1),
        ("background, hidden", hidden, "C2", 1),
        ("contrast", spectra["total"], "black", 1.5),
    ):
        parts.plot(x, values, color=color, linewidth=width, label=label)
    parts.axhline(0, color="black", linewidth=0.5)
    low, high = (
        min(0, hidden.min(), spectra["total"].min()),
        max(spectra["target"].max(), spectra["path"].max(), spectra["total"].max(), 0),
    )
    parts.set_ylim(low - 0.05 * (high - low), high + 0.25 * (high - low or 1e-300))
    parts.set_title(f"(c) contrast: {row.total.value:.4g} W/m² in band", fontsize=10)
    parts.set_ylabel(IRRADIANCE)
    parts.set_xlabel("wavelength (µm)")
    parts.set_xlim(contrast.detector.band.lower_um, contrast.detector.band.upper_um)
    parts.legend(fontsize=8, frameon=False, ncols=4, loc="upper center")
    figure.suptitle(
        plain(
            f"{contrast.scenario.name}, {contrast.detector.band.label}, "
            f"up to {row.max_bounces} reflections"
        ),
        fontsize=11,
    )
    return figure
