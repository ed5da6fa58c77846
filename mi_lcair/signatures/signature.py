"""Intensity of a scene toward an orthographic sensor, with and without the background."""

import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.fraction import fraction
from mi_lcair.progress import Progress
from mi_lcair.rendering.facets.table import FacetTable
from mi_lcair.rendering.limits import check_paths, check_samples
from mi_lcair.rendering.render import DEFAULT_MAX_SPP, check_bounded, check_reachable
from mi_lcair.rendering.scene import Scene, SceneLike, scene_of
from mi_lcair.rendering.settings import planned
from mi_lcair.rendering.statistics import Totals
from mi_lcair.rendering.window import window, window_area
from mi_lcair.rendering.window_means import window_means
from mi_lcair.results import Result
from mi_lcair.signatures.effective_areas import EffectiveAreas, effective_areas
from mi_lcair.signatures.facet_results import FacetResults, FacetSums

if TYPE_CHECKING:
    from mi_lcair.planning.plan import Plan


@dataclass(frozen=True)
class Intensity:
    """Intensity toward the sensor, W/sr, and its parts.

    Attributes
    ----------
    intensity, standard_error : float
        Intensity and its standard error, W/sr.
    half_width : float
        Half of the 95 % interval of the intensity, W/sr.
    by_bounce, by_bounce_error : list of float
        Part of the paths with 0, 1, ... max_bounces reflections, W/sr, and its standard error. The
        last entry holds all reflections from the 64th on. With `closure` they add up to the
        intensity.
    by_group, by_group_error : dict of str to float
        Part that each group emitted, W/sr, and its standard error.
    by_seen, by_seen_error : dict of str to float
        Part of the pixels that show each group, W/sr, and its standard error.
    closure : float
        Estimate of the reflections beyond max_bounces, W/sr. It is included in `intensity`.
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
    closure: float

    @property
    def up_to_bounce(self) -> list[float]:
        """Intensity of the paths with at most 0, 1, ... reflections, W/sr: sums of `by_bounce`."""
        return np.cumsum(self.by_bounce).tolist()

    def as_dict(self) -> dict:
        """The entries for JSON, all in W/sr."""
        entries = asdict(self) | {"up_to_bounce": self.up_to_bounce}
        return {f"{name}_W_sr": value for name, value in entries.items()}


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
        Intensity of all that lies in the sensor's window.
    target : Intensity
        Intensity of the model's facets. It includes sky and terrain that they reflect, but not sky
        and terrain that the sensor sees directly.
    effective_areas : EffectiveAreas or None
        Effective area of each source, if it was asked for.
    facets : FacetResults or None
        Results of each facet, if they were asked for.
    window_area : float
        Area of the sensor's window, m^2.
    seconds : float
        Time of the render, s.
    paths : int
        Number of paths.
    invalid : int
        Number of samples that were NaN or infinite, and count as 0.
    degrees_of_freedom : int
        Degrees of freedom of all standard errors, see `student_factor`.
    missed : float
        Intensity that a source which no path has hit may add to the target, W/sr.
    systematic : float
        Relative error of every intensity that more paths do not reduce.
    tolerance : float or None
        Tolerance that was asked for.
    reached : bool or None
        Whether the tolerance was reached, or the criterion `excess` was met; None without them.
    plan : Plan or None
        Plan under whose settings the paths were traced.
    """

    scene_name: str
    band: str
    scene: Intensity
    target: Intensity
    effective_areas: EffectiveAreas | None
    facets: FacetResults | None
    window_area: float
    seconds: float
    paths: int
    invalid: int
    degrees_of_freedom: int
    missed: float
    systematic: float
    tolerance: float | None
    reached: bool | None = None
    plan: "Plan | None" = None

    kind: ClassVar[str] = "signature"
    drawn_by: ClassVar[str] = "mi_lcair.reports.pictures.signature:figure"

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

    def __getattr__(self, name):
        """Raise AttributeError; it says where an entry of Intensity or the spectrum is found."""
        is_of_part = name == "up_to_bounce" or name in Intensity.__dataclass_fields__
        where = f"; see .target.{name} and .scene.{name}" if is_of_part else ""
        if name in ("spectrum", "by_spectrum"):
            where = "; see .effective_areas"
        raise AttributeError(f"a signature has no attribute '{name}'{where}")

    def summary(self) -> str:
        """One line with the intensity of `main_part` and its 95 % interval."""
        return (
            f"signature of {self.scene_name}, {self.band}: {self.main_part} "
            f"{self.intensity:.6g} +- {self.half_width:.2g} W/sr (95 %), {self.paths} paths"
        )

    def entries(self) -> dict:
        """Entries for JSON: "target" and "scene", and what both share."""
        entries = {
            "scene_name": self.scene_name,
            "band": self.band,
            "main_part": self.main_part,
            "target": self.target.as_dict(),
            "scene": self.scene.as_dict(),
            "window_area_m2": self.window_area,
            "missed_W_sr": self.missed,
            "systematic": self.systematic,
            "degrees_of_freedom": self.degrees_of_freedom,
            "time_s": self.seconds,
            "paths": self.paths,
            "invalid": self.invalid,
            "tolerance": self.tolerance,
            "reached": self.reached,
        }
        if self.plan is not None:
            entries["plan"] = self.plan.as_dict()
        if self.effective_areas is not None:
            entries["effective_areas"] = self.effective_areas.as_list()
            entries["spectrum"] = self.effective_areas.columns()
        if self.facets is not None:
            entries["facets"] = self.facets.columns()
        return entries

    def columns(self) -> dict[str, np.ndarray]:
        """Intensity of target and scene: all of it, by reflections, by emitter, by what is seen."""
        parts = (self.target, self.scene)
        rows = [("all", "", [(part.intensity, part.standard_error) for part in parts])]
        for k in range(len(self.scene.by_bounce)):
            rows.append(
                (
                    "bounce",
                    str(k),
                    [(part.by_bounce[k], part.by_bounce_error[k]) for part in parts],
                )
            )
        for of in ("group", "seen"):
            rows += [
                (
                    of,
                    name,
                    [
                        (getattr(part, f"by_{of}")[name], getattr(part, f"by_{of}_error")[name])
                        for part in parts
                    ],
                )
                for name in getattr(self.scene, f"by_{of}")
            ]
        of, names, values = zip(*rows)
        values = np.array(values, dtype=float)  # (rows, target and scene, value and error)
        return {
            "part": np.array(of),
            "name": np.array(names),
            "target_W_sr": values[:, 0, 0],
            "target_standard_error_W_sr": values[:, 0, 1],
            "scene_W_sr": values[:, 1, 0],
            "scene_standard_error_W_sr": values[:, 1, 1],
        }


def signature(
    scene: SceneLike,
    spp: int | None = None,
    tolerance: float | str | None = None,
    max_spp: int | None = None,
    seed: int = 0,
    sensor: int = 0,
    by_spectrum: bool = False,
    facets: bool = False,
    progress: Progress | None = None,
    excess: Callable[[Signature], float] | None = None,
    *,
    parameters: Mapping[str, object] | None = None,
    plan: "Plan | str | None" = None,
) -> Signature:
    """Render a scene and integrate its radiance over the sensor's window.

    The intensity is int L dA, W/sr.

    Parameters
    ----------
    scene : Scene, str, Path or mi.Scene
        A loaded scene, or what `mi_lcair.load` takes: a bundled name, a file, Mitsuba's own scene.
        Its sensor must be orthographic.
    spp : int or None
        Number of paths, divided by the number of pixels of the sensor's film (the number in the
        scene). The paths begin anywhere in the window, not in one pixel each.
    tolerance : float, str or None
        Trace paths until the 95 % interval of the target's intensity is within this fraction of it,
        such as 0.01 or "1%", or until max_spp is reached. Without a target it is that of the
        scene's intensity.
    max_spp : int or None
        As `spp`: the largest number of paths with a tolerance (65536).
    seed, sensor : int
        As for `render`.
    progress : callable or None
        Called with (paths done, paths expected).
    by_spectrum : bool
        Also compute the effective area of each source in the scene.
    facets : bool
        Also compute the results of each facet of the model.
    excess : callable or None
        Instead of a tolerance: ratio of the error to the allowed error for the Signature (without
        facets) that the paths so far give. Paths are added until it is at most 1.
    parameters : mapping of str to object, optional
        Values of the scene's $-parameters, for a name or a file.
    plan : Plan, "auto" or None
        Trace paths under the settings of a plan that `mi_lcair.plan` made; "auto" makes one for the
        tolerance (1 %). The tolerance is then that of plan and noise together.

    Returns
    -------
    Signature

    Raises
    ------
    InputError
        If the sensor is not orthographic, if `by_spectrum` is asked of the band "total", if a
        number of paths is given beside a tolerance, or if a tolerance cannot be reached.
    """
    scene, tolerance = scene_of(scene, parameters), fraction(tolerance)
    with planned(scene, plan, False, spp, tolerance, seed, sensor, progress) as (made, tolerance):
        result = integrated(
            scene, spp, tolerance, max_spp, seed, sensor, by_spectrum, facets, progress, excess
        )
    return replace(result, plan=made)


def integrated(
    scene: Scene,
    spp: int | None,
    tolerance: float | None,
    max_spp: int | None,
    seed: int,
    sensor: int,
    by_spectrum: bool,
    facets: bool,
    progress: Progress | None,
    excess: Callable[[Signature], float] | None,
) -> Signature:
    """The intensity of a loaded scene under its own settings; see `signature`."""
    check_samples(spp, tolerance, max_spp, excess)
    if by_spectrum and scene.band.is_total:
        raise InputError(
            f"{scene.name}: band total has no wavelengths, so that its intensity has no spectrum; "
            "choose a band with limits"
        )
    start = time.perf_counter()
    camera = scene.sensor(sensor)
    area = window_area(camera, scene.name)
    pixels = int(np.prod(camera.film().crop_size()))
    adaptive = tolerance is not None or excess is not None
    if not adaptive:
        spp = spp or camera.sampler().sample_count()
    check_paths(pixels, spp=spp, max_spp=max_spp)
    sums = FacetSums(FacetTable(scene), scene.mi.integrator().max_bounces) if facets else None
    with scene.prepared(by_spectrum) as tracer:
        if tolerance is not None:
            check_reachable(tolerance, tracer, scene.name, of_interval=True)
        elif adaptive:
            check_bounded(tracer.emitters, scene.name)
        sources = tracer.emitters.sources

        def result(total: Totals) -> Signature:
            return Signature(
                scene_name=scene.name,
                band=scene.band.name,
                scene=intensity(total, "", area),
                target=intensity(total, "target.", area),
                effective_areas=effective_areas(total, sources, scene, area)
                if by_spectrum
                else None,
                facets=None,
                window_area=area,
                seconds=time.perf_counter() - start,
                paths=int(total.traced.sum()),
                invalid=total.invalid,
                degrees_of_freedom=total.randomisations - 1,
                missed=float(total.missed("target")[0] * area),
                systematic=total.systematic,
                tolerance=tolerance,
            )

        if excess is None:
            ratio = lambda total: excess_of_intensity(total, tolerance)
        else:
            ratio = lambda total: excess(result(total))
        total = window_means(
            scene,
            tracer,
            camera,
            paths=spp and spp * pixels,
            excess=ratio,
            most_paths=(max_spp or DEFAULT_MAX_SPP) * pixels,
            seed=seed,
            facets=sums,
            progress=progress,
        )
    *_, direction = window(camera)
    return replace(
        result(total),
        facets=sums.results(scene.name, scene.band.name, area, -direction) if facets else None,
        reached=ratio(total) <= 1 if adaptive else None,
    )


def excess_of_intensity(total: Totals, tolerance: float) -> float:
    """Ratio of the 95 % interval of the target's mean radiance to the tolerance.

    Without a target it is that of the scene's mean radiance.
    """
    name = "target" if total.mean("target")[0] > 0 else None
    allowed = tolerance * total.mean(name)[0]
    return float(total.half_width(name)[0] / allowed) if allowed > 0 else np.inf


def intensity(total: Totals, prefix: str, area: float) -> Intensity:
    """The Intensity whose parts have channels with a common prefix.

    Parameters
    ----------
    total : Totals
        Sums over the paths of one window.
    prefix : str
        "" for the scene, "target." for the target.
    area : float
        Area of the sensor's window, m^2.
    """
    whole = prefix.removesuffix(".") or None
    mean = lambda name: float(total.mean(name)[0] * area)
    error = lambda name: float(total.standard_error(name)[0] * area)

    def split(kind):
        """Values and standard errors of the parts of one kind, by name."""
        names = [name for name in total.sums if name.startswith(prefix + kind)]
        label = len(prefix + kind)
        return {name[label:]: mean(name) for name in names}, {
            name[label:]: error(name) for name in names
        }

    by_bounce, by_bounce_error = split("bounce.")
    by_group, by_group_error = split("group.")
    by_seen, by_seen_error = split("seen.")
    return Intensity(
        intensity=mean(whole),
        standard_error=error(whole),
        half_width=float(total.half_width(whole)[0] * area),
        by_bounce=list(by_bounce.values()),
        by_bounce_error=list(by_bounce_error.values()),
        by_group=by_group,
        by_group_error=by_group_error,
        by_seen=by_seen,
        by_seen_error=by_seen_error,
        closure=mean(f"{prefix}closure"),
    )
