"""What a data set has: the tables of a dataset.toml, and the views that they state."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

import numpy as np

from mi_lcair import toml_table
from mi_lcair.declared import Bounds, Described, Rule, entry, listed, needs, one_of, rule
from mi_lcair.errors import InputError, check_known, errors_of
from mi_lcair.estimate import KINDS, Stated, check_sigma
from mi_lcair.table import header_of, read_table
from mi_lcair.toml_table import check_tables, dotted, filled, located, table_of

TABLES = ("base", "views", "draws", "bands", "frames", "splits")
MOST_VIEWS = 1_000_000
NUMBER_OF_VIEWS = {"lower": 1, "upper": MOST_VIEWS}
POLAR, PLACE = ("azimuth_deg", "elevation_deg", "range_m"), ("x_m", "y_m", "z_m")
AIM = ("right_deg", "up_deg", "roll_deg")
GOLDEN = (np.sqrt(5) - 1) / 2  # share of a turn between neighbours of an even spiral
SUM = 1e-6  # largest distance of the sum of the splits from 1
CHOICE, SPREAD = "choice", "sigma"  # words of [draws] beside those of `mi_lcair.estimate`
HOUR = "hour"  # the draw that chooses a row of the heat balance


@dataclass(frozen=True)
class DatasetBase(Described, where="[base]"):
    """Table [base].

    Attributes
    ----------
    scenario : str
        TOML file, or a bundled name, of a scenario with a table [camera].
    heat : str, optional
        File of a heat balance for `mi-lcair heat`. The facets get its temperatures at the `hour` of
        [draws]. If [surroundings] has a sun, the sun of that time is used.
    """

    scenario: str = entry(is_file=True)
    heat: str | None = entry(None, is_file=True)


def of_ends(table: "ViewsTable") -> str | None:
    for name in (*POLAR, *AIM):
        ends = getattr(table, name)
        if ends is not None and (len(ends) > 2 or list(ends) != sorted(ends)):
            return f"{name} = {list(ends)}; give one number, or the two ends between which it lies"
    return None


@dataclass(frozen=True)
class ViewsTable(
    Described,
    where="[views]",
    rules=(
        one_of("sphere", "random", "file"),
        needs("count", "file"),
        rule(lambda t: t.file or t.range_m, "range_m is missing; give the camera's distance in m"),
        rule(
            lambda t: not t.file or not t.range_m,
            "file gives the range of each view; leave range_m out",
        ),
        Rule(of_ends),
    ),
):
    """Table [views]: where the camera is, as the target sees it, see [observer] of a scenario.

    Of two numbers, each view has its own value between them.

    Attributes
    ----------
    sphere : int
        Number of views in evenly spaced directions.
    random : int
        Number of views in random directions, evenly over the sphere.
    file : str
        CSV with a row for each view: azimuth_deg, elevation_deg and range_m, or x_m, y_m and z_m
        from the target, and optionally right_deg, up_deg and roll_deg.
    count : int, optional
        Number of views in even steps along the line through the positions of `file`, instead of one
        view for each row.
    azimuth_deg, elevation_deg : tuple of float
        Limits of the directions of `sphere` or `random`, degrees.
    range_m : tuple of float
        Distance from the target, m.
    right_deg, up_deg, roll_deg : tuple of float
        Pointing of the camera, see [camera] of a scenario, degrees.
    """

    sphere: int | None = entry(None, **NUMBER_OF_VIEWS)
    random: int | None = entry(None, **NUMBER_OF_VIEWS)
    file: str | None = entry(None, is_file=True)
    count: int | None = entry(None, lower=2, upper=MOST_VIEWS)
    azimuth_deg: tuple[float, ...] = entry((0.0, 360.0), lower=-360, upper=720)
    elevation_deg: tuple[float, ...] = entry((-90.0, 90.0), lower=-90, upper=90)
    range_m: tuple[float, ...] | None = entry(None, is_positive=True)
    right_deg: tuple[float, ...] = entry((0.0,), lower=-45, upper=45)
    up_deg: tuple[float, ...] = entry((0.0,), lower=-45, upper=45)
    roll_deg: tuple[float, ...] = entry((0.0,), lower=-180, upper=180)

    def views(self, seed: int) -> list[dict[str, float]]:
        """Direction, range and pointing of each view by name."""
        if self.file is not None:
            return rows_of(self.file, self.count)
        views = []
        for number in range(self.sphere or self.random):
            random = np.random.default_rng([seed, number])
            along, around, *others = random.random(2 + 4)
            if self.sphere:
                along, around = (number + 0.5) / self.sphere, number * GOLDEN % 1
            low, high = np.sin(np.radians(ends(self.elevation_deg)))
            view = {
                "azimuth_deg": between(self.azimuth_deg, around),
                "elevation_deg": float(np.degrees(np.arcsin(low + (high - low) * along))),
            }
            names = ("range_m", *AIM)
            view |= {name: between(getattr(self, name), u) for name, u in zip(names, others)}
            views.append(view)
        return views


def ends(values: tuple[float, ...]) -> tuple[float, float]:
    """Both ends of an entry of one or two numbers."""
    return values[0], values[-1]


def between(values: tuple[float, ...], share: float) -> float:
    """The number at a share of the way from the first to the last."""
    first, last = ends(values)
    return float(first + (last - first) * share)


def rows_of(file: str, count: int | None) -> list[dict[str, float]]:
    """The views of a CSV; see `ViewsTable`."""
    names = header_of(file, Path(file).read_text("utf-8"), POLAR) if Path(file).is_file() else []
    needed = PLACE if set(PLACE) & set(names) else POLAR
    table = read_table(file, needed)
    check_known(f"column of {file}", (*needed, *AIM), *table.columns)
    columns = table.numbers(table.columns)
    if needed is POLAR:
        table.check_range("range_m", columns["range_m"], Bounds(is_positive=True))
        table.check_range("elevation_deg", columns["elevation_deg"], Bounds(lower=-90, upper=90))
    if count is not None or needed is PLACE:
        columns = placed(columns)
        if count is not None:
            with errors_of(file):
                columns = in_steps(columns, count)
        x, y, z = (columns.pop(name) for name in PLACE)
        polar = np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))
        range_m = np.linalg.norm([x, y, z], axis=0)
        columns = dict(zip(POLAR, (*np.degrees(polar), range_m))) | columns
    zeros = np.zeros(len(columns["range_m"]))
    columns = dict.fromkeys(AIM, zeros) | columns
    return [dict(zip(columns, map(float, row))) for row in zip(*columns.values())]


def placed(columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The columns with positions in place of directions and ranges."""
    if "x_m" in columns:
        return columns
    azimuth, elevation = (np.radians(columns[name]) for name in POLAR[:2])
    level = np.cos(elevation)
    x, y, z = columns["range_m"] * [
        level * np.cos(azimuth),
        level * np.sin(azimuth),
        np.sin(elevation),
    ]
    rest = {name: values for name, values in columns.items() if name not in POLAR}
    return {"x_m": x, "y_m": y, "z_m": z} | rest


def in_steps(columns: dict[str, np.ndarray], count: int) -> dict[str, np.ndarray]:
    """The columns at places in even steps along the line through the positions."""
    places = np.array([columns[name] for name in PLACE])
    steps = np.linalg.norm(np.diff(places, axis=1), axis=0)
    if not steps.any():
        raise InputError("its positions are all the same, without a line for count; leave it out")
    along = np.concatenate([[0.0], np.cumsum(steps)])
    at = np.linspace(0, along[-1], count)
    return {name: np.interp(at, along, values) for name, values in columns.items()}


@dataclass(frozen=True)
class FramesTable(Described, where="[frames]"):
    """Table [frames].

    Attributes
    ----------
    cases : int
        Number of images of each view, each with new random values. If only temperatures, air and
        background differ, the view is traced once.
    frames : int
        Number of frames of each image, with independent noise. Drift of the camera is assumed to be
        just corrected.
    truth : bool
        Whether the true values of each pixel are written, too.
    kelvin : bool
        Whether frames are also written in kelvin, according to the camera's calibration.
    seed : int
        Seed of all random values. A view depends only on the seed and on its own number.
    """

    cases: int = entry(1, lower=1, upper=10_000)
    frames: int = entry(1, lower=1, upper=10_000)
    truth: bool = True
    kelvin: bool = False
    seed: int = entry(0, lower=0, upper=2**32 - 1)


@dataclass(frozen=True)
class SplitsTable(
    Described,
    where="[splits]",
    rules=(
        rule(
            lambda t: abs(t.train + t.val + t.test - 1) <= SUM,
            "train, val and test are {t.train:g}, {t.val:g} and {t.test:g}; they must add up to 1; "
            "one that is not given is 0.8, 0.1 or 0.1",
        ),
    ),
):
    """Table [splits]: shares of the views, of which all frames are in one split.

    Attributes
    ----------
    train, val, test : float
        Shares of the views. They must add up to 1.
    """

    train: float = entry(0.8, lower=0, upper=1)
    val: float = entry(0.1, lower=0, upper=1)
    test: float = entry(0.1, lower=0, upper=1)

    def of_views(self, count: int, seed: int) -> list[str]:
        """The split of each view."""
        names = ("train", "val", "test")
        until = np.rint(np.cumsum([self.train, self.val, self.test]) * count)
        places = np.searchsorted(until, np.arange(count), side="right")
        order = np.random.default_rng([seed, count]).permutation(count)
        return [names[place] for place in places[order]]


@dataclass(frozen=True)
class DatasetDescription:
    """The tables of a data set.

    Attributes
    ----------
    base, views, frames, splits
        Its tables.
    draws : dict
        What [draws] states, by dotted name.
    bands : dict of str to dict
        Changes of the scenario in each band, by the band's name; one without a name if the file
        has no [bands].
    name : str
        Name of the file.
    tree : dict
        The tables as they were given.
    """

    base: DatasetBase
    views: ViewsTable
    draws: dict[str, Stated]
    bands: dict[str, dict] = field(default_factory=lambda: {"": {}})
    frames: FramesTable = FramesTable()
    splits: SplitsTable = SplitsTable()
    name: str = "dataset"
    tree: dict = field(default_factory=dict)

    @staticmethod
    def read(source: str | PathLike[str] | Mapping) -> "DatasetDescription":
        """The description of a TOML file, or of a dictionary of its tables.

        Paths in the file are relative to its folder, those of a dictionary to the working folder.
        Raises InputError if anything cannot be used.
        """
        return toml_table.read(source, described_set, "dataset")


def described_set(tree: Mapping, folder: Path, name: str) -> DatasetDescription:
    """The description of the tables of a file in a folder."""
    check_tables(TABLES, tree)
    stated = table_of(tree, "bands")
    bands = {
        band: {k: located(folder, v) for k, v in dotted(table_of(stated, band)).items()}
        for band in stated
    }
    for band in bands:
        if not band.replace("-", "").replace("_", "").replace(".", "").isalnum():
            raise InputError(
                f"[bands]: '{band}' is the name of a folder; use letters, digits, '-', '_' and '.'"
            )
    base = filled(DatasetBase, tree.get("base", {}), "[base]", folder)
    draws = dotted(table_of(tree, "draws"), (*KINDS, CHOICE))
    with errors_of("[draws]"):
        for key, law in draws.items():
            check_draw(key, law)
            if is_choice(law):
                draws[key] = {CHOICE: located(folder, law[CHOICE])}
            for band, changes in bands.items():
                if key in ("sensor.band", *changes):
                    raise InputError(f"{key} is that of band '{band}' of [bands]; leave one out")
        if (HOUR in draws) != (base.heat is not None):
            raise InputError("hour needs heat of [base]; give both or neither")
    return DatasetDescription(
        base=base,
        views=filled(ViewsTable, tree.get("views", {}), "[views]", folder),
        draws=draws,
        bands={b: {"sensor.band": b} | changes for b, changes in bands.items()} or {"": {}},
        frames=filled(FramesTable, tree.get("frames", {}), "[frames]"),
        splits=filled(SplitsTable, tree.get("splits", {}), "[splits]"),
        name=name,
        tree=dict(tree),
    )


def is_choice(stated: Stated) -> bool:
    """Whether [draws] states choices."""
    return isinstance(stated, Mapping) and CHOICE in stated


def check_draw(name: str, stated) -> None:
    """Raise InputError for what states neither a distribution nor choices."""
    views = [f"observer.{key}" for key in (*POLAR, "position_m")]
    views += [f"camera.{key}" for key in AIM]
    if name in views or name in ("render.seed", "target.scene"):
        of = "[views]" if name in views else "the data set"
        raise InputError(f"{name} belongs to {of}; leave it out")
    if is_choice(stated):
        values = stated[CHOICE] if isinstance(stated[CHOICE], list) else []
        plain = all(type(value) in (str, int, float, bool) for value in values)
        if len(stated) > 1 or not values or not plain:
            raise InputError(f"{name}: {CHOICE} must be a list of texts or numbers, and alone")
    elif stated != SPREAD:
        if isinstance(stated, str) and "%" not in stated:
            raise InputError(
                f"{name} = '{stated}'; give a number, a text such as \"5 %\", {SPREAD} for "
                f"that of a material, or a table with {listed([*KINDS, CHOICE], 'or')}"
            )
        check_sigma(name, stated)
