"""The table of signatures that `sweep` returns."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mi_lcair.results import Result, entry
from mi_lcair.results.cells import unit_of
from mi_lcair.results.result import extremes, summary_of
from mi_lcair.results.sections import LongTable
from mi_lcair.sweeps.conditions import Conditions, Value

if TYPE_CHECKING:
    import xarray

GROUPS_K = "temperature."  # beginning of the names of conditions that are temperatures


@dataclass(frozen=True, repr=False)
class Sweep(Result):
    """Signatures over a table of conditions.

    Attributes
    ----------
    conditions : Conditions
        Conditions of the sweep.
    table : dict of str to ndarray, shape (cases,)
        Quantities of each case by name with the unit. The names with standard_error are standard
        errors, those with half_width half of the 95 % intervals.
    views : int
        Number of views that the cases need.
    traced : int
        Number of views that were traced; the others were known.
    seconds : float
        Time of the sweep, s.
    """

    conditions: Conditions = entry()
    table: dict[str, np.ndarray] = entry()
    views: int
    traced: int
    seconds: float = entry("time_s")

    kind = "sweep"
    heading = "Signatures by condition"
    computed = {"columns": "columns"}

    @property
    def missed(self) -> int:
        """Number of cases whose view did not reach the tolerance."""
        return int(np.sum(self.table["reached"] == 0))

    def summary(self) -> str:
        """One line with the conditions, the number of cases, and how many views were traced."""
        values = self.conditions.values
        axes = " x ".join(f"{len(values[name])} {name}" for name in values)
        reached = f", {self.missed} not to the tolerance" if self.missed else ""
        return (
            f"sweep {self.conditions.name} over {axes}: {self.conditions.count} cases from "
            f"{self.views} views, {self.traced} of them traced{reached}"
        )

    def entries(self) -> dict:
        """Entries for JSON, with the conditions."""
        base = {"name": self.conditions.name, "conditions": self.conditions.values}
        return base | {"product": self.conditions.base.product} | super().entries()

    def facts(self) -> Iterator[Any]:
        """The conditions in one line, the extremes of the quantities, and the table."""
        yield summary_of(self)
        yield extremes(self.table)
        yield LongTable(self.columns())

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each case: its conditions and its quantities."""
        places = self.conditions.places()
        return {
            name: array_of(values)[places[name]] for name, values in self.conditions.values.items()
        } | self.table

    def to_xarray(self) -> "xarray.Dataset":
        """The table as an xarray Dataset, with a dimension for each condition.

        Without product there is one dimension, case. Raises InputError if xarray is not installed.
        """
        values = {name: array_of(list_) for name, list_ in self.conditions.values.items()}
        if self.conditions.base.product:
            axes, shape = tuple(values), self.conditions.shape
            coordinates = {name: ((name,), array) for name, array in values.items()}
        else:
            axes, shape = ("case",), (self.conditions.count,)
            coordinates = {name: (("case",), array) for name, array in values.items()}
        table = {name: (axes, array.reshape(shape)) for name, array in self.table.items()}
        made = self.dataset(table, coordinates)
        for name in values:
            if name.startswith(GROUPS_K):
                made[name].attrs["units"] = "K"
            elif name.rpartition(".")[2] != name and (unit := unit_of(name)):
                made[name].attrs["units"] = unit
        return made

    def attributes(self) -> dict:
        """Attributes of the Dataset, which are the same however the sweep was computed."""
        base = self.conditions.base
        title = f"sweep {self.conditions.name}: {self.conditions.count} cases"
        return {"kind": self.kind, "title": title, "base": base.scene or base.scenario}


def array_of(values: list[Value]) -> np.ndarray:
    """Values of a condition as an array of numbers or of texts."""
    is_number = all(type(value) in (int, float) for value in values)
    return np.array(values, float) if is_number else np.array([str(value) for value in values])
