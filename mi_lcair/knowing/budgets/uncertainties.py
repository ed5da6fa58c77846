"""Uncertainties of the quantities behind a result, read from a TOML file.

.. code-block:: toml

    [sigma]                             # standard deviations: in the quantity's unit, or relative
    "self.temperature" = 2.0
    "sky.radiance" = "5 %"
    "lid.temperature" = {uniform = 2}   # another distribution, see `mi_lcair.estimate`

    [scenario]                          # the same for quantities of a contrast scenario
    transmittance = "3 %"
    range_m = 50

    [fits]                              # material = report of a fit, with its correlations
    gloss_black = "gloss_black.json"

    [facets]                            # independent errors of all facets of a group: kelvin, or
    walls = 0.5                         # a CSV facet,sigma_K
    self = "self_sigma.csv"

    [motions]                           # see `mi_lcair.rendering.motions.motion`
    "exhaust.radius" = {groups = ["hot_parts"], scale = [0, 1, 1], each = true}

    [[correlated]]                      # correlations of quantities of [sigma] and [scenario]
    names = ["scenario.transmittance", "scenario.path_radiance"]
    correlation = -0.9                  # of two; or a matrix
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError, check_known
from mi_lcair.estimate import Stated, check_sigma, sigmas
from mi_lcair.files import read_text
from mi_lcair.rendering.motions.table import MOTIONS, Declared, motions_of
from mi_lcair.toml_table import check_tables, read, table_of, tables_of

TABLES = ("sigma", "scenario", "fits", "facets", "correlated", MOTIONS)
OF_A_FIT = ("model", "parameters", "standard_error", "correlation")
# Largest relative difference of a scene's parameter, which is a Float32 number, and a fit's
SAME_VALUE = 1e-4
ROUNDING = 1e-9  # most negative eigenvalue of a correlation matrix, by rounding


@dataclass(frozen=True)
class Correlated:
    """Quantities whose errors are correlated. correlation: (n, n)."""

    names: tuple[str, ...]
    correlation: np.ndarray


@dataclass(frozen=True)
class FittedMaterial:
    """Values and covariance of the parameters of a material, from the report of a fit."""

    file: str
    model: str
    values: dict[str, float]
    covariance: np.ndarray


@dataclass(frozen=True)
class Uncertainties:
    """Uncertainties as the file states them.

    Attributes
    ----------
    source : str
        Name of the file, for messages.
    sigma : dict
        Standard deviation of each quantity by name: a number, or a text such as "5 %". A table is
        another distribution, see `mi_lcair.estimate`.
    correlated : list of Correlated
    fits : dict
        List of the fits in a report (one for each band) by the name of the material.
    facets : dict
        Standard deviation of the temperature of each facet [K], or the path of a CSV, by group.
    motions : dict
        Motions that the scene gets, by name.
    """

    source: str
    sigma: dict[str, Stated]
    correlated: list[Correlated]
    fits: dict[str, list[FittedMaterial]]
    facets: dict[str, float | Path]
    motions: dict[str, Declared]

    @staticmethod
    def read(source) -> "Uncertainties":
        """Read uncertainties from a TOML file, or take them from a dictionary of its tables.

        None stands for those that the materials of a scene state. Paths in the file are relative to
        its folder, those of a dictionary to the working directory. Raises InputError if anything
        cannot be used.
        """
        if isinstance(source, Uncertainties):
            return source
        if source is None:
            return Uncertainties("uncertainties", {}, [], {}, {}, {})
        name = "uncertainties" if isinstance(source, Mapping) else str(source)
        return read(source, lambda tree, folder, _: parsed(tree, name, folder), "uncertainties")


def parsed(tree: Mapping, name: str, folder: Path) -> Uncertainties:
    check_tables(TABLES, tree)
    tables = {table: table_of(tree, table) for table in ("scenario", "fits", "facets")}
    scenario = {f"scenario.{key}": value for key, value in tables["scenario"].items()}
    sigma = sigmas(tree) | scenario
    for key, value in scenario.items():
        check_sigma(key, value)
    correlated = [read_correlated(group, sigma) for group in tables_of(tree, "correlated")]
    fits = {key: read_fit(folder, value, key) for key, value in tables["fits"].items()}
    facets = {}
    for group, value in tables["facets"].items():
        if isinstance(value, Mapping):
            raise InputError(f"[facets]: {group} = {dict(value)}; must be kelvin, or a CSV file")
        if isinstance(value, str):
            facets[group] = folder / value
        else:
            check_sigma(f"facets.{group}", value)
            facets[group] = float(value)
    if not (sigma or fits or facets):
        raise InputError("contains no uncertainties; give [sigma], [scenario], [facets] or [fits]")
    motions = motions_of(tree.get(MOTIONS, {}), folder)
    return Uncertainties(name, sigma, correlated, fits, facets, motions)


def read_correlated(group: Mapping, sigma: Mapping) -> Correlated:
    """A table [[correlated]]."""
    names = group.get("names")
    where = f"[[correlated]] {names}"
    if (
        not isinstance(names, list)
        or len(names) < 2
        or len({str(name) for name in names}) < len(names)
    ):
        raise InputError("[[correlated]]: names must list two or more different quantities")
    if set(group) != {"names", "correlation"}:
        raise InputError(f"{where}: give names and correlation, nothing else")
    matrix = group["correlation"]
    if isinstance(matrix, (int, float)) and len(names) == 2:
        matrix = [[1, matrix], [matrix, 1]]
    try:
        has_words = any(type(number) is bool for number in np.array(matrix, object).flat)
        matrix = np.empty(0) if has_words else np.array(matrix, dtype=float)
    except (TypeError, ValueError):
        matrix = np.empty(0)
    if matrix.shape != (len(names),) * 2 or not np.all(np.isfinite(matrix)):
        raise InputError(f"{where}: correlation must be a matrix of {len(names)} x {len(names)}")
    if missing := [name for name in names if name not in sigma]:
        raise InputError(f"{where}: '{missing[0]}' has no standard deviation")
    if other := [name for name in names if isinstance(sigma[name], Mapping)]:
        raise InputError(f"{where}: the distribution of '{other[0]}' is not normal")
    if not np.all(np.diag(matrix) == 1):
        raise InputError(f"{where}: the diagonal of a correlation matrix is 1")
    if not np.allclose(matrix, matrix.T) or np.linalg.eigvalsh(matrix).min() < -ROUNDING:
        raise InputError(
            f"{where}: the correlation must be symmetric and have no negative eigenvalue"
        )
    return Correlated(tuple(names), matrix)


def read_fit(folder: Path, file, material: str) -> list[FittedMaterial]:
    """The fits in the JSON report of `mi-lcair fit`, one for each band.

    The solution of an inversion has such reports for each of its materials.
    """
    if not isinstance(file, str):
        raise InputError(f"[fits]: {file} must be the name of a fit's JSON file")
    try:
        report = json.loads(read_text(folder / file, f"fit '{file}'"))
        by_band = report.get("materials", {"": report})
        if "kind" in report and "unknowns" in report:
            check_known(f"material of '{file}'", by_band, material)
            by_band = by_band[material]
        reports = list(by_band.values())
        return [fitted_material(file, part) for part in reports]
    except InputError:
        raise
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        raise InputError(
            f"fit '{file}': is not the JSON report of a fit, which has {', '.join(OF_A_FIT)}"
        ) from None


def fitted_material(file: str, report: Mapping) -> FittedMaterial:
    values = {name: float(value) for name, value in report["parameters"].items()}
    errors = np.array([report["standard_error"][name] for name in values], dtype=float)
    correlation = np.array(report["correlation"], dtype=float)
    covariance = correlation * np.outer(errors, errors)
    if covariance.shape != (len(values),) * 2 or not np.all(np.isfinite(covariance)):
        raise ValueError
    return FittedMaterial(file, report["model"], values, covariance)


def of_material(
    fits: list[FittedMaterial], material: str, present: Mapping[str, float]
) -> FittedMaterial:
    """The fit whose parameters are those of a scene's material.

    Raises InputError if there is none: the covariance belongs to another surface.
    """
    for fit in fits:
        if set(fit.values) == set(present) and all(
            np.isclose(present[name], value, rtol=SAME_VALUE, atol=1e-9)
            for name, value in fit.values.items()
        ):
            return fit
    fit = fits[0]
    stated = ", ".join(f"{name} = {value:.4g}" for name, value in fit.values.items())
    has = ", ".join(f"{name} = {value:.4g}" for name, value in present.items())
    raise InputError(
        f"fit '{fit.file}' is of another material: it has {stated}, and {material} of the scene "
        f"has {has}"
    )
