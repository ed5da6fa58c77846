"""The table of conditions of a sweep: what changes, over which values, and how they combine."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from math import isfinite, prod
from os import PathLike
from pathlib import Path

import numpy as np

from mi_lcair import toml_table
from mi_lcair.declared import Table, entry, fraction, needs, one_of
from mi_lcair.errors import InputError, check_known, shortened
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.table import read_table
from mi_lcair.toml_table import dotted, filled, plain

MOST_CASES = 10_000_000  # largest number of cases of a sweep, whose table then takes 1 to 2 GB
RUN = ("from", "to", "step")
COLUMN = ("csv", "column")
TABLES = ("base", "conditions", "sampling")
BASE = (
    one_of("scene", "scenario"),
    needs("detection_range", "scenario", why="a scenario has a sensor"),
)
Value = str | float | int | bool


@dataclass(frozen=True)
class Base(Table, where="[base]", rules=BASE):
    """Table [base]: what is swept, and whether the conditions form a grid.

    Attributes
    ----------
    scene, scenario : str, optional
        One of them: a file, or a bundled name.
    product : bool
        Whether all combinations of the conditions are cases. Otherwise the conditions go together,
        and the first case has the first value of each.
    detection_range : bool
        Whether to compute the detection ranges, which need nei of the scenario's [sensor].
    """

    scene: str | None = entry(None, is_file=True)
    scenario: str | None = entry(None, is_file=True)
    product: bool = True
    detection_range: bool = False


@dataclass(frozen=True)
class SamplingTable(Table, where="[sampling]"):
    """Table [sampling].

    Attributes
    ----------
    tolerance : float or str, optional
        Half of the 95 % interval of each intensity, as a fraction of it: 0.01 or "1%", which is
        also the default.
    spp, max_spp : int, optional
        A fixed number of paths of a view instead, or the largest one, divided by resolution x
        resolution.
    resolution : int
        See spp.
    seed : int
        Seed of the random numbers.
    """

    tolerance: float | str | None = None
    spp: int | None = None
    max_spp: int | None = None
    resolution: int = entry(64, lower=1, upper=8192)
    seed: int = entry(0, lower=0, upper=2**32 - 1)

    def complete(self) -> None:
        if self.spp is None and self.tolerance is None:
            self.derive(tolerance="1%")

    def sampling(self) -> Sampling:
        """The sampling of each view."""
        return Sampling(
            spp=self.spp,
            tolerance=fraction(self.tolerance),
            max_spp=self.max_spp,
            seed=self.seed,
        )


@dataclass(frozen=True)
class Conditions:
    """What a sweep varies.

    Attributes
    ----------
    base : Base
    values : dict of str to list
        Values of each condition by its name.
    sampling : SamplingTable
    name : str
        Name of the sweep.
    """

    base: Base
    values: dict[str, list[Value]]
    sampling: SamplingTable = field(default_factory=SamplingTable)
    name: str = "sweep"

    def __post_init__(self):
        for name, values in self.values.items():
            if not values:
                raise InputError(f"[conditions]: {name} has no values")
            if not all(type(value) in (str, int, float, bool) for value in values):
                raise InputError(f"[conditions]: {name} must have texts or numbers as values")
            if len(set(values)) < len(values) and self.base.product:
                raise InputError(f"[conditions]: {name} has a value twice")
        lengths = {len(values) for values in self.values.values()}
        if not self.base.product and len(lengths) > 1:
            counts = ", ".join(f"{name} {len(values)}" for name, values in self.values.items())
            raise InputError(
                f"[conditions]: without product all need the same number of values: {counts}"
            )
        if self.count > MOST_CASES:
            raise InputError(
                f"[conditions]: {self.count} cases, whose table would take "
                f"{self.count * 150 / 1e9:.3g} GB; at most {MOST_CASES}"
            )

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each condition; without product, the number of cases."""
        lengths = tuple(map(len, self.values.values()))
        return lengths if self.base.product else lengths[:1]

    @property
    def count(self) -> int:
        """Number of cases."""
        return prod(self.shape)

    def places(self) -> dict[str, np.ndarray]:
        """Which of its values each condition has in each case, (cases,)."""
        if not self.base.product:
            return {name: np.arange(self.count) for name in self.values}
        return dict(zip(self.values, np.indices(self.shape).reshape(len(self.shape), -1)))

    @staticmethod
    def read(source: str | PathLike[str] | Mapping) -> "Conditions":
        """Read the conditions of a sweep from a TOML file, or from a dictionary of its tables.

        Paths in the file are relative to its folder, those of a dictionary to the working folder.
        Raises InputError if anything cannot be used.
        """
        return toml_table.read(source, conditions_of, "sweep")


def conditions_of(tree: Mapping, folder: Path, name: str) -> Conditions:
    """The conditions of the tables of a file in a folder."""
    check_known("table", TABLES, *tree)
    stated = tree.get("conditions")
    if not isinstance(stated, Mapping) or not stated:
        raise InputError("[conditions]: is missing; give at least one condition and its values")
    return Conditions(
        base=filled(Base, tree.get("base", {}), "[base]", folder),
        values={
            key: values_of(key, value, folder)
            for key, value in dotted(stated, (*RUN, *COLUMN)).items()
        },
        sampling=filled(SamplingTable, tree.get("sampling", {}), "[sampling]"),
        name=name,
    )


def values_of(name: str, stated, folder: Path) -> list[Value]:
    """The values of a condition: one, a list, {from, to, step}, or a column of a CSV.

    The end of a run is one of its values if a step ends there.
    """
    if not isinstance(stated, Mapping):
        texts = isinstance(stated, str) or not isinstance(stated, Iterable)
        return [stated] if texts else plain(list(stated))
    text = shortened(str(dict(stated)), 100)
    if stated.keys() == set(RUN):
        start, stop, step = (stated[key] for key in RUN)
        numbers = all(type(n) in (int, float) and isfinite(n) for n in (start, stop, step))
        if not numbers or step == 0 or (stop - start) / step < 0:
            raise InputError(
                f"[conditions]: {name} = {text}; from, to and step must be numbers, and step must "
                "lead from the first to the second"
            )
        steps = (stop - start) / step
        if not steps < MOST_CASES:
            raise InputError(f"[conditions]: {name} has {steps:g} values; at most {MOST_CASES}")
        return [start + step * k for k in range(int(steps + 1e-9) + 1)]
    if stated.keys() == set(COLUMN):
        table = read_table(folder / str(stated["csv"]), (stated["column"],))
        place = table.columns.index(stated["column"])
        return [number_or_text(cells[place]) for _, cells in table.rows]
    raise InputError(
        f"[conditions]: {name} = {text}; give a list, {{from, to, step}} or {{csv, column}}"
    )


def number_or_text(cell: str) -> Value:
    """The number that a cell states, or its text."""
    try:
        number = float(cell)
    except ValueError:
        return cell.strip()
    return number if isfinite(number) else cell.strip()
