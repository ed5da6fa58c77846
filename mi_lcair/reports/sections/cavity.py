"""Sections of a cavity's effective emissivity."""

import numpy as np

from mi_lcair.reports.sections.budget import contribution, in_unit
from mi_lcair.results.result import summary_of
from mi_lcair.results.sections import Facts, Remarks, Section, Table

METHODS = {"rings": "radiosity of diffuse rings", "paths": "paths of the renderer"}


def sections(result) -> list[Section]:
    """The effective emissivity by wavelength, the method, and the budget."""
    coldest, hottest = result.kelvin.min(), result.kelvin.max()
    wall = f"{coldest:g} K" if coldest == hottest else f"{coldest:g} to {hottest:g} K"
    rows = [
        ("shape", f"{result.shape.kind.replace('_', ' with ')}, {result.shape.depth:g} m deep"),
        ("view", result.seen),
        ("wall", f"{wall}, compared with a blackbody of {result.reference:g} K"),
        ("method", METHODS[result.method]),
    ]
    by_wavelength = {
        "wavelength um": (result.wavelengths_um, "g"),
        "wall": (result.wall_emissivity, ".4f"),
        "effective emissivity": (result.effective, ".6f"),
        "sigma": (result.sigma, ".2g"),
        "of which numerical": (result.numerical, ".2g"),
        "Gouffé": (result.gouffe, ".4f"),
    }
    parts = [summary_of(result), Facts(rows), Table.of(by_wavelength)]
    budget = [
        contribution(
            row,
            "by wavelength" if np.isnan(row.number.value) else in_unit(row, row.number.value),
            f"{row.slope[0]:.4g}",
            row.sigma[0],
            result.sigma[0],
        )
        for row in result.contributions
    ]
    if budget:
        head = ["quantity", "value", "sigma", "sensitivity", "contribution", "share"]
        parts.append(Table(head, budget))
    return [Section("Cavity", [*parts, Remarks(list(result.remarks))])]
