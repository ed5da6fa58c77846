"""The cheapest settings of a render whose bias stays within a part of the tolerance.

Full fidelity is the whole BRDF of every material and any number of reflections. Probes show what
does not matter for the scene, and a plan leaves it out. A plan may replace a BRDF by a mirror or a
diffuse reflector, follow fewer reflections, continue them geometrically (closure `tail`) or by a
blackbody (closure `ambient`), and sample emitters or not. The number of paths is not planned: the
render goes on until the noise that it measures is within the rest of the tolerance.

All bounds hold with 95 % confidence, as far as the probes can see. A source may be so bright that
one more path that hits it would change the mean. The probes then trace more paths or sample
emitters. If neither settles the question, the plan is refused.

A probe costs time, most of it for compiling its kernel. Whatever can save less than that is not
tried. Both are counted in rays, so that the load of the machine decides nothing.
"""

import time
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass, fields
from typing import ClassVar

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.fraction import percent
from mi_lcair.planning.bounces import check_bounces, fewer_bounces, truncation_error
from mi_lcair.planning.emitter_sampling import cheaper_emitter_sampling
from mi_lcair.planning.lobes import candidates, simpler_lobes
from mi_lcair.planning.probe import Probe, ProbeSeries, Settings
from mi_lcair.planning.reference import (
    LACK_SHARE,
    expected_paths,
    pixel_count,
    reference_probe,
)
from mi_lcair.rendering.measurands import check_bounded
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.window import window_area
from mi_lcair.results import Result

# Shares that all simplifications together may use; noise gets the rest. A larger bias would need
# more additional paths than simplifications save (SAVING). It adds to the noise of an intensity,
# and its square to the squared noise of an image.
INTENSITY_SHARE, PIXEL_SHARE = 0.2, 0.5
# Rays that are traced while a kernel is compiled. Measured: 0.1 s to 0.3 s for a kernel, and ten
# million rays in a second.
KERNEL = 2**21
FOR_AN_IMAGE = "; to plan a render of its image, give each_pixel (--each-pixel)"
DEFAULT_TOLERANCE = 0.01  # error that a plan allows, as a fraction of the mean radiance
SAVING = 0.3  # share of a render's cost that simpler lobes or other emitter sampling may save


@dataclass(frozen=True, repr=False)
class Plan(Result):
    """Settings for a scene, and the error that they are known to leave.

    Attributes
    ----------
    scene_name : str
        Name of the scene.
    lobe : dict of str to str
        Lobe ("brdf", "mirror" or "diffuse") by material, for materials with a fidelity ladder.
    max_bounces : int
        Number of reflections that are followed.
    emitter_sampling : bool
        Whether paths sample emitters at each reflection.
    closure : str
        What stands for the reflections beyond `max_bounces`: "none", "tail" or "ambient".
    ambient_temperature : float or None
        Temperature for the closure "ambient", K.
    tolerance : float
        Error that was allowed, as a fraction of the mean radiance.
    each_pixel : bool
        Whether the error is the rms over the pixels. Otherwise it is that of the target's
        intensity.
    bias : float
        Upper bound (95 %) of the error of these settings, as a fraction of the mean radiance.
    noise_tolerance : float
        Tolerance that is left for noise: the tolerance of the render.
    probe_seconds : float
        Time that finding the plan took, s.
    left_out : list of str
        One line for each thing that the plan leaves out, with the bound of its effect.
    untried : list of str
        One line for each simplification that was not tried, because its probes would take longer
        than it can save.
    """

    scene_name: str
    lobe: dict[str, str]
    max_bounces: int
    emitter_sampling: bool
    closure: str
    ambient_temperature: float | None
    tolerance: float
    each_pixel: bool
    bias: float
    noise_tolerance: float
    probe_seconds: float
    left_out: list[str]
    untried: list[str]

    kind: ClassVar[str] = "plan"
    sections_by: ClassVar[str] = "mi_lcair.reports.sections.plan:sections"

    @property
    def settings(self) -> Settings:
        """The part of the plan that is applied to the scene."""
        return Settings(**{entry.name: getattr(self, entry.name) for entry in fields(Settings)})

    def summary(self) -> str:
        """One line with the settings and the bound of their error."""
        lobes = sorted(set(self.lobe.values()))
        of = "rms over the pixels" if self.each_pixel else "of the target's intensity"
        return (
            f"plan for {self.scene_name}: {self.max_bounces} reflections, closure {self.closure}, "
            f"lobes {', '.join(lobes) or 'none'}, error at most {percent(self.bias)} of the "
            f"mean (95 %), {of}"
        )

    def entries(self) -> dict:
        """Entries for JSON."""
        units = {"ambient_temperature": "ambient_temperature_K", "probe_seconds": "probe_time_s"}
        return {units.get(name, name): value for name, value in vars(self).items()}

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each setting, as texts."""
        rows = {f"lobe of {material or 'unnamed'}": lobe for material, lobe in self.lobe.items()}
        names = ("max_bounces", "emitter_sampling", "closure", "tolerance", "bias")
        rows |= {name: str(getattr(self, name)) for name in (*names, "noise_tolerance")}
        if self.ambient_temperature is not None:
            rows["ambient_temperature_K"] = str(self.ambient_temperature)
        rows |= {f"left out {k}": text for k, text in enumerate(self.left_out, 1)}
        return {"setting": np.array(list(rows)), "value": np.array(list(rows.values()))}

    def applied(self, scene: Scene) -> AbstractContextManager[None]:
        """Context manager that applies the plan's settings to `scene` within the block."""
        return self.settings.applied(scene)


def find_plan(
    scene: Scene, sampling: Sampling, each_pixel: bool = False, renders: float = 1
) -> Plan:
    """Plan a render of a loaded scene.

    Parameters
    ----------
    scene : Scene
    sampling : Sampling
        Its tolerance is the error that is allowed, as a fraction of the mean radiance. Its progress
        is called with (probes done, probes expected).
    each_pixel : bool
        Whether the error is the rms over the pixels.
    renders : float
        Number of renders that the plan is for.

    Raises InputError if no settings that can be probed reach the tolerance.
    """
    tolerance, sensor, progress = sampling.tolerance, sampling.sensor, sampling.progress
    if not renders > 0:
        raise InputError(f"renders = {renders} must be positive")
    if not each_pixel:
        window_area(scene.sensor(sensor), scene.name, FOR_AN_IMAGE)
    start = time.perf_counter()
    with scene.prepared() as tracer:
        check_bounded(tracer.emitters, scene.name)
    given = Settings.of(scene)
    probes = ProbeSeries(scene, each_pixel, sampling.seed, sensor, progress)

    def expected(reference: Probe) -> float:
        paths = expected_paths(reference, tolerance, each_pixel, pixel_count(scene, sensor))
        return renders * paths

    full, reference = reference_probe(probes, given, tolerance, expected)
    if reference.may_lack > LACK_SHARE * tolerance:
        settings, bias, left_out = full, truncation_error(probes, reference), []
        untried = [
            "any simplification: a probe that excludes a source which no path has hit takes about "
            "as long as the render"
        ]
    else:
        settings, bias, left_out, untried = simplified(
            probes, full, reference, tolerance, expected(reference)
        )
    if given.closure != "none":
        left_out.insert(0, f"the scene's own closure, {given.closure}")
    check_bounces(probes, settings.max_bounces, full, bias, tolerance)
    if progress:
        progress(probes.done, probes.done)
    return Plan(
        scene_name=scene.name,
        **asdict(settings),
        tolerance=tolerance,
        each_pixel=each_pixel,
        bias=bias,
        noise_tolerance=float(np.sqrt(tolerance**2 - bias**2)) if each_pixel else tolerance - bias,
        probe_seconds=time.perf_counter() - start,
        left_out=left_out,
        untried=untried,
    )


def simplified(
    probes: ProbeSeries, full: Settings, reference: Probe, tolerance: float, paths: float
) -> tuple[Settings, float, list[str], list[str]]:
    """Simpler settings than `full`, as far as that saves time.

    Parameters
    ----------
    probes : ProbeSeries
    full : Settings
        Settings of full fidelity.
    reference : Probe
        Probe under `full`, which has missed no important source.
    tolerance : float
        Error that is allowed, as a fraction of the mean radiance.
    paths : float
        Expected number of paths of all renders.

    Returns
    -------
    settings : Settings
    bias : float
        Upper bound (95 %) of their error, as a fraction of the mean radiance.
    left_out, untried : list of str
        As for `Plan`.
    """

    def pays(rays: float) -> bool:
        return rays > 0 and rays * paths > KERNEL

    untried = []
    reference, settings, bias, probe, left_out = fewer_bounces(
        probes, full, reference, tolerance, pays
    )
    rays = settings.max_bounces + 1 + (settings.closure == "ambient")
    simpler = candidates(probes.scene, exact=False)
    if simpler and pays(SAVING * rays):
        tail_error = bias if settings.closure == "tail" else 0.0
        share = PIXEL_SHARE if probes.each_pixel else INTENSITY_SHARE
        settings, bias, lobe_probe, remarks = simpler_lobes(
            probes, settings, reference, bias, tail_error, share * tolerance
        )
        probe = lobe_probe or probe
        left_out += remarks
    elif simpler:
        names = ", ".join(material or "an unnamed material" for material in simpler)
        untried.append(f"simpler lobes for {names}: a probe takes longer than they can save")
    if pays(SAVING * rays):
        settings = cheaper_emitter_sampling(probes, settings, probe or reference, tolerance)
    else:
        word = "without" if settings.emitter_sampling else "with"
        untried.append(f"paths {word} emitter sampling: a probe takes longer than it can save")
    return settings, bias, left_out, untried
