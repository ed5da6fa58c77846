"""Named materials: a reflection model and its parameters, band by band, with their source."""

import json
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mi_lcair.errors import InputError, unknown
from mi_lcair.files import read_text
from mi_lcair.physics.bands import Band
from mi_lcair.physics.bands import band as band_of

if TYPE_CHECKING:  # the models load Dr.Jit, and names of materials are read without it
    from mi_lcair.physics.reflection import ReflectionModel

BUILT_IN = Path(__file__).with_name("materials.toml")
EVERY_BAND = "any"


@dataclass(frozen=True)
class Material:
    """A surface in one band ("any": all): its reflection model, the parameters by name, and the form
    of the model.
    """

    name: str
    band: str
    model: "ReflectionModel"
    parameters: dict[str, float]
    form: str
    source: str

    @property
    def values(self) -> tuple[float, ...]:
        """The parameters in the model's order."""
        return tuple(self.parameters[name] for name in self.model.names)

    def surface(self):
        """What the model's functions take, in Float64. InputError for numbers that no surface can have."""
        self.model.check_form(self.form)
        self.model.check_feasible(*self.values, form=self.form)
        from drjit.llvm.ad import Float64

        return self.model.surface(*map(Float64, self.values), form=self.form)


def material(
    name: str, band: Band | None, file: str | Path | None = None, allow_band: bool = False
) -> Material:
    """The material `name` in a band.

    name: a key of the user's TOML `file`, of the built-in materials, or the path of a fit's JSON
    file. band: where it is to be used; the entry measured there, or in a wider band, is taken
    (None: only an entry for any band will do). With allow_band the entry that overlaps most, or
    else lies nearest, is taken instead of refusing. Raises InputError for an unknown name, a band
    that it was not measured for, and a file that cannot be used.
    """
    entries = _fits(name) if str(name).lower().endswith(".json") else _toml_entries(name, file)
    best = max(entries, key=lambda entry: _fitness(entry.band, band))
    if _fitness(best.band, band)[0] or (allow_band and band is not None):
        return best
    known = ", ".join(entry.band for entry in entries)
    if band is None:
        raise InputError(f"material '{name}': needs a band; measured for {known}")
    raise InputError(
        f"material '{name}': not measured for band {band.label}, only for {known}; "
        f"set allow_band in the scene to use it all the same"
    )


def names(file: str | Path | None = None) -> list[str]:
    """The names that `material` knows, those of the user's TOML `file` first."""
    return list({**(_read(file, tomllib.loads) if file else {}), **_read(BUILT_IN, tomllib.loads)})


def emits_nothing(name: str, file: str | Path | None = None) -> bool:
    """Whether the entries of a material say `emits = false`: it reflects all that arrives. Loads no
    reflection model.
    """
    for path in filter(None, (file, BUILT_IN)):
        bands = _read(path, tomllib.loads).get(name)
        if isinstance(bands, dict):
            return all(
                isinstance(entry, dict) and entry.get("emits") is False for entry in bands.values()
            )
    return False


def _fitness(measured, wanted):
    """How well parameters for the band named `measured` serve in `wanted`: (covers it, overlap in
    um, -width).
    """
    measured = None if measured == EVERY_BAND else band_of(measured)
    if measured is None or wanted is None:
        return measured is None, 0.0, -np.inf
    covers = measured.lower_um <= wanted.lower_um and wanted.upper_um <= measured.upper_um
    overlap = min(measured.upper_um, wanted.upper_um) - max(measured.lower_um, wanted.lower_um)
    # an average over the whole spectrum says nothing about a part of it
    return (
        covers and measured.is_total == wanted.is_total,
        overlap,
        measured.lower_um - measured.upper_um,
    )


def _toml_entries(name, file):
    for path in filter(None, (file, BUILT_IN)):
        bands = _read(path, tomllib.loads).get(name)
        if bands is None:
            continue
        where = f"{path}: material '{name}'"
        if (
            not isinstance(bands, dict)
            or not bands
            or not all(isinstance(entry, dict) for entry in bands.values())
        ):
            raise InputError(f"{where}: needs a table for each band, such as [{name}.MWIR]")
        return [_entry(where, name, band, dict(entry), str(path)) for band, entry in bands.items()]
    raise unknown("material", name, names(file))


def _fits(name):
    """The entries of a fit's JSON file: keys `parameters`, `form` and `band`, or one such report a
    band in `materials`.
    """
    name = str(name)
    file = _read(name, json.loads)
    reports = file.get("materials", {"": file})
    if (
        not isinstance(reports, dict)
        or not reports
        or not all(isinstance(report, dict) for report in reports.values())
    ):
        raise InputError(f"{name}: key 'materials' must be a table with a fit for each band")
    return [_fitted(name, report) for report in reports.values()]


def _fitted(name, report):
    if report.get("band", "") is None:
        raise InputError(
            f"{name}: the fitted data did not state their band; add '# band_um: 3 5' to their file and fit again"
        )
    for key, kind in (("parameters", dict), ("form", str), ("band", str)):
        if not isinstance(report.get(key), kind):
            raise InputError(
                f"{name}: key '{key}' is missing or no {'table' if kind is dict else 'string'}; "
                f"a fit has parameters, form and band"
            )
    keys = {**report["parameters"], "form": report["form"]}
    if "model" in report:
        keys["model"] = report["model"]
    return _entry(f"{name}: parameters", name, report["band"], keys, name)


def _entry(where, name, band, keys, file):
    """A checked Material. Whether the numbers are possible together is for the reflection model to
    say.
    """
    from mi_lcair.physics import reflection

    where = f"{where}, band '{band}'"
    try:
        if band != EVERY_BAND:
            band_of(band)
        model = reflection.model(keys["model"]) if "model" in keys else reflection.DEFAULT
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    allowed = (*model.names, "model", "form", "source", "emits")
    for key, value in keys.items():
        if key not in allowed:
            raise InputError(f"{where}: {unknown('key', key, allowed)}")
        if key == "emits":
            if not isinstance(value, bool):
                raise InputError(f"{where}: emits = {value!r}; must be true or false")
            continue
        if key in model.names and (type(value) not in (int, float) or not np.isfinite(value)):
            raise InputError(f"{where}: {key} = {value!r}; must be a number")
        if key not in model.names and not isinstance(value, str):
            raise InputError(f"{where}: {key} = {value!r}; must be a string")
    missing = [key for key in model.names if key not in keys]
    if missing:
        raise InputError(f"{where}: lacks {', '.join(missing)}")
    return Material(
        name,
        band,
        model,
        {key: float(keys[key]) for key in model.names},
        form=keys.get("form", model.forms[0]),
        source=keys.get("source", file),
    )


def _read(path, parse):
    """The table in a TOML or JSON file."""
    text = read_text(path, f"materials file {path}")
    try:
        table = parse(text)
    except (ValueError, RecursionError) as error:  # of TOML, of JSON
        raise InputError(f"materials file {path}: {error}") from None
    if not isinstance(table, dict):
        raise InputError(f"materials file {path}: must be a table of keys")
    return table
