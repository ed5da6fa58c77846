"""What is traced in a sweep: a scene as one combination of conditions makes it."""

import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from hashlib import sha256
from math import isfinite, prod
from os import PathLike
from pathlib import Path

import mitsuba as mi
import numpy as np

import mi_lcair
from mi_lcair import formats, toml_table
from mi_lcair.declared import Described, entry, fraction, needs, one_of
from mi_lcair.detection.irradiance import AirOfLight
from mi_lcair.detection.scenario import Scenario
from mi_lcair.detection.setting import Sightline, line_of, sun_over, target_scene
from mi_lcair.errors import InputError, errors_of, shortened
from mi_lcair.extras import optional
from mi_lcair.files import check_writable
from mi_lcair.plugins.emitters.distant_emitter import DistantEmitter
from mi_lcair.plugins.emitters.thermal_emitter import one_sun
from mi_lcair.rendering.parameters.values import check_same, load_with_values, whole_path
from mi_lcair.rendering.reflections import bounce_settings, words_on_paths
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene, set_all
from mi_lcair.rendering.views import Target, View, terrain_remark
from mi_lcair.rendering.window import PASS_SAMPLES
from mi_lcair.signatures.trend import TrendRows
from mi_lcair.signatures.view_areas import ViewAreas, measure_view_areas, of_dataset
from mi_lcair.table import read_table
from mi_lcair.tasks import exclusively
from mi_lcair.toml_table import check_tables, dotted, filled, plain

# The table of conditions of a sweep: what changes, over which values, and how they combine
# -----------------------------------------------------------------------------------------

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
class Base(Described, where="[base]", rules=BASE):
    """Table [base]: what is swept, and whether the conditions form a grid.

    Attributes
    ----------
    scene, scenario : str, optional
        A file or a bundled name. Give either `scene` or `scenario`.
    product : bool
        Whether all combinations of the conditions are computed. Otherwise the first case has the
        first value of each condition, and so on.
    detection_range : bool
        Whether to compute the detection ranges, which need nei of the scenario's [sensor].
    """

    scene: str | None = entry(None, is_file=True)
    scenario: str | None = entry(None, is_file=True)
    product: bool = True
    detection_range: bool = False


@dataclass(frozen=True)
class SamplingTable(Described, where="[sampling]"):
    """Table [sampling].

    Attributes
    ----------
    tolerance : float or str, optional
        Half of the 95 % interval of each intensity, as a fraction of it: 0.01 or "1%", which is
        also the default.
    spp, max_spp : int, optional
        Instead of a tolerance a fixed number of paths for each view (spp), or the largest number
        (max_spp), divided by resolution x resolution.
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
    check_tables(TABLES, tree)
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


VIEWS_AT_ONCE = 256  # views of a batch
Views = ViewAreas | TrendRows  # what is kept of some views


@dataclass(frozen=True)
class Subject:
    """A scene with its parameters, or the scene of a scenario with its settings.

    key: text that tells this subject from others of the sweep. scenario: None for a scene. The
    scenario's range, air and background do not count. given: the scene, if it is loaded.
    """

    key: str
    scene: str = ""
    parameters: tuple[tuple[str, str], ...] = ()
    scenario: Scenario | None = field(default=None, compare=False)
    given: Scene | None = field(default=None, compare=False)

    def load(self) -> Scene:
        """The loaded scene, of which nothing else may change but the air of its light."""
        return self.given or loaded(self, mi.variant())


@lru_cache(maxsize=2)
@exclusively
def loaded(subject: Subject, variant: str) -> Scene:
    """The scene of a subject; the last ones are kept."""
    scenario = subject.scenario
    if scenario is None:
        return load_with_values(subject.scene, dict(subject.parameters))
    scene = target_scene(scenario, scenario.sensor.detector())
    render, observer = scenario.render, scenario.observer
    if render.lobe is not None:
        scene.set_lobe(render.lobe)
    sampling = Sampling(tolerance=render.tolerance, seed=render.seed)
    views = [observer.view]
    integrator = scene.mi.integrator()
    set_all(integrator, bounce_settings(scene, render.most_bounces, False, sampling, views))
    integrator.check()
    return scene


@dataclass(frozen=True)
class Batch:
    """Views of a subject that are traced together: all that a worker must know.

    Attributes
    ----------
    subject : Subject
    fingerprint : str
        Fingerprint of the loaded scene.
    light : AirOfLight or None
        Air of the light of the scene, if it depends on it.
    views : tuple of View
    resolution : int
    sampling : Sampling
    variant : str
        Variant of Mitsuba.
    measure : callable
        `measure_view_areas`, or another function of the same arguments.
    followed : str
        What the paths follow, in words. Results do not depend on it.
    """

    subject: Subject
    fingerprint: str
    light: AirOfLight | None
    views: tuple[View, ...]
    resolution: int
    sampling: Sampling
    variant: str
    measure: Callable = measure_view_areas
    followed: str = ""

    @staticmethod
    def of_views(
        subject: Subject,
        light: AirOfLight | None,
        views: Sequence[View],
        resolution: int,
        sampling: Sampling,
        measure: Callable = measure_view_areas,
    ) -> list["Batch"]:
        """Batches of nearly equal size."""
        most = max(1, min(VIEWS_AT_ONCE, PASS_SAMPLES // resolution**2))
        bounds = np.linspace(0, len(views), -(-len(views) // most) + 1).round().astype(int)
        scene, variant = subject.load(), mi.variant()
        fingerprint, is_open = scene.fingerprint, sampling.spp is None
        if subject.scenario is None:  # whose observer is at its range, and not beyond the terrain
            for low, high in zip(bounds, bounds[1:]):
                for remark in terrain_remark(scene, views[low:high]):
                    warnings.warn(remark, stacklevel=2)
        return [
            Batch(
                subject=subject,
                fingerprint=fingerprint,
                light=light,
                views=tuple(views[low:high]),
                resolution=resolution,
                sampling=sampling,
                variant=variant,
                measure=measure,
                followed=words_on_paths(scene.mi.integrator(), is_open),
            )
            for low, high in zip(bounds, bounds[1:])
        ]

    @property
    def key(self) -> str:
        """32 hexadecimal digits that stand for everything on which the results depend."""
        sampling = replace(self.sampling, progress=None)
        made = (self.fingerprint, self.light, self.views, self.resolution, sampling)
        text = repr((*made, self.variant, mi_lcair.__version__, self.measure.__name__))
        return sha256(text.encode()).hexdigest()[:32]

    @exclusively
    def run(self) -> Views:
        """Trace the views. Raises InputError if the files here give another scene."""
        scene = self.subject.load()
        if scene.fingerprint != self.fingerprint:  # perhaps of a file that has changed since
            loaded.cache_clear()
            scene = self.subject.load()
        check_same(scene, self.fingerprint)
        if self.light is not None:
            self.light.shine_on(scene)
        # The same views have the same random numbers in all subjects, whose differences are then
        # more precise than their values
        views = int(sha256(repr(self.views).encode()).hexdigest()[:16], 16)
        seed = np.random.SeedSequence([self.sampling.seed, views]).generate_state(1)
        sampling = replace(self.sampling, seed=int(seed[0]))
        return self.measure(scene, list(self.views), self.resolution, sampling)


# The folder in which a sweep keeps effective areas, so that nothing is traced twice
# ----------------------------------------------------------------------------------

READERS = {ViewAreas.kind: of_dataset, TrendRows.kind: TrendRows.of_dataset}
BATCH = re.compile(r"[0-9a-f]{32}\.nc")  # names of the files


class AreasFolder:
    """A folder with a netCDF file for each batch of views, which `ViewAreas.read` reads.

    A file appears whole or not at all. Its name stands for everything on which its content depends.
    It states this name and its checksum: a file that does not match is traced again.

    Parameters
    ----------
    path : path-like
        Folder, which is made if it does not exist.

    Raises
    ------
    InputError
        If the folder cannot be written, or if xarray is not installed.
    """

    def __init__(self, path):
        self.path = Path(path)
        optional("xarray", "a folder of effective areas")
        if self.path.exists() and not self.path.is_dir():
            raise InputError(f"'{path}' is no folder; name a folder for effective areas")
        if not self.path.absolute().parent.is_dir():
            raise InputError(f"cannot make '{path}': its folder does not exist; create it first")
        check_writable((self.path if self.path.exists() else self.path.absolute().parent) / "file")

    def file_of(self, batch: Batch) -> Path:
        """The file of a batch."""
        return self.path / f"{batch.key}.nc"

    def read(self, batch: Batch) -> Views | None:
        """What was traced for a batch; None if it is not there, or damaged."""
        path = self.file_of(batch)
        if not path.exists():
            return None
        try:
            dataset = formats.read(path)
            stated = dataset.attrs["batch"], dataset.attrs["checksum"]
            if stated == (batch.key, formats.checksum(dataset)):
                return READERS[dataset.attrs["kind"]](dataset)
        except (InputError, KeyError, ValueError):
            pass
        warnings.warn(f"{path}: does not match its checksum and is traced again", stacklevel=2)
        return None

    def write(self, batch: Batch, traced: Views) -> None:
        """Keep what was traced for a batch."""
        self.path.mkdir(exist_ok=True)
        dataset = traced.to_xarray().assign_attrs(batch=batch.key)
        stated = dataset.assign_attrs(checksum=formats.checksum(dataset))
        formats.write_netcdf(self.file_of(batch), stated)

    def clear(self) -> None:
        """Remove the files of all batches, and the folder if nothing else is in it."""
        if not self.path.exists():
            return
        for path in self.path.iterdir():
            if BATCH.fullmatch(path.name):
                path.unlink()
        if not any(self.path.iterdir()):
            self.path.rmdir()


# Cases of a sweep that share a line of sight, and the subjects and views that they need
# --------------------------------------------------------------------------------------

AZIMUTH, ELEVATION = "azimuth_deg", "elevation_deg"
# Short names of entries of a scenario
ENTRIES = {
    AZIMUTH: "observer.azimuth_deg",
    ELEVATION: "observer.elevation_deg",
    "range_m": "observer.range_m",
    "air": "atmosphere.table",
    "band": "sensor.band",
    "nei": "sensor.nei",
}
TEMPERATURE = "temperature."  # followed by a group, a condition of its own
# Entries of a scenario that change neither geometry nor reflectances
UNTRACED = (
    "atmosphere.",
    "background.",
    "observer.",
    "target.height_m",
    "sensor.nei",
    "sensor.snr",
    "sensor.optics_transmittance",
    "sensor.field_of_view_deg",
)


@dataclass(frozen=True, eq=False)
class Line:
    """Cases that share everything but, perhaps, the azimuth of the observer.

    Attributes
    ----------
    cases : ndarray of int, shape (n,)
        Numbers of the cases.
    views : tuple of View, length n
        View of each case.
    subject : Subject
    light : AirOfLight or None
        Air of the light of the scene, if it depends on it.
    temperatures : dict of str to float
        New temperatures, K, by group.
    sight : Sightline or None
        None for a scene, which has no sensor.
    """

    cases: np.ndarray
    views: tuple[View, ...]
    subject: Subject
    light: AirOfLight | None
    temperatures: dict[str, float]
    sight: Sightline | None = None


def lines_of(conditions: Conditions) -> Iterator[Line]:
    """Yield the lines of a sweep, those of a subject one after the other.

    All conditions are checked: raises InputError for the first one that cannot be used.
    """
    names, places = list(conditions.values), conditions.places()
    azimuth = next((name for name in names if ENTRIES.get(name, name) == ENTRIES[AZIMUTH]), None)
    check_names(conditions)
    # The subjects in the order of the sorted rows
    shared = sorted((name for name in names if name != azimuth), key=lambda name: is_untraced(name))
    rows = np.stack([places[name] for name in shared] + [np.zeros(conditions.count, int)])
    _, firsts, of_case = np.unique(rows, axis=1, return_index=True, return_inverse=True)
    order = np.argsort(of_case.ravel(), kind="stable")
    for first, cases in zip(firsts, np.split(order, np.cumsum(np.bincount(of_case.ravel()))[:-1])):
        values = {name: conditions.values[name][places[name][first]] for name in names}
        azimuths = None
        if azimuth is not None:
            azimuths = [conditions.values[azimuth][places[azimuth][case]] for case in cases]
        stated = ", ".join(f"{name} = {value}" for name, value in values.items())
        with errors_of(f"case {stated}"):
            if conditions.base.scene is None:
                yield from of_scenario(conditions, values, cases, azimuths)
            else:
                yield of_scene(conditions, values, cases, azimuths)


def is_untraced(name: str) -> bool:
    """Whether a condition changes neither geometry nor reflectances."""
    return name.startswith(TEMPERATURE) or ENTRIES.get(name, name).startswith(UNTRACED)


def check_names(conditions: Conditions) -> None:
    """Raise InputError for conditions that are given twice, or that change nothing."""
    names = [ENTRIES.get(name, name) for name in conditions.values]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"[conditions]: {twice} is given twice")
    for name in names:
        if conditions.base.scenario is not None and name.startswith("camera."):
            raise InputError(
                f"[conditions]: {name} belongs to the camera, which does not affect a sweep; "
                "leave it out"
            )


def temperatures_of(values: dict) -> dict[str, float]:
    """Temperatures, K, by group."""
    return {
        name.removeprefix(TEMPERATURE): number(name, value)
        for name, value in values.items()
        if name.startswith(TEMPERATURE)
    }


def of_scene(conditions: Conditions, values: dict, cases, azimuths) -> Line:
    """The line of a scene: views and temperatures."""
    elevation = number(ELEVATION, values.get(ELEVATION, 0.0))
    parameters = {
        name: whole_path(str(value))
        for name, value in values.items()
        if name not in (AZIMUTH, ELEVATION) and not name.startswith(TEMPERATURE)
    }
    pairs = tuple(sorted(parameters.items()))
    source = whole_path(conditions.base.scene)
    views = [View(number(AZIMUTH, a), elevation) for a in azimuths or [0.0] * len(cases)]
    subject = Subject(f"{source} {pairs}", source, pairs)
    return Line(cases, tuple(views), subject, None, temperatures_of(values))


def of_scenario(conditions: Conditions, values: dict, cases, azimuths) -> Iterator[Line]:
    """Yield the lines of a scenario: one, or with a sun one for each azimuth."""
    changes = {
        ENTRIES.get(name, name): value
        for name, value in values.items()
        if not name.startswith(TEMPERATURE)
    }
    source = whole_path(conditions.base.scenario)
    scenario = Scenario.read(source, **changes)
    traced = {
        name: value
        for name, value in changes.items()
        if not is_untraced(name) or scenario.surroundings is not None and name == "atmosphere.table"
    }
    subject = Subject(f"{source} {sorted(traced.items())}", scenario=scenario)
    scene = subject.load()
    sun = sun_over(scenario, scene)
    observer = scenario.observer
    azimuths = np.array(
        [observer.azimuth_deg] * len(cases)
        if azimuths is None
        else [number(AZIMUTH, azimuth) for azimuth in azimuths]
    )
    groups = [np.arange(len(cases))]
    if sun is not None:  # the air scatters sunlight by the angle from the sun
        groups = [np.flatnonzero(azimuths == azimuth) for azimuth in np.unique(azimuths)]
    for group in groups:
        turned = replace(observer, azimuth_deg=float(azimuths[group[0]]), position_m=None)
        yield Line(
            cases[group],
            tuple(View(azimuth, observer.elevation_deg) for azimuth in azimuths[group]),
            subject,
            *sightline(replace(scenario, observer=turned), scene, sun, values),
        )


def sightline(scenario: Scenario, scene: Scene, sun, values: dict) -> tuple:
    """Air of the light, temperatures and line of sight of a scenario with some conditions."""
    detector, target = scenario.sensor.detector(), Target.of(scene)
    target.check_outside(scenario.observer.range_m)
    sight, path, behind = line_of(scenario, detector, sun)
    has_light = any(isinstance(emitter, DistantEmitter) for emitter in scene.mi.emitters())
    light = AirOfLight.of(scenario, sight.target_m) if has_light else None
    rest = {name: v for name, v in values.items() if ENTRIES.get(name, name) != ENTRIES["range_m"]}
    lower_m = "" if sight.observer_m is None else f"{min(sight.observer_m, sight.target_m):.3f}"
    direction = f"{rest} {scenario.observer.azimuth_deg} {lower_m}"
    sun = one_sun(scene.mi.emitters())
    made = Sightline(detector, sight, path, behind, target.radius, sun, direction)
    return light, temperatures_of(values), made


def number(name: str, value) -> float:
    """A condition that must be a number."""
    if type(value) not in (int, float):
        raise InputError(f"{name} = {value!r}; must be a number")
    return float(value)
