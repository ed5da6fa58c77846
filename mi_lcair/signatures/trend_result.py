"""The table that `trend` returns."""

import json
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mi_lcair.errors import InputError, escaped
from mi_lcair.files import read_text, replacing
from mi_lcair.formats import csv, netcdf, tables
from mi_lcair.results import Result, named
from mi_lcair.signatures.many_views import FAINT
from mi_lcair.table import read_table

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True, repr=False)
class Trend(Result):
    """Results of a trend, with one row for each view.

    Attributes
    ----------
    scene_name : str
        Name of the scene.
    table : dict of str to ndarray, shape (views,)
        azimuth_deg and elevation_deg of the observer; intensity_W_sr of the model and its
        standard_error_W_sr; half_width_W_sr, half of its 95 % interval; projected_area_m2 of the
        model; paths, their number; reached, 1 if the tolerance was reached or spp was fixed,
        otherwise 0; invalid, the number of NaN or infinite samples of the view's batch, which count
        as 0; and the parts of the intensity, group.LABEL_W_sr and bounce.N_W_sr.
    band : str
        Label of the band.
    tolerance : float or None
        Tolerance of the intensities; None if spp was fixed.
    made : dict of str to str
        How the rows were made. A CSV has it in a file beside it, FILE.csv.json.
    """

    scene_name: str
    table: dict[str, np.ndarray]
    band: str
    tolerance: float | None = None
    made: dict[str, str] = field(default_factory=dict)

    kind = "trend"
    saved_by = {".csv": "mi_lcair.signatures.trend_result:write_csv"}

    @staticmethod
    def read(path: str | PathLike[str]) -> "Trend":
        """The trend in a .csv or .nc file that `save` or the command `trend` wrote.

        The scene's name and the band of a CSV are in the file beside it, if there is one. Raises
        InputError for a file of another kind.
        """
        path = Path(path)
        made = stated(path)
        needed = tables.KNOWN_BY[tables.TREND]
        if path.suffix.lower() == ".nc":
            columns = netcdf.read_columns(path)
        else:
            table = read_table(path, needed)
            columns = table.numbers(table.columns, may_lack=True)
        if not set(needed) <= set(columns):
            raise InputError(f"{path}: is no trend, which has the columns {', '.join(needed)}")
        texts = [name for name, values in columns.items() if values.dtype.kind not in "iuf"]
        if texts:
            raise InputError(f"{path}: what column '{texts[0]}' holds is not a number")
        rows = np.isfinite(columns["intensity_W_sr"])  # others are points without a view
        table = {name: values[rows] for name, values in columns.items()}
        return Trend(made.get("scene", path.stem), table, made.get("band", ""))

    @property
    def missed(self) -> int:
        """Number of views that did not reach the tolerance."""
        return int(np.sum(self.table["reached"] == 0))

    @property
    def widest(self) -> float:
        """Largest half width of a view's 95 % interval, as a fraction of its intensity.

        As for the tolerance, views fainter than FAINT of the brightest count as bright as that.
        """
        intensity, half_width = (self.table[f"{name}_W_sr"] for name in ("intensity", "half_width"))
        least = FAINT * intensity.max()
        return float(np.max(half_width / np.maximum(intensity, least))) if least > 0 else np.inf

    def summary(self) -> str:
        """One line with the number of views, the extremes and the widest 95 % interval."""
        intensity, half_width = self.table["intensity_W_sr"], self.table["half_width_W_sr"]
        least, most = int(np.argmin(intensity)), int(np.argmax(intensity))
        return (
            f"trend of {self.scene_name}, {self.band}: {len(intensity)} views, "
            f"{intensity[least]:.5g} +- {half_width[least]:.2g} to "
            f"{intensity[most]:.5g} +- {half_width[most]:.2g} W/sr (95 %)"
        )

    def entries(self) -> dict:
        """Entries for JSON."""
        return {
            "scene_name": self.scene_name,
            "band": self.band,
            "tolerance": self.tolerance,
            "reached": None if self.tolerance is None else not self.missed,
            "columns": self.table,
        }

    def columns(self) -> dict[str, np.ndarray]:
        """The table, with a row for each view."""
        return self.table

    def to_xarray(self) -> "xarray.Dataset":
        """The table as an xarray Dataset over (elevation_deg, azimuth_deg).

        Raises InputError if xarray is not installed.
        """
        grid = named("mi_lcair.formats.netcdf:grid")
        return grid(self.table, ("elevation_deg", "azimuth_deg"), **self.attributes())

    def attributes(self) -> dict:
        """Attributes of the Dataset."""
        return super().attributes() | {"scene": self.scene_name, "band": self.band}

    def at_elevation(self, elevation_deg: float) -> "Trend":
        """The rows whose elevation is `elevation_deg`, degrees."""
        is_there = self.table["elevation_deg"] == elevation_deg
        return replace(self, table={n: values[is_there] for n, values in self.table.items()})

    def parts(self, kind: str) -> dict[str, np.ndarray]:
        """Parts of the intensity, W/sr; `kind` is "group" or "bounce".

        The keys are the labels of the groups or the numbers of reflections.
        """
        return {
            name.partition(".")[2].removesuffix("_W_sr"): values
            for name, values in self.table.items()
            if name.startswith(f"{kind}.")
        }


def beside(path: Path) -> Path:
    """The file beside a trend's CSV `path` that states how its rows were made."""
    return path.with_name(f"{path.name}.json")


def write_csv(path: Path, trend: Trend) -> None:
    """Write the table of a trend, and the file beside it."""
    made = {"scene": trend.scene_name, "band": trend.band} | trend.made
    made = {key: escaped(value) for key, value in made.items()}
    with replacing(beside(path)) as partial:
        partial.write_text(json.dumps({"made": made}, indent=2) + "\n", encoding="utf-8")
        csv.write(path, trend.table)


def stated(path: Path) -> dict[str, str]:
    """Scene's name and band of a trend in a .csv or .nc file, as far as they are stated."""
    made = {}
    if path.suffix.lower() == ".nc":
        made = netcdf.read_attributes(path)
    elif beside(path).exists():
        try:
            made = dict(json.loads(read_text(beside(path)))["made"])
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(
                f"{beside(path)}: does not state how the rows of a trend were made; remove it"
            ) from None
    return {name: str(made[name]) for name in ("scene", "band") if name in made}
