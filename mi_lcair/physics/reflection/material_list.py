"""The known materials with their emissivities, as a result."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from drjit.llvm.ad import Float64

from mi_lcair.errors import InputError
from mi_lcair.physics import labels, materials
from mi_lcair.results import Result
from mi_lcair.sections import Lines, Remarks, Section, Table

ANGLES_DEG = (0, 60)  # angles to the normal at which emissivities are listed


@dataclass(frozen=True, repr=False)
class MaterialList(Result):
    """Materials, with an entry for each band of each.

    Attributes
    ----------
    listed : tuple of NamedMaterial
        The entries, those of the user's files first.
    emissivity : ndarray, shape (n, 2)
        Directional emissivity of each entry along the normal and at 60 degrees; that of the mean
        over its rows for an entry by wavelength.
    left_out : tuple of str
        What is wrong with each file of a folder that holds no materials, one line each.
    """

    listed: tuple[materials.NamedMaterial, ...]
    emissivity: np.ndarray
    left_out: tuple[str, ...] = ()

    kind = "materials"

    @property
    def by_wavelength(self) -> list[bool]:
        return [entry.spectrum is not None for entry in self.listed]

    def summary(self) -> str:
        """One line with the number of materials."""
        names = {entry.name for entry in self.listed}
        count = f"{len(names)} names, {len(self.listed)} entries"
        return f"materials: {count}; {len(labels.tables())} labels of surfaces"

    def entries(self) -> dict:
        """Entries for JSON: for each entry its name, band, model, parameters and source."""
        rows = [
            {"by_wavelength": wavelength, "parameters": e.parameters, "form": e.form} | row
            for row, e, wavelength in zip(self.as_rows(), self.listed, self.by_wavelength)
        ]
        of_labels = [
            {"name": name, "band": band, "reflects": labels.reflects(name)} | entry
            for name, of_name in labels.tables().items()
            for band, entry in of_name.items()
        ]
        return {"materials": rows, "labels": of_labels, "left_out": self.left_out}

    def facts(self):
        """Tables of the materials and labels, the materials' sources, and what was left out."""
        columns = self.columns()
        del columns["source"]
        yield Table.of(columns | {"by wavelength": self.by_wavelength})
        yield Lines("source", [f"{e.name}, {e.band}: {e.source}" for e in self.listed])
        bands = [band for band in labels.BANDS if band not in ("SWIR", "8-14")]
        of_labels = Table(["label", "reflects", *bands], labels.rows(bands))
        yield Section("Labels: emissivity along the normal +- sigma", [of_labels])
        yield Remarks([f"left out: {file}" for file in self.left_out])

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each entry: name, model, band, emissivities and source."""
        names = ("name", "model", "band", "source")
        rows = [(e.name, e.model.name, e.band, e.source) for e in self.listed]
        texts = dict(zip(names, np.array(rows).T))
        numbers = {f"emissivity_{angle}deg": e for angle, e in zip(ANGLES_DEG, self.emissivity.T)}
        return {name: texts[name] for name in names[:3]} | numbers | {"source": texts["source"]}


def material_list(paths: Sequence[str | Path] = ()) -> MaterialList:
    """The materials of some files, and the built-in ones.

    paths: TOML files of materials, JSON files of fits or inversions, and folders, of which all TOML
    files with materials are taken. Raises InputError for a file that cannot be used, and for a
    folder without materials.
    """
    listed, left_out = [], []
    for path in map(Path, paths):
        if not path.is_dir():
            listed += materials.entries_of(path)
            continue
        count = len(listed)
        for file in sorted(path.glob("*.toml")):
            try:
                listed += materials.entries_of(file)
            except InputError as error:
                left_out.append(str(error))
        if len(listed) == count:
            raise InputError(f"{path}: no TOML file in the folder contains materials")
    listed += materials.entries_of(materials.BUILT_IN)
    emissivity = np.array([emissivity_of(entry, np.radians(ANGLES_DEG)) for entry in listed])
    return MaterialList(tuple(listed), emissivity, tuple(left_out))


def emissivity_of(entry: materials.NamedMaterial, theta: np.ndarray) -> np.ndarray:
    """Directional emissivity 1 - HDR(theta) as rendered, 0 where the model's HDR exceeds 1."""
    HDR = entry.model.HDR(entry.surface(), Float64(theta)).numpy()
    return 1 - np.minimum(HDR, 1)
