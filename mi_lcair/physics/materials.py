"""Named materials: a reflection model with its parameters for each band, and their source.

A number in place of a name is the emissivity of a grey diffuse surface. The labels of surfaces, see
`mi_lcair.physics.labels`, are materials too.
"""

import re
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mi_lcair.declared import Bounds
from mi_lcair.errors import InputError, check_known, errors_of, shown, unknown
from mi_lcair.files import parse_json, parse_toml, read_text, revision
from mi_lcair.physics import labels, openmaterial
from mi_lcair.physics.bands import Band
from mi_lcair.physics.bands import band as band_of
from mi_lcair.toml_table import typed

if TYPE_CHECKING:
    from mi_lcair.physics.reflection.interface import ReflectionModel
    from mi_lcair.physics.spectra.parameters import SpectralParameters

# The models load Dr.Jit. Reading the names of materials does not need it.


BUILT_IN = Path(__file__).with_name("materials.toml")
EVERY_BAND = "any"  # band name of an entry that holds at every wavelength
SPECTRAL = "spectral"  # name of an entry whose parameters depend on wavelength
EMISSIVITY, SIGMA = Bounds(lower=0, upper=1), Bounds(is_positive=True)
NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)(e[+-]?[0-9]+)?", re.IGNORECASE)


@dataclass(frozen=True)
class NamedMaterial:
    """A reflection model with the parameters of one surface in one band.

    Attributes
    ----------
    name
        Name of the material.
    band
        Band in which the parameters hold; "any" for all bands.
    model
        The reflection model.
    parameters
        Parameters by name, in the model's units.
    form
        Form of the model's equations.
    source
        Publication or file from which the parameters come.
    spectrum
        Parameters over wavelength, of which `parameters` are an average over the rows; None if they
        are constant in the band.
    sigma
        Standard deviations of parameters by name, which budgets take by themselves.
    """

    name: str
    band: str
    model: "ReflectionModel"
    parameters: dict[str, float]
    form: str
    source: str
    spectrum: "SpectralParameters | None" = None
    sigma: dict[str, float] = field(default_factory=dict)

    @property
    def values(self) -> tuple[float, ...]:
        """The parameters in the model's order."""
        return tuple(self.parameters[name] for name in self.model.names)

    def averaged(self, band: Band, temperature: float | None = None) -> "NamedMaterial":
        """A spectral material with parameters of its mean reflectance in a band.

        The weights are the band's response times the spectral radiance of a blackbody; without a
        temperature [K], the response alone.
        """
        self.spectrum.check_covers(
            band,
            f"material '{self.name}'",
            '; outside = "constant" in its entry continues the first and the last row',
        )
        values = self.spectrum.averaged(*self.spectrum.weights(band, temperature))
        return replace(self, parameters=dict(zip(self.model.names, values)))

    def surface(self):
        """The model's `Surface` with these parameters, in Float64."""
        return self.model.surface_of(self.values, self.form)


def material(
    name: str, band: Band | None, file: str | Path | None = None, allow_band: bool = False
) -> NamedMaterial:
    """The material `name` with its parameters for a band.

    Parameters
    ----------
    name
        Key of the user's TOML `file` or of the built-in materials, path of a fit's JSON file, or
        the emissivity of a grey diffuse surface, such as 0.92.
    band
        Band in which the material is used. An entry that was measured in this band or in a wider
        one is taken. None accepts only an entry for any band.
    file
        TOML file of the user's own materials, or the JSON file of a fit or of an inversion's
        solution; see `names`.
    allow_band
        Whether to take, where no entry covers the band, the entry that overlaps it most or lies
        nearest to it, instead of raising InputError.

    Returns
    -------
    NamedMaterial
        The entry.

    Raises
    ------
    InputError
        If the name is unknown, the material was not measured in the band, or a file cannot be used.
    """
    entries = _entries(name, file)
    best = max(entries, key=lambda entry: _fitness(entry, band))
    if best.spectrum is not None and band is not None:
        return best.averaged(band)  # raises InputError unless the spectrum covers the band
    if _fitness(best, band)[0] or (allow_band and band is not None):
        return best
    known = ", ".join(entry.band for entry in entries)
    if band is None:
        raise InputError(f"material '{name}': needs a band; measured for {known}")
    raise InputError(
        f"material '{name}': not measured for band {band.label}, only for {known}; "
        'set allow_band to use it all the same: <boolean name="allow_band" value="true"/> in its '
        "BSDF, or -D allow_band=true where the scene has this parameter"
    )


def hemispherical_emissivity(name: str, band: Band) -> float:
    """Emissivity of a material over the hemisphere.

    Raises InputError as `material` does.
    """
    return float(name) if is_number(name) else over_hemisphere(material(name, band))


def over_hemisphere(entry: NamedMaterial) -> float:
    """Emissivity of an entry over the hemisphere."""
    from mi_lcair.physics.reflection.interface import emissivity_over_hemisphere

    return emissivity_over_hemisphere(entry.model, entry.surface())


def bands_of(name: str, file: str | Path | None = None) -> list[str]:
    """Bands of the entries of a material, "any" for one of all bands; arguments as `material`."""
    return [entry.band for entry in _entries(name, file)]


def is_number(name: str) -> bool:
    """Whether a material is given by the number of its emissivity.

    Raises InputError for a number that is no emissivity.
    """
    if not NUMBER.fullmatch(str(name)):
        return False
    EMISSIVITY.check(float(name), "a material's emissivity")
    return True


def names(file: str | Path | None = None) -> list[str]:
    """Names of all materials, those of the user's `file` first.

    file: TOML file of the user's own materials, the JSON file of an inversion's solution, or that
    of a fit, whose material has the file's name without its suffix.
    """
    return list({**(_materials(file) if file else {}), **_materials(BUILT_IN), **labels.tables()})


def emits_nothing(name: str, file: str | Path | None = None) -> bool:
    """Whether the entries of a material say `emits = false`: it reflects all that arrives. Loads no
    reflection model.
    """
    if is_number(name):
        return float(name) == 0
    for path in filter(None, (file, BUILT_IN)):
        bands = _materials(path).get(name)
        if bands is not None:
            return _are_tables(bands) and all(of.get("emits") is False for of in bands.values())
    return False


def _fitness(entry, wanted):
    """Rank of an entry when the band `wanted` is asked for.

    The larger tuple fits better: (whether it covers `wanted`, whether it is a spectrum, overlap
    [um], -width [um]).
    """
    measured = None if entry.band == EVERY_BAND else band_of(entry.band)
    if measured is None or wanted is None:
        return measured is None, False, 0.0, -np.inf
    # An average over the whole spectrum gives no information about a part of it
    covers = measured.holds(wanted) or (measured.is_total and wanted.is_total)
    overlap = min(measured.upper_um, wanted.upper_um) - max(measured.lower_um, wanted.lower_um)
    width = measured.upper_um - measured.lower_um
    return covers, covers and entry.spectrum is not None, overlap, -width


def _entries(name, file):
    """All entries of a material, see `material`."""
    if is_number(name):
        keys = {"model": "grey", "emissivity": float(name)}
        return [_entry("material", name, EVERY_BAND, keys, "a number, for all wavelengths")]
    return _fits(name) if is_json(name) else _toml_entries(name, file)


def _toml_entries(name, file):
    """All entries of the material `name`, from the user's file if it has them, else built-in."""
    for path in filter(None, (file, BUILT_IN, labels.SAMPLES)):
        bands = _materials(path).get(name)
        if bands is None:
            continue
        if path is labels.SAMPLES:
            bands = {band: labels.keys_of(name, entry) for band, entry in bands.items()}
        where = f"{path}: material '{name}'"
        if not _are_tables(bands):
            raise InputError(f"{where}: needs a table for each band, such as [{name}.MWIR]")
        if is_json(path):
            return [_fitted(str(path), report) for report in bands.values()]
        of = f"{where}, {SPECTRAL}"
        return [
            _spectral(of, name, Path(path).parent, *_cached(of, path, entry))
            if band == SPECTRAL
            else _entry(where, name, band, dict(entry), str(path))
            for band, entry in bands.items()
        ]
    raise unknown("material", name, names(file))


def _are_tables(value) -> bool:
    """Whether a value is a table of tables, of one at least."""
    return isinstance(value, dict) and bool(value) and all(type(v) is dict for v in value.values())


def is_json(path) -> bool:
    """Whether a name is that of a JSON file: of a fit, a solution, or an OpenMATERIAL."""
    return str(path).lower().endswith((".json", ".xomp"))


def check_fit(path: str | Path) -> None:
    """Raise InputError for a JSON file that is not one material: a fit, or a solution with one
    material.
    """
    _fits(path)


def entries_of(path: str | Path) -> list[NamedMaterial]:
    """All entries of a file of materials; raises InputError for an incomplete or impossible one."""
    return [entry for name in _materials(path) for entry in _toml_entries(name, path)]


def _materials(path) -> dict:
    """The tables of a materials file by name.

    Those of a solution's JSON file are in its table `materials`. The JSON file of a fit holds one
    material, named as the file.
    """
    if path is labels.SAMPLES:
        return labels.tables()
    if not is_json(path):
        return _read(path)
    file = _read(path)
    if _is_solution(file) and isinstance(file.get("materials"), dict):
        return file["materials"]
    if (
        not _is_solution(file)
        and {"materials", "parameters", openmaterial.PROPERTIES} & file.keys()
    ):
        return {Path(path).stem: dict(enumerate(_reports(path)))}
    raise InputError(
        f"{path}: has neither a table 'materials', as the solution of an inversion has, nor "
        "'parameters', as a fit has"
    )


def _is_solution(file):
    return "kind" in file and "unknowns" in file


def _fits(name):
    """The entries of a fit's JSON file."""
    return [_fitted(str(name), report) for report in _reports(name)]


def _reports(name):
    """The reports in a fit's JSON file.

    An OpenMATERIAL has one. Else the file is one report with the keys `parameters`, `form` and
    `band`, or holds one such report for each band in the table `materials`. The solution of an
    inversion has a table of such reports for each of its materials; it must have only one.
    """
    name = str(name)
    file = _read(name)
    if isinstance(file.get(openmaterial.PROPERTIES), dict):
        return [openmaterial.report_of(file, name)]
    reports = file.get("materials", {"": file})
    if not _are_tables(reports):
        raise InputError(f"{name}: key 'materials' must be a table with a fit for each band")
    if _is_solution(file):
        if len(reports) > 1:
            raise InputError(
                f"{name}: contains the materials {', '.join(reports)}; give their file as "
                "`materials` and one of them as `material`"
            )
        reports = next(iter(reports.values()))
    return list(reports.values())


def _check_report(name, report):
    """Raise InputError for a report of a fit that lacks what a material needs."""
    if (kind := report.get("kind", "fit")) != "fit":
        raise InputError(
            f"{name}: its kind is {shown(str(kind))}; a material needs the JSON of a fit"
        )
    if report.get("band", "") is None:
        raise InputError(
            f"{name}: the fitted data had no band; add '# band_um: 3 5' to their file and fit again"
        )
    kinds = {"parameters": dict, "form": str, "band": str}
    with errors_of(name):
        typed({key: report[key] for key in kinds if key in report}, kinds, kinds)


def _fitted(name, report):
    """The entry of one report of a fit."""
    _check_report(name, report)
    keys = {**report["parameters"], "form": report["form"]}
    keys |= {key: report[key] for key in ("model", "sigma") if key in report}
    if isinstance(report.get("source"), str):  # that of a fit are its files
        keys["source"] = report["source"]
    return _entry(f"{name}: parameters", name, report["band"], keys, name)


def _entry(where, name, band, keys, file):
    """A material with checked keys and types, and parameters that a surface can have."""
    from mi_lcair.physics import reflection

    with errors_of(f"{where}, band '{band}'"):
        if band != EVERY_BAND:
            band_of(band)
        model = reflection.model(keys.get("model", reflection.NAMES[0]))
        types = dict.fromkeys(model.names, float) | dict.fromkeys(("model", "form", "source"), str)
        keys = typed(keys, types | {"emits": bool, "sigma": dict}, model.names)
        sigma = keys.get("sigma", {})
        check_known("parameter in sigma", model.names, *sigma)
        for key, value in sigma.items():
            SIGMA.check(value, f"sigma of {key}")
        parameters = {key: keys[key] for key in model.names}
        form = keys.get("form", model.forms[0])
        model.check_form(form)
        model.check_feasible(*parameters.values(), form=form)
    source = keys.get("source", file)
    return NamedMaterial(name, band, model, parameters, form, source, sigma=sigma)


def _cached(where, path, entry):
    """The keys of an entry and the revisions of the files that they name, as a cache's key."""
    for key, value in entry.items():
        parts = value if isinstance(value, list) else [value]
        if any(isinstance(part, (dict, list)) for part in parts):
            raise InputError(
                f"{where}: {key} = {value}; must be a number, a text or a list of them"
            )
    files = [Path(path).parent / text for text in entry.values() if isinstance(text, str)]
    keys = tuple((key, tuple(v) if isinstance(v, list) else v) for key, v in entry.items())
    return keys, tuple(map(revision, files))


@lru_cache(maxsize=32)
def _spectral(where, name, folder, keys, revisions):
    """The material of an entry [NAME.spectral]; its band are the limits of its rows."""
    from mi_lcair.physics.spectra.parameters import spectral_parameters

    def fit(path):
        reports = _fits(path)
        if len(reports) > 1:
            raise InputError(f"shape '{path}': contains {len(reports)} fits; give the file of one")
        return reports[0]

    spectrum = spectral_parameters(where, dict(keys), folder, fit)
    first, last = spectrum.wavelengths_um[[0, -1]]
    weights = np.gradient(spectrum.wavelengths_um)
    weights[[0, -1]] /= 2  # the trapezoidal rule
    values = spectrum.averaged(spectrum.wavelengths_um, weights)
    parameters = dict(zip(spectrum.model.names, values))
    band = f"{first:.12g}-{last:.12g}"
    form, source = spectrum.form, spectrum.source
    return NamedMaterial(name, band, spectrum.model, parameters, form, source, spectrum)


def _read(path) -> dict:
    """The table in a TOML or JSON file, which the caller must not change."""
    return _parsed(path, revision(path))


@lru_cache(maxsize=32)
def _parsed(path, revision):
    """The table in a file; the revision in the cache's key makes an edited file be read again."""
    what = f"materials file {path}"
    table = (parse_json if is_json(path) else parse_toml)(read_text(path, what), what)
    if not isinstance(table, dict):
        raise InputError(f"{what}: must be a table of keys")
    return table
