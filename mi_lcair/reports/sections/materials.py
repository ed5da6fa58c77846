"""Sections of a list of materials."""

from mi_lcair.physics.reflection.material_list import ANGLES_DEG
from mi_lcair.results.sections import Lines, Remarks, Section, Table


def sections(result) -> list[Section]:
    """A table of the materials, their sources, and what was left out."""
    angles = [f"emissivity at {angle} degrees" for angle in ANGLES_DEG]
    rows = [
        (entry.name, entry.model.name, band_of(entry), *(f"{value:.3f}" for value in values))
        for entry, values in zip(result.listed, result.emissivity)
    ]
    sources = [f"{entry.name}, {entry.band}: {entry.source}" for entry in result.listed]
    parts = [Table(["name", "model", "band", *angles], rows), Lines("source", sources)]
    return [Section("Materials", [*parts, Remarks([f"left out: {e}" for e in result.left_out])])]


def band_of(entry) -> str:
    """Band of an entry; for one by wavelength the limits of its rows [um]."""
    return entry.band if entry.spectrum is None else f"{entry.band} by wavelength"
