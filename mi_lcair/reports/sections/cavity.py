"""Sections of a cavity's effective emissivity."""

from mi_lcair.reports.sections.budget import contributions
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
    if len(result.estimate.contributions) > 1:
        parts.append(contributions(result.first))
    return [Section("Cavity", [*parts, Remarks(list(result.remarks))])]
