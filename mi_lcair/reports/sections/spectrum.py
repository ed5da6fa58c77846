"""Sections of a spectral intensity."""

from functools import partial

import numpy as np

from mi_lcair.reports.page.spectrum_panel import spectrum_panel
from mi_lcair.results.sections import Drawing, Section

SPECTRAL = "_W_sr_um"  # end of the names of a spectrum's columns


def sections(areas) -> list[Section]:
    """The spectral intensity of EffectiveAreas."""
    return [spectrum_section(areas.columns())]


def spectrum_section(columns: dict[str, np.ndarray]) -> Section:
    """Spectral intensity of target and scene by what emitted it: wavelength_um, NAME_W_sr_um."""
    curves = {
        name.removesuffix(SPECTRAL): np.asarray(values, float)
        for name, values in columns.items()
        if name.endswith(SPECTRAL)
    }
    wavelengths = np.asarray(columns["wavelength_um"], float)
    words = "Before any atmosphere, by what emitted it. A click on a name hides a curve."
    return Section(
        "Spectral intensity", [words, Drawing(partial(spectrum_panel, wavelengths, curves))]
    )
