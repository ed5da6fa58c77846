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
from dataclasses import asdict, dataclass, replace

import numpy as np
from scipy.special import fdtri

from mi_lcair.errors import InputError
from mi_lcair.planning.ambient import ambient_closure
from mi_lcair.planning.bounces import fewest_bounces
from mi_lcair.planning.lobes import candidates, simpler_lobes
from mi_lcair.planning.probe import (
    FEW_COUNTS,
    Probe,
    ProbeSeries,
    Settings,
    cost,
    differ,
    half_width,
)
from mi_lcair.plugins.paths.channels import MAX_BOUNCE_CHANNELS
from mi_lcair.rendering.render import PILOT_SPP, check_bounded
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.window import window_area
from mi_lcair.rendering.window_means import FIRST_PATHS

# Reflections that a probe follows: at least the first number, at most the second.
PROBED_BOUNCES, MOST_BOUNCES = 32, MAX_BOUNCE_CHANNELS - 1
# A scene whose own number of reflections is smaller is first probed with few bounce channels.
MANY_BOUNCES = 16
BOUNCE_SHARE = 0.15  # share of the tolerance that fewer reflections may use
# Shares that all simplifications together may use; noise gets the rest. A larger bias would need
# more additional paths than simplifications save (SAVING). It adds to the noise of an intensity,
# and its square to the squared noise of an image.
INTENSITY_SHARE, PIXEL_SHARE = 0.2, 0.5
LACK_SHARE = 0.3  # share that a source which no path has hit may add
WORTHWHILE = 0.8  # emitter sampling is switched only if the cost falls below this share
CONFIDENCE = 0.95  # confidence with which one variance must be the smaller one
MORE_PATHS = 2**19  # paths of a probe up to which it is enlarged before emitters are sampled
MOST_PATHS = 2**20  # paths of the longest probe
# Rays that are traced while a kernel is compiled. Measured: 0.1 s to 0.3 s for a kernel, and ten
# million rays in a second.
KERNEL = 2**21
SAVING = 0.3  # share of a render's cost that simpler lobes or other emitter sampling may save
LARGE_PROBE = 0.5  # share of the render's paths from which on a probe is too large to pay


@dataclass(frozen=True)
class Plan:
    """Settings for a scene, and the error that they are known to leave.

    Attributes
    ----------
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

    @property
    def settings(self) -> Settings:
        """The part of the plan that is applied to the scene."""
        return Settings(
            lobe=self.lobe,
            max_bounces=self.max_bounces,
            emitter_sampling=self.emitter_sampling,
            closure=self.closure,
            ambient_temperature=self.ambient_temperature,
        )

    def as_dict(self) -> dict:
        """The plan as a dictionary, for JSON."""
        return asdict(self)

    def applied(self, scene: Scene):
        """Context manager that applies the plan's settings to `scene` within the block."""
        return self.settings.applied(scene)


def plan(
    scene: Scene,
    tolerance: float = 0.01,
    each_pixel: bool = False,
    seed: int = 0,
    sensor: int = 0,
    progress=None,
    renders: float = 1,
) -> Plan:
    """Plan a render of `scene` whose error is below `tolerance`.

    Render it under the plan's settings to the plan's `noise_tolerance`.

    Parameters
    ----------
    scene : Scene
        Scene to plan for. Its own settings are the same afterwards.
    tolerance : float
        Error that is allowed, as a fraction of the mean radiance, between 0 and 1.
    each_pixel : bool
        True for the rms error over the pixels, as `render` reports it. False for the error of the
        target's intensity, which needs an orthographic sensor.
    seed : int
        Seed of the random numbers.
    sensor : int
        Number of the scene's sensor, from 0.
    progress : callable, optional
        Called with (probes done, probes expected).
    renders : float
        Number of renders that the plan is for. Probes that save less time in all of them than they
        take are left out. With infinity all simplifications are tried.

    Returns
    -------
    Plan

    Raises
    ------
    InputError
        If the tolerance is not between 0 and 1, if the scene is dark, or if no settings that can
        be probed reach the tolerance.
    """
    if not 0 < tolerance < 1:
        raise InputError(f"tolerance = {tolerance} must lie between 0 and 1")
    if not renders > 0:
        raise InputError(f"renders = {renders} must be positive")
    if not each_pixel:
        window_area(scene.sensor(sensor), scene.name)
    start = time.perf_counter()
    with scene.prepared() as tracer:
        check_bounded(tracer.emitters, scene.name)
    own = Settings.of(scene)
    probes = ProbeSeries(scene, each_pixel, seed, sensor, progress)
    expected = lambda reference: (
        renders * expected_paths(reference, tolerance, each_pixel, pixel_count(scene, sensor))
    )
    full, reference = reference_probe(probes, own, tolerance, expected)
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
    if own.closure != "none":
        left_out.insert(0, f"the scene's own closure, {own.closure}")
    check_bounces(probes, settings.max_bounces, full, bias, tolerance)
    if progress:
        progress(probes.done, probes.done)
    return Plan(
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
    pays = lambda rays: rays > 0 and rays * paths > KERNEL
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


def pixel_count(scene: Scene, sensor: int) -> int:
    """Number of pixels of a sensor."""
    return int(np.prod(scene.sensor(sensor).film().crop_size()))


def expected_paths(reference: Probe, tolerance: float, each_pixel: bool, pixels: int) -> float:
    """Estimated number of paths of a render to `tolerance` under full fidelity."""
    if each_pixel:
        spp = reference.paths / reference.value.shape[1]
        error = np.sqrt(reference.variance / len(reference.value)) / reference.mean
        return pixels * max(PILOT_SPP, spp * (error / tolerance) ** 2)
    noise = half_width(reference.value.mean(axis=1)) / reference.mean
    # The error of a lattice falls faster than 1 / sqrt(paths) and slower than 1 / paths.
    of_noise, of_source = (noise / tolerance) ** 1.5, reference.may_lack / tolerance
    return max(FIRST_PATHS, reference.paths * (of_noise + of_source))


# ---------------------- Reference probe ----------------------


def reference_probe(
    probes: ProbeSeries, own: Settings, tolerance: float, expected
) -> tuple[Settings, Probe]:
    """Settings of full fidelity, and a probe under them that has missed no important source.

    Lobes that are exact take the place of the BRDF at once. The first probe uses the scene's own
    emitter sampling. If it may have missed a source, further ones trace more paths or sample
    emitters. The first probe is returned, whatever it has missed, if a probe with more paths would
    cost about as much as the render.

    Parameters
    ----------
    probes : ProbeSeries
    own : Settings
        The scene's own settings.
    tolerance : float
        Error that is allowed, as a fraction of the mean radiance.
    expected : callable
        Number of paths of all renders under full fidelity, estimated from a probe.

    Raises InputError for a dark scene, and if too many paths would be needed.
    """
    scene = probes.scene
    full = Settings(
        lobe=dict.fromkeys(own.lobe, "brdf") | candidates(scene, exact=True),
        max_bounces=min(max(own.max_bounces, PROBED_BOUNCES), MOST_BOUNCES),
        emitter_sampling=own.emitter_sampling,
    )
    counted = FEW_COUNTS if own.max_bounces < MANY_BOUNCES else None
    reference = probes(full, counted=counted)
    if not reference.mean > 0:
        raise InputError(
            f"{scene.name}: nothing to plan for: "
            f"{'the image' if probes.each_pixel else 'the target'} is dark; let the sensor see "
            f"something that radiates in band {scene.band.label}"
        )

    allowed = LACK_SHARE * tolerance
    most, is_first = MORE_PATHS, True
    while reference.may_lack > allowed:
        # The bound falls as 1 / paths. The next probe takes the paths that it needs, and 20 % more.
        more = reference.may_lack / allowed
        if more * reference.paths <= most:
            if is_first and more * reference.paths > LARGE_PROBE * expected(reference):
                break
            probes.factor = int(np.ceil(1.2 * more * probes.factor))
            reference = probes(full, counted=counted)
        elif is_first:
            # Emitter sampling is adopted if it excludes more, or if it finds radiance that paths
            # missed.
            most, is_first = MOST_PATHS, False
            sampling_emitters = replace(full, emitter_sampling=True)
            second = probes(sampling_emitters, counted=counted)
            if second.may_lack < reference.may_lack or differ(second, reference, allowed):
                full, reference = sampling_emitters, second
        else:
            raise InputError(
                f"{scene.name}: no plan for {tolerance:.2%}: a source of up to "
                f"{reference.chance:.3g} W m^-2 sr^-1 is met by chance alone, and to rule out "
                f"one that matters takes {more * reference.paths:.2g} paths; "
                "allow a larger tolerance, or set --spp yourself"
            )
    return full, reference


# -------------------------- Bounces --------------------------


def reflections_needed(probes: ProbeSeries, probe: Probe, budget: float) -> tuple[int, str, float]:
    """Number of reflections, closure and error for a budget, see `fewest_bounces`."""
    reflections = None if probe.is_complete else probe.reflections
    return fewest_bounces(probe.by_bounce, budget, probes.each_pixel, reflections)


def truncation_error(probes: ProbeSeries, probe: Probe) -> float:
    """Upper bound of what is missing after all reflections of a probe."""
    *_, error = reflections_needed(probes, probe, budget=0.0)
    return error


def check_bounces(
    probes: ProbeSeries, bounces: int, full: Settings, error: float, tolerance: float
) -> None:
    """Raise InputError if the error of following `bounces` reflections is not below `tolerance`."""
    if not error < tolerance:
        raise InputError(
            f"{probes.scene.name}: no plan for {tolerance:.2%}: what lies beyond {bounces} "
            f"reflections may be {error:.2%} of the mean, and no more than {full.max_bounces} were "
            "probed; allow a larger tolerance, or set max_bounces and --tolerance yourself"
        )


def fewer_bounces(
    probes: ProbeSeries, full: Settings, reference: Probe, tolerance: float, pays
) -> tuple[Probe, Settings, float, Probe | None, list[str]]:
    """The settings with the fewest reflections, and with a closure if that saves more.

    Parameters
    ----------
    probes : ProbeSeries
    full : Settings
        Settings of full fidelity.
    reference : Probe
        Probe under `full`.
    tolerance : float
        Error that is allowed, as a fraction of the mean radiance.
    pays : callable
        Whether saving this number of rays a path is worth a new kernel.

    Returns
    -------
    reference : Probe
        A probe under `full`, which counts more reflections separately if that was necessary.
    settings : Settings
    error : float
        Upper bound (95 %) of the error, as a fraction of the mean radiance.
    probe : Probe or None
        A probe under `settings`, if one was needed.
    left_out : list of str

    Raises InputError if no number that was probed suffices.
    """
    budget = BOUNCE_SHARE * tolerance
    bounces, closure, error = reflections_needed(probes, reference, budget)
    if not reference.is_complete and bounces == full.max_bounces:
        reference = probes(full)
        bounces, closure, error = reflections_needed(probes, reference, budget)
    check_bounces(probes, bounces, full, error, tolerance)
    if reference.is_complete and not pays(full.max_bounces - bounces):
        # The kernel for all reflections is compiled already
        error_of_all = truncation_error(probes, reference)
        if error_of_all <= budget:
            bounces, closure, error = full.max_bounces, "none", error_of_all
    settings = replace(full, max_bounces=bounces, closure=closure)
    probe = None
    fewer = range(bounces - 2)  # one more ray than these numbers say, and two saved at least
    if fewer and pays(bounces - 1):
        without = replace(full, closure="none")
        ambient = ambient_closure(probes, without, reference, fewer, budget)
        if ambient is not None:
            settings, error, probe = ambient
    if not error > 0:
        return reference, settings, error, probe, []
    beyond = {
        "none": "",
        "tail": " but for their geometric continuation",
        "ambient": " but for a blackbody at "
        f"{settings.ambient_temperature or 0:.1f} K that stands for them",
    }[settings.closure]
    remark = f"reflections beyond {settings.max_bounces}{beyond}: at most {error:.2g} of the mean"
    return reference, settings, error, probe, [remark]


# --------------------- Emitter sampling ----------------------


def cheaper_emitter_sampling(
    probes: ProbeSeries, settings: Settings, current: Probe, tolerance: float
) -> Settings:
    """The cheaper of `settings` with and without emitter sampling.

    The cost is that of a path times the variance of the randomisations at equal numbers of paths.
    The variance must be smaller with CONFIDENCE, because a few randomisations know it badly.
    `current` is a probe under `settings`, or under full fidelity.
    """
    other_settings = replace(settings, emitter_sampling=not settings.emitter_sampling)
    other = probes(other_settings, count_segments=True)
    # The reflected paths are the same, so that one count of their rays serves both
    current_cost, other_cost = (
        cost(other.segments, of_either.emitter_sampling) * result.variance
        for of_either, result in ((settings, current), (other_settings, other))
    )
    freedom = (current.value.shape[0] - 1) * current.value.shape[1]
    clearly = fdtri(freedom, freedom, CONFIDENCE)  # ratio that equal variances rarely exceed
    # Emitter sampling must stay where the probe without it misses radiance.
    misses_radiance = settings.emitter_sampling and (
        differ(current, other, BOUNCE_SHARE * tolerance) or other.may_lack > LACK_SHARE * tolerance
    )
    if clearly * other_cost < WORTHWHILE * current_cost and not misses_radiance:
        return other_settings
    return settings
