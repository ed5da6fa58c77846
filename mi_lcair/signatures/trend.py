"""Rows of a trend: intensities of a scene's model toward many views, and their parts."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mi_lcair import formats
from mi_lcair.charts import Curve, LineChart, LineCharts, label
from mi_lcair.declared import percent
from mi_lcair.errors import InputError, escaped, option
from mi_lcair.extras import named, optional
from mi_lcair.files import parse_json, read_text, replacing
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.reflections import counts, followed_row, words_on_left_out
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.views import View
from mi_lcair.results import Result, entry
from mi_lcair.sections import LongTable, Remarks, Table, error_row
from mi_lcair.signatures.view_areas import FAINT, totals_of_views
from mi_lcair.table import read_table

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class TrendRows:
    """Columns of a trend by name, (V,) each, see `Trend.table`."""

    table: dict[str, np.ndarray]

    kind = "trend_rows"

    @staticmethod
    def joined(parts: list["TrendRows"]) -> "TrendRows":
        """The rows of several sets of views of the same scene as one."""
        return TrendRows(
            {name: np.concatenate([part.table[name] for part in parts]) for name in parts[0].table}
        )

    def to_xarray(self) -> "xarray.Dataset":
        """An array over views and columns, because netCDF does not allow all names of groups."""
        values = {"value": (("view", "column"), np.stack(list(self.table.values()), axis=1))}
        xarray = optional("xarray", "a folder of views")
        return xarray.Dataset(values, {"column": list(self.table)}, {"kind": self.kind})

    @staticmethod
    def of_dataset(dataset: "xarray.Dataset") -> "TrendRows":
        """The rows of a Dataset that `to_xarray` made."""
        names = map(str, dataset["column"].values)
        return TrendRows(dict(zip(names, dataset["value"].values.T)))


def measure_rows(scene: Scene, views: list[View], resolution: int, sampling: Sampling) -> TrendRows:
    """Render some views together, see `totals_of_views`, and return their rows."""
    measurands = Measurands.of("model")
    total, areas = totals_of_views(scene, views, resolution, sampling, measurands)
    columns = {
        "azimuth_deg": [view.azimuth_deg for view in views],
        "elevation_deg": [view.elevation_deg for view in views],
        "intensity_W_sr": total.mean("target") * areas,
        "standard_error_W_sr": total.standard_error("target") * areas,
        "half_width_W_sr": total.half_width("target") * areas,
        "projected_area_m2": total.mean("hit") * areas,
        "paths": total.traced,
        "reached": total.reached_by_window,
        "invalid": np.full(len(views), total.invalid),
    }
    names = [name for name in total.sums if name.startswith(("group.", "bounce.", "closure"))]
    parts = {f"{name}_W_sr": mean for name, mean in zip(names, total.mean(names) * areas)}
    return TrendRows({name: np.array(v, dtype=float) for name, v in (columns | parts).items()})


# The table that `trend` returns
# ------------------------------

NEGLIGIBLE = 1e-3  # parts below this share of the largest intensity are not drawn
KINDS = {"group": "by what emitted it", "bounce": "by number of reflections"}
UNIT = "W sr-1"
COLUMNS = [
    "elevation", "views", ("least", UNIT), "at azimuth", ("mean", UNIT), ("greatest", UNIT),
    "at azimuth",
]  # fmt: skip

KNOWN_BY = "azimuth_deg", "elevation_deg", "intensity_W_sr"  # columns of every trend


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
        How the rows were made. For a CSV it is in the file FILE.csv.json.
    left_out : float or None
        Share of the intensity beyond max_bounces, the largest of some views, from the test run of a
        tolerance. No error includes it.
    followed : str
        What the paths follow, in words.
    """

    scene_name: str
    table: dict[str, np.ndarray] = entry("columns")
    band: str
    tolerance: float | None = None
    made: dict[str, str] = entry(default_factory=dict)
    left_out: float | None = None
    followed: str = ""

    kind = "trend"
    heading = "Intensity by aspect"
    computed = {"reached": "reached"}
    saved_by = {".csv": "mi_lcair.signatures.trend:write_csv"}

    @staticmethod
    def read(path: str | PathLike[str]) -> "Trend":
        """The trend in a .csv or .nc file that `save` or the command `trend` wrote.

        The scene's name and the band of a CSV come from its FILE.csv.json, if there is one. Raises
        InputError for a file of another kind.
        """
        path = Path(path)
        made = settings_of(path)
        needed = KNOWN_BY
        if path.suffix.lower() == ".nc":
            columns = formats.read_netcdf_columns(path)
        else:
            table = read_table(path, needed)
            columns = table.numbers(table.columns, may_lack=True)
        if not set(needed) <= set(columns):
            raise InputError(f"{path}: is no trend, which has the columns {', '.join(needed)}")
        texts = [name for name, values in columns.items() if values.dtype.kind not in "iuf"]
        if texts:
            raise InputError(f"{path}: column '{texts[0]}' has a value that is not a number")
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

    def reached(self) -> bool | None:
        """Whether all views reached the tolerance; None without one."""
        return None if self.tolerance is None else not self.missed

    def facts(self) -> Iterator[Any]:
        """Extremes by elevation, the accuracy, polar curves and the table."""
        yield (
            "Azimuth 0° sees the nose, 90° the left side. Shaded bands are 95 % intervals of the "
            "intensity; its parts have none in the table."
        )
        elevations = dict.fromkeys(np.asarray(self.table["elevation_deg"]).tolist())
        yield Table(COLUMNS, [extremes(self.at_elevation(angle), angle) for angle in elevations])
        yield "band", self.band or "not stated"
        if {"half_width_W_sr", "reached"} <= self.table.keys():
            yield accuracy(self)
        if self.followed:
            yield followed_row(self.followed, self.left_out)
        remarks = []
        if np.any(self.table.get("invalid", 0)):
            remarks.append("some samples were NaN or infinite and count as 0; see column invalid")
        if self.left_out and counts(self.left_out, self.widest, self.tolerance):
            remarks.append(words_on_left_out(percent(self.left_out)))
        yield Remarks(remarks)
        yield self.picture()
        yield LongTable(self.columns())

    def picture(self) -> LineCharts:
        """Polar charts with 95 % intervals: by elevation, and the parts."""
        words = f"{self.scene_name}, {self.band}: intensity of the model"
        title = f"{words} ({label('', UNIT)[2:-1]}) by azimuth"
        return LineCharts(charts(self), title, across=True)

    def to_xarray(self) -> "xarray.Dataset":
        """The table as an xarray Dataset over (elevation_deg, azimuth_deg).

        Raises InputError if xarray is not installed.
        """
        grid = named("mi_lcair.formats:grid")
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


def settings_file(path: Path) -> Path:
    """The JSON file with the settings of a trend's CSV `path`, in the same folder."""
    return path.with_name(f"{path.name}.json")


def write_csv(path: Path, trend: Trend) -> None:
    """Write the table of a trend, and the JSON file with its settings."""
    made = {"scene": trend.scene_name, "band": trend.band} | trend.made
    made = {key: escaped(value) for key, value in made.items()}
    with replacing(settings_file(path)) as partial:
        partial.write_text(json.dumps({"made": made}, indent=2) + "\n", encoding="utf-8")
        formats.write_csv(path, trend.table)


def made_of(path: Path) -> dict[str, Any]:
    """How a table in a .csv or .nc file was made, as far as the file, or FILE.csv.json, says it."""
    if path.suffix.lower() == ".nc":
        return formats.read_attributes(path)
    file = settings_file(path)
    stated = parse_json(read_text(file), str(file)) if file.is_file() else {"made": {}}
    if not isinstance(stated, dict) or not isinstance(stated.get("made"), dict):
        raise InputError(f"{file}: does not say how '{path}' was made; remove it")
    return stated["made"]


def settings_of(path: Path) -> dict[str, str]:
    """Scene's name and band of a trend in a .csv or .nc file, as far as they are known."""
    made = made_of(path)
    return {name: str(made[name]) for name in ("scene", "band") if name in made}


def charts(trend: Trend) -> list[LineChart]:
    """Intensity by elevation, and its parts at the elevation nearest to 0.

    Azimuth 0 (the nose) is up, and 90 (the left side) is on the left. The first view is repeated at
    the end of an even full turn.
    """
    of_view = trend.table["elevation_deg"]
    azimuth, elevations = np.unique(trend.table["azimuth_deg"]).astype(float), np.unique(of_view)
    level = elevations[np.argmin(np.abs(elevations))]
    turn = np.diff(azimuth, append=azimuth[0] + 360)
    is_closed = len(azimuth) > 2 and np.allclose(turn, 360 / len(azimuth), atol=1e-6)
    ends = [0] if is_closed else []

    def over(elevation: float, column) -> np.ndarray:
        """A column at an elevation, by azimuth; NaN where there is no view."""
        rows, values = of_view == elevation, np.full(len(azimuth), np.nan)
        values[np.searchsorted(azimuth, trend.table["azimuth_deg"][rows])] = column[rows]
        return np.append(values, values[ends])

    def chart(title: str, curves: list[Curve]) -> LineChart:
        x = np.append(azimuth, azimuth[ends] + 360)
        return LineChart(title, x, "azimuth (°)", label("intensity", UNIT), curves, is_polar=True)

    intensity = trend.table["intensity_W_sr"]
    half = trend.table.get("half_width_W_sr", np.full(len(intensity), np.nan))
    by_elevation = [
        Curve(f"elevation {angle:g}°", over(angle, intensity), UNIT, k, half=over(angle, half))
        for k, angle in enumerate(elevations)
    ]
    result, least = [chart("by elevation", by_elevation)], NEGLIGIBLE * np.nanmax(intensity)
    for kind, words in KINDS.items():
        parts = {name: over(level, values) for name, values in trend.parts(kind).items()}
        large = {name: of for name, of in parts.items() if np.nanmax(of, initial=0) > least}
        curves = [Curve(name, of, UNIT, k) for k, (name, of) in enumerate(large.items())]
        result += [chart(f"{words}, elevation {level:g}°", curves)] if curves else []
    return result


def accuracy(trend: Trend) -> tuple[str, str]:
    """Row about the widest 95 % interval, and about the tolerance if there is one."""
    views = len(trend.table["reached"])
    widest = f"+- {percent(trend.widest)}" if np.isfinite(trend.widest) else "as wide as it"
    is_narrow = trend.tolerance is not None and trend.widest <= trend.tolerance
    return error_row(
        f"the widest 95 % interval is {widest} of the intensity",
        trend.tolerance,
        not trend.missed,
        where=f"in {trend.missed or views} of {views} views",
        remedy=f"raise {option('max_bounces')}" if is_narrow and trend.left_out else "",
    )


def extremes(trend: Trend, elevation: float) -> list:
    """Row of the table: least, mean and greatest intensity of a trend at one elevation."""
    azimuth, intensity = trend.table["azimuth_deg"], trend.table["intensity_W_sr"]
    low, high = intensity.argmin(), intensity.argmax()
    return [
        f"{elevation:g}",
        len(azimuth),
        f"{intensity[low]:.5g}",
        f"{azimuth[low]:g}",
        f"{intensity.mean():.5g}",
        f"{intensity[high]:.5g}",
        f"{azimuth[high]:g}",
    ]
