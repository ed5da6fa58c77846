"""Intensity of a scene toward an orthographic sensor, with and without the background."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from itertools import count
from typing import TYPE_CHECKING, Any

import numpy as np

from mi_lcair.charts import BarChart, BarCharts, label
from mi_lcair.declared import percent
from mi_lcair.files import FACET_FILES
from mi_lcair.plugins.paths.launch import Aim
from mi_lcair.plugins.recorders.channels import PARTS as SPLITS
from mi_lcair.plugins.recorders.channels import Channels
from mi_lcair.rendering.facets import FacetTable
from mi_lcair.rendering.facets import write_vtk as write_vtk_of_facets
from mi_lcair.rendering.measurands import ExcessFunction, IntensityInterval, Measurands
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.reflections import (
    counts,
    followed_row,
    left_out,
    share_left_out,
    words_on_left_out,
)
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import WHOLES, Totals, invalid_remark
from mi_lcair.rendering.window import Windows, window, window_area
from mi_lcair.results import Result, columns_of, details, entry
from mi_lcair.sections import (
    Part,
    Remarks,
    Section,
    Table,
    error_row,
    heading,
    interval,
    interval_rows,
    part_cell,
)
from mi_lcair.signatures.effective_areas import (
    PARTS,
    EffectiveAreas,
    effective_areas,
    spectrum_section,
)
from mi_lcair.signatures.facets import FacetResults, FacetSums

if TYPE_CHECKING:
    from mi_lcair.rendering.scene import Scene as MiScene


# The intensities that `signature` returns
# ----------------------------------------

WATTS = "W sr-1"
# Parts of an intensity: their names, titles and axes
KINDS = (
    ("bounce", "by number of reflections", "number of reflections"),
    ("group", "by what emitted it", "group that emits"),
    ("seen", "by the group that the sensor sees", "group that is seen"),
)


@dataclass(frozen=True)
class Intensity:
    """Intensity toward the sensor, W/sr, and its parts, which are empty if they are not recorded.

    Attributes
    ----------
    intensity, standard_error : float
        Intensity and its standard error, W/sr.
    half_width : float
        Half of the 95 % interval of the intensity, W/sr.
    by_bounce, by_bounce_error : list of float
        Part of the paths with 0, 1, ... max_bounces reflections, W/sr, and its standard error. The
        last entry contains all reflections from the 64th on. Together with `closure` they add up to
        the intensity.
    by_group, by_group_error : dict of str to float
        Part that each group emitted, W/sr, and its standard error.
    by_seen, by_seen_error : dict of str to float
        Part of the pixels that show each group, W/sr, and its standard error.
    closure : float or None
        Estimate of the reflections beyond max_bounces, W/sr. It is included in `intensity`. None
        without `by_bounce`.
    left_out : float or None
        Estimate of the reflections beyond max_bounces that are neither in `intensity` nor in
        `half_width`, W/sr; with closure = tail an estimate of its error. It comes from `by_bounce`,
        continued by a geometric series, or from a test run. None if neither is known.
    """

    intensity: float
    standard_error: float
    half_width: float
    by_bounce: list[float]
    by_bounce_error: list[float]
    by_group: dict[str, float]
    by_group_error: dict[str, float]
    by_seen: dict[str, float]
    by_seen_error: dict[str, float]
    closure: float | None = None
    left_out: float | None = None

    @property
    def up_to_bounce(self) -> list[float]:
        """Intensity of the paths with at most 0, 1, ... reflections, W/sr: sums of `by_bounce`."""
        return np.cumsum(self.by_bounce).tolist()

    def rows(self) -> dict[tuple[str, str], tuple[float, float]]:
        """Values and standard errors, W/sr, of the whole and of each part by what and name."""
        parts = {
            "bounce": zip(map(str, count()), self.by_bounce, self.by_bounce_error),
            "group": zip(self.by_group, self.by_group.values(), self.by_group_error.values()),
            "seen": zip(self.by_seen, self.by_seen.values(), self.by_seen_error.values()),
        }
        rows = {(of, name): pair for of, part in parts.items() for name, *pair in part}
        return {("all", ""): (self.intensity, self.standard_error)} | rows

    def as_dict(self) -> dict:
        """The entries for JSON, all in W/sr."""
        entries = asdict(self) | {"up_to_bounce": self.up_to_bounce}
        return {f"{name}_W_sr": value for name, value in entries.items()}


def facts_of_entries(entries: dict, others: Sequence[Part | Section] = ()) -> Iterator[Any]:
    """Yield the facts of a signature from the dictionary of its JSON. `others`: its facets."""
    parts = [entries[name] for name in PARTS]
    main = entries[entries["main_part"]]
    yield (
        "The target is the radiation from the model's facets. The scene is everything in the "
        "sensor's window. Errors in the tables are standard errors. For a part that is smaller "
        "than its error, the upper end of its 95 % interval is given."
    )
    error = interval(
        main["half_width_W_sr"],
        main["intensity_W_sr"],
        "W/sr",
        f"the {entries['main_part']}'s intensity",
    )
    yield "band", entries["band"]
    for name, part in zip(PARTS, parts):
        yield (
            name,
            f"{part['intensity_W_sr']:.6g} W/sr +- {part['half_width_W_sr']:.2g} (95 %), "
            f"standard error {part['standard_error_W_sr']:.2g}",
        )
    left_out = remark_on_left_out(main, entries["tolerance"])
    remedy = "raise max_bounces" if left_out else ""
    yield error_row(error, entries["tolerance"], entries["reached"], remedy=remedy)
    yield from interval_rows(main["half_width_W_sr"], main["standard_error_W_sr"])
    yield "paths", entries["paths"]
    if entries.get("followed"):
        beyond, share = main.get("left_out_W_sr"), None
        if beyond is not None and not main["closure_W_sr"]:  # of which it would be the error
            share = beyond / ((main["intensity_W_sr"] + beyond) or 1.0)
        yield followed_row(entries["followed"], share)
    if entries.get("bins"):
        yield "wavelengths", entries["bins"]
    both = [("target", WATTS), ("scene", WATTS)]
    if rows := by_bounce(parts):
        yield Table(["reflections", both[0], "up to these", both[1], "up to these"], rows)
    for key, title in (("by_group", "emitted by"), ("by_seen", "seen first")):
        names = f"{key}_W_sr", f"{key}_error_W_sr"
        rows = [
            [label, *(cell_of(part, *(part[name][label] for name in names)) for part in parts)]
            for label in entries["scene"][names[0]]
        ]
        if rows:
            yield Table([title, *both], rows)
    yield Remarks(invalid_remark(entries["invalid"], entries["paths"]) + left_out)
    if "spectrum" in entries:
        yield spectrum_section(columns_of(entries["spectrum"]))
        rows = entries["effective_areas"]
        heads = [heading(name) for name in rows[0]] if rows else []
        yield Section("Effective areas", [Table(heads, [list(row.values()) for row in rows])])
    yield from others
    yield details(entries, "How the signature was made")


def remark_on_left_out(whole: dict, tolerance: float | None) -> list[str]:
    """A remark if what is left out beyond max_bounces is more than the error, or than allowed."""
    intensity, beyond = whole["intensity_W_sr"], whole.get("left_out_W_sr") or 0.0
    if not beyond or not counts(
        beyond / intensity, whole["half_width_W_sr"] / intensity, tolerance
    ):
        return []
    worth = f"{beyond:.2g} W/sr ({percent(beyond / intensity)})"
    if whole["closure_W_sr"]:
        remedy = "raise max_bounces"
        return [f"the contribution of closure = tail may be wrong by up to about {worth}; {remedy}"]
    return [words_on_left_out(worth)]


def cell_of(whole: dict, value: float, error: float) -> object:
    """A cell of a part of target or scene, which is no more than that."""
    return part_cell(value, error, whole["intensity_W_sr"] + whole["half_width_W_sr"])


def by_bounce(wholes: list[dict]) -> list[list]:
    """Rows by number of reflections, and their sums, of target and scene.

    The last ones are one row if all of them are less than their errors. No scatter of a part is
    larger than the part, and a source that no path has hit counts once, for the largest error.
    """
    names = "by_bounce_W_sr", "by_bounce_error_W_sr", "up_to_bounce_W_sr"
    values, errors, sums = (np.array([whole[name] for whole in wholes]) for name in names)
    if not values.size:
        return []
    last = values.shape[1] - 1
    is_known = np.flatnonzero((values >= errors).any(axis=0))
    first = min(is_known[-1] + 1, last) if len(is_known) else 0  # of the rows that become one
    labels = list(map(str, range(first + 1)))
    if first < last:
        labels[-1] += f" to {last}"
        rest, largest = values[:, first:].sum(axis=1), errors[:, first:].max(axis=1)
        values[:, first], errors[:, first], sums[:, first] = (
            rest,
            np.hypot(rest, largest),
            sums[:, -1],
        )
    rows = []
    for k, label_of_row in enumerate(labels):
        pairs = ((cell_of(w, v[k], e[k]), s[k]) for w, v, e, s in zip(wholes, values, errors, sums))
        rows.append([label_of_row, *(cell for pair in pairs for cell in pair)])
    return rows


@dataclass(frozen=True, repr=False)
class Signature(Result):
    """Intensity of a scene toward an orthographic sensor.

    Attributes
    ----------
    scene_name : str
        Name of the scene.
    band : str
        Name of the band.
    scene : Intensity
        Intensity of everything in the sensor's window.
    target : Intensity
        Intensity of the model's facets. It includes sky and terrain that they reflect, but not sky
        and terrain that the sensor sees directly.
    effective_areas : EffectiveAreas or None
        Effective area of each source, if it was requested.
    facets : FacetResults or None
        Results of each facet, if they were requested.
    window_area : float
        Area of the sensor's window, m^2.
    seconds : float
        Time of the render, s.
    paths : int
        Number of paths.
    invalid : int
        Number of samples that were NaN or infinite. They count as 0.
    degrees_of_freedom : int
        Degrees of freedom of all standard errors, see `student_factor`.
    missed : float
        Intensity that a source which no path has hit may add to the target, W/sr.
    systematic : float
        Relative error of every intensity that does not decrease with more paths.
    tolerance : float or None
        Requested tolerance.
    reached : bool or None
        Whether the tolerance was reached, or the criterion `excess` was met; None without them.
    aim : Aim or None
        Where in the window the paths began. Renders with the same aim and number share their paths.
    remarks : sequence of str
        Warnings about the scene, one line each.
    bins : str
        Wavelength bins and their error, in words; empty without spectral materials.
    followed : str
        What the paths follow, in words.
    fewer : tuple of Signature
        The same with fewer reflections, if they were requested, from the same paths.
    """

    scene_name: str
    band: str
    scene: Intensity
    target: Intensity
    effective_areas: EffectiveAreas | None = entry()
    facets: FacetResults | None = entry()
    window_area: float = entry("window_area_m2")
    seconds: float = entry("time_s")
    paths: int
    invalid: int
    degrees_of_freedom: int
    missed: float = entry("missed_W_sr")
    systematic: float
    tolerance: float | None
    reached: bool | None = None
    aim: "Aim | None" = entry(default=None)
    remarks: Sequence[str] = ()
    bins: str = ""
    followed: str = ""
    fewer: "tuple[Signature, ...]" = entry(default=())

    kind = "signature"
    heading = "Intensity"
    computed = {"main_part": "main_part"}
    facts_of = staticmethod(facts_of_entries)
    saved_by = dict.fromkeys(FACET_FILES, f"{__name__}:write_vtk")

    def suffixes(self) -> list[str]:
        """Suffixes of the files that `save` can write; those of ParaView need `facets=True`."""
        known = super().suffixes()
        return [suffix for suffix in known if suffix not in FACET_FILES or self.facets is not None]

    @property
    def main_part(self) -> str:
        """Part that a tolerance refers to: "target", or "scene" if the target is dark."""
        return "target" if self.target.intensity > 0 else "scene"

    @property
    def main(self) -> Intensity:
        """The Intensity of `main_part`."""
        return getattr(self, self.main_part)

    @property
    def intensity(self) -> float:
        """Intensity of `main_part`, W/sr: of the target, or of the scene if the target is dark."""
        return self.main.intensity

    @property
    def standard_error(self) -> float:
        """Standard error of `intensity`, W/sr."""
        return self.main.standard_error

    @property
    def half_width(self) -> float:
        """Half of the 95 % interval of `intensity`, W/sr."""
        return self.main.half_width

    def summary(self) -> str:
        """One line with the intensity of `main_part` and its 95 % interval."""
        return (
            f"signature of {self.scene_name}, {self.band}: {self.main_part} "
            f"{self.intensity:.6g} +- {self.half_width:.2g} W/sr (95 %), {self.paths} paths"
        )

    def entries(self) -> dict:
        """Entries for JSON, with the spectrum and the facets if there are any."""
        areas, facets, more = self.effective_areas, self.facets, {}
        if areas is not None:
            more = {"effective_areas": areas.as_list(), "spectrum": areas.columns()}
        return super().entries() | more | ({} if facets is None else {"facets": facets.columns()})

    def facts(self, scene: "MiScene | None" = None, sensor: int = 0) -> Iterator[Any]:
        """All that a signature holds.

        scene: the scene it was made from, from whose sensor the model is seen at first.
        """
        others = [] if self.facets is None else self.facets.sections(scene=scene, sensor=sensor)
        return facts_of_entries(self.as_dict(), others)

    def picture(self) -> BarCharts:
        """Intensities by number of reflections, by emitter, and by what is seen, or the wholes."""
        parts = {part: getattr(self, part) for part in PARTS}
        charts = []
        for kind, title, places in KINDS:
            of = {part: getattr(value, f"by_{kind}") for part, value in parts.items()}
            errors = {part: getattr(value, f"by_{kind}_error") for part, value in parts.items()}
            if kind != "bounce":
                names = list(of["scene"])
                of, errors = (
                    {part: [values[name] for name in names] for part, values in table.items()}
                    for table in (of, errors)
                )
            else:
                names = list(map(str, range(len(of["scene"]))))
            if names:
                charts.append(BarChart(title, names, label("intensity", WATTS), of, errors, places))
        if not charts:
            of, errors = (
                {part: [getattr(value, name)] for part, value in parts.items()}
                for name in ("intensity", "standard_error")
            )
            charts = [BarChart("", ["all"], label("intensity", WATTS), of, errors, "")]
        value = f"{self.intensity:.6g} ± {self.half_width:.2g} W/sr (95 %)"
        return BarCharts(charts, f"{self.scene_name}, {self.band}: {self.main_part} {value}")

    def columns(self) -> dict[str, np.ndarray]:
        """Intensity of target and scene: all of it, by reflections, by emitter, by what is seen."""
        rows = self.target.rows(), self.scene.rows()
        of, names = zip(*rows[1])
        values = np.array([[part[row] for part in rows] for row in rows[1]], dtype=float)
        return {
            "part": np.array(of),
            "name": np.array(names),
            "target_W_sr": values[:, 0, 0],
            "target_standard_error_W_sr": values[:, 0, 1],
            "scene_W_sr": values[:, 1, 0],
            "scene_standard_error_W_sr": values[:, 1, 1],
        }


def write_vtk(path, signature: Signature) -> None:
    """Write the facets of a signature as a .vtp or .vtu file."""
    write_vtk_of_facets(path, signature.facets)


def measure_signature(
    scene: Scene,
    sampling: Sampling,
    by_spectrum: bool = False,
    facets: bool = False,
    excess: Callable[[Signature], float] | None = None,
    aim: Aim | None = None,
    up_to: tuple[int, ...] = (),
    parts: Sequence[str] = SPLITS,
) -> Signature:
    """Integrate the radiance of a loaded scene over a sensor's window, under its own settings.

    Parameters
    ----------
    scene : Scene
    sampling : Sampling
        Its tolerance is half of the 95 % interval of the intensity, as a fraction of it.
    by_spectrum : bool
        Whether to compute the effective area of each source.
    facets : bool
        Whether to compute the results of each facet of the model.
    excess : callable or None
        Instead of a tolerance: ratio of the error to the allowed error, see `Criterion`.
    aim : Aim or None
        Where in the window the paths begin, see `measure`.
    up_to : tuple of int
        Smaller numbers of reflections for `fewer` of the signature. They need `by_spectrum`.
    parts : sequence of str
        What intensities are split by, see `Channels`.
    """
    if by_spectrum:
        scene.band.check_limits(f"{scene.name}: spectrum")
    start = time.perf_counter()
    camera = scene.sensor(sampling.sensor)
    area = window_area(camera, scene.name)

    # A function that calls itself would keep the scene until the garbage collector runs, and Dr.Jit
    # compiles kernels for all scenes that are alive.
    def with_fewer(total: Totals, fewer: tuple[Signature, ...]) -> Signature:
        return Signature(
            scene_name=scene.name,
            band=scene.band.label,
            **intensities(total, area, parts, scene.mi.integrator().max_bounces),
            effective_areas=effective_areas(total, scene, area) if by_spectrum else None,
            facets=None,
            window_area=area,
            seconds=time.perf_counter() - start,
            paths=int(total.traced.sum()),
            invalid=total.invalid,
            degrees_of_freedom=total.randomisations - 1,
            missed=float(total.missed("target")[0] * area),
            systematic=total.systematic,
            reached=total.reached,
            tolerance=sampling.tolerance,
            aim=total.aim,
            bins=total.bins,
            followed=total.followed,
            remarks=scene.notes,
            fewer=fewer,
        )

    def result(total: Totals) -> Signature:
        return with_fewer(total, tuple(with_fewer(total.up_to(most), ()) for most in up_to))

    criterion = None
    if excess is not None:
        criterion = ExcessFunction(lambda total: excess(result(total)))
    elif sampling.tolerance is not None:
        criterion = IntensityInterval(sampling.tolerance)
    sums = FacetSums(FacetTable(scene), scene.mi.integrator().max_bounces) if facets else None
    used = {*parts, *(["group"] if by_spectrum else []), *(["bounce"] if up_to else [])}
    split = tuple(part for part in SPLITS if part in used)
    measurands = Measurands(Channels("target", split, up_to=up_to), sums, by_spectrum)
    # A caller with a criterion of its own takes the aim to other scenes
    windows = replace(Windows.whole(camera), may_follow_facets=excess is None)
    total = measure(scene, windows, sampling, measurands, criterion, aim)
    found = result(total)
    if not facets:
        return found
    *_, direction = window(camera)
    return replace(found, facets=sums.results(scene, total, area, -direction))


def with_left_out(found: Signature, scene: Scene, sampling: Sampling) -> Signature:
    """The signature, with a remark if reflections beyond max_bounces are left out that count."""
    main = found.main
    known = None if main.left_out is None or not main.intensity else main.left_out / main.intensity
    if (share := share_left_out(scene, sampling, known=known)) not in (None, known):
        main = replace(main, left_out=main.intensity * share / (1 - share))
        found = replace(found, **{found.main_part: main})
    if left_out := remark_on_left_out(main.as_dict(), found.tolerance):
        reached = None if found.tolerance is None else False
        found = replace(found, reached=reached, remarks=[*found.remarks, *left_out])
    return found


def intensities(
    total: Totals, area: float, parts: Sequence[str], most: int
) -> dict[str, Intensity]:
    """The Intensity of the scene and of the target.

    Parameters
    ----------
    total : Totals
        Sums over the paths of one window.
    area : float
        Area of the sensor's window, m^2.
    parts : sequence of str
        What they are split by, see `Channels`.
    most : int
        Largest number of reflections.
    """
    kinds = "target", *parts, *(["closure"] if "bounce" in parts else [])
    channels = [name for name in total.sums if name.removeprefix("target.").startswith(kinds)]
    channels.insert(0, None)
    means, errors = (
        (numbers[:, 0] * area).tolist()
        for numbers in (total.mean(channels), total.standard_error(channels))
    )
    half_widths = (total.half_width(list(WHOLES))[:, 0] * area).tolist()
    found = {}
    for whole, half_width, places in zip(WHOLES, half_widths, places_of(*channels)):
        split = {}
        for kind, *_ in KINDS:
            for name, numbers in ((f"by_{kind}", means), (f"by_{kind}_error", errors)):
                of_labels = {label: numbers[place] for label, place in places[kind].items()}
                split[name] = list(of_labels.values()) if kind == "bounce" else of_labels
        place, closure = channels.index(whole), places["closure"]
        if closure:
            of_bounces = split["by_bounce"], split["by_bounce_error"]
            split["closure"] = means[closure[""]]
            split["left_out"] = left_out(*of_bounces, most)
            if total.tail is not None:
                split["left_out"] = total.tail.error(most) * area
        found[whole or "scene"] = Intensity(
            intensity=means[place],
            standard_error=errors[place],
            half_width=half_width,
            **split,
        )
    return found


@lru_cache(64)
def places_of(*channels: str | None) -> list[dict[str, dict[str, int]]]:
    """Places of the parts of each of WHOLES among channels, by kind of part and label."""
    found = []
    for prefix in ("", "target."):
        places = {kind: {} for kind in ("closure", *(kind for kind, *_ in KINDS))}
        for place, channel in enumerate(channels):
            if channel is not None and channel.startswith(prefix):
                kind, _, label = channel.removeprefix(prefix).partition(".")
                places.get(kind, {})[label] = place
        found.append(places)
    return found
