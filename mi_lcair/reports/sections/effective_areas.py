"""Sections of a spectral intensity."""

from functools import partial

import numpy as np

from mi_lcair.results.result import summary_of
from mi_lcair.results.sections import Drawing, Section


def sections(areas) -> list[Section]:
    """The spectral intensity of EffectiveAreas."""
    section = spectrum_section(areas.columns())
    return [Section(section.title, [summary_of(areas), *section.parts])]


def spectrum_section(columns: dict[str, np.ndarray]) -> Section:
    """Spectral intensity of target and scene by what emitted it: wavelength_um, NAME_W_sr_um."""
    words = "Before any atmosphere, by what emitted it. A click on a name hides a curve."
    drawing = Drawing(partial(spectra, columns))
    return Section("Spectral intensity", [words, drawing])


def spectra(columns: dict[str, np.ndarray]):
    """The panel of a spectral intensity."""
    from mi_lcair.reports.page.line_panel import line_panel
    from mi_lcair.reports.pictures.effective_areas import charts

    return line_panel(charts(columns), across=True)
