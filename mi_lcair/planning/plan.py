"""The cheapest settings of a render whose error stays within a tolerance, found with cheap probes.

Full fidelity is the whole BRDF of every material and any number of reflections. The probes show
what does not matter for the scene, and a plan leaves it out. A plan may replace a BRDF by a mirror
or a diffuse reflector, follow fewer reflections, continue them geometrically (closure `tail`), and
sample emitters or not.

All bounds hold with 95 % confidence, as far as the probes can see. A source may be so bright that
one more path that hits it would change the mean. The probes then sample emitters and trace more
paths. If neither settles the question, the plan is refused.
"""

import time
from dataclasses import asdict, dataclass, replace

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.planning.bounces import fewest_bounces
from mi_lcair.planning.lobes import simpler_lobes
from mi_lcair.planning.probe import Probe, ProbeSeries, Settings, differ, upper
from mi_lcair.plugins.paths.channels import MAX_BOUNCE_CHANNELS
from mi_lcair.rendering.render import check_bounded
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.window import window_area

# Reflections that a probe follows: at least the first number, at most the second.
PROBED_BOUNCES, MOST_BOUNCES = 32, MAX_BOUNCE_CHANNELS - 1
LOBE_SHARE = 0.35  # share of the tolerance that simpler lobes may use
BOUNCE_SHARE = 0.15  # share of the tolerance that fewer bounces may use; noise gets the rest
WORTHWHILE = 0.8  # emitter sampling is switched only if the cost falls below this share
CONFIDENCE = 2.24  # standard errors of a two-sided 97.5 % interval of the noise
FEW_BATCHES = 2.03  # upper bound (97.5 %) of a standard deviation that BATCHES values estimate as 1
LEAST_SPP = 2  # samples per pixel; a single one gives no standard error
MOST_PATHS = 16  # paths of the longest probe, as a multiple of the shortest probe's


@dataclass(frozen=True)
class Plan:
    """Settings for a scene, and the error and time that they are predicted to have.

    Attributes
    ----------
    lobe : dict of str to str
        Lobe ("brdf", "mirror" or "diffuse") by material, for materials with a fidelity ladder.
    max_bounces : int
        Number of reflections that are followed.
    emitter_sampling : bool
        Whether paths sample emitters at each reflection.
    closure : str
        "tail" if reflections beyond `max_bounces` are continued geometrically, otherwise "none".
    spp : int
        Samples per pixel.
    tolerance : float
        Error that was allowed, as a fraction of the mean radiance.
    each_pixel : bool
        Whether the error is the rms over the pixels. Otherwise it is that of the target's
        intensity.
    predicted_error : float
        Upper bound (95 %) of the error, as a fraction of the mean radiance.
    predicted_seconds : float
        Time of the render, s, without compilation.
    probe_seconds : float
        Time that finding the plan took, s.
    left_out : list of str
        One line for each thing that the plan leaves out, with the bound of its effect.
    """

    lobe: dict[str, str]
    max_bounces: int
    emitter_sampling: bool
    closure: str
    spp: int
    tolerance: float
    each_pixel: bool
    predicted_error: float
    predicted_seconds: float
    probe_seconds: float
    left_out: list[str]

    @property
    def settings(self) -> Settings:
        """The part of the plan that is applied to the scene: all but the samples per pixel."""
        return Settings(
            lobe=self.lobe,
            max_bounces=self.max_bounces,
            emitter_sampling=self.emitter_sampling,
            closure=self.closure,
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
) -> Plan:
    """Plan a render of `scene` whose error is below `tolerance`.

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
    if not each_pixel:
        window_area(scene.sensor(sensor), scene.name)
    start = time.perf_counter()
    with scene.prepared() as tracer:
        check_bounded(tracer.emitters, scene.name)
    own = Settings.of(scene)
    probes = ProbeSeries(scene, each_pixel, seed, sensor, progress)

    full, reference = reference_probe(probes, own, tolerance)
    lobe, lobe_error, lobe_probe, left_out = simpler_lobes(
        probes, full, reference, tolerance * LOBE_SHARE
    )
    if own.closure != "none":
        left_out.append(f"the scene's own closure, {own.closure}")
    bounces, closure, bounce_error = fewer_bounces(
        probes, lobe_probe, full, lobe_error, tolerance, left_out
    )
    settings, settings_probe = cheaper_emitter_sampling(
        probes, Settings(lobe, bounces, full.emitter_sampling, closure), tolerance
    )
    pixels = int(np.prod(scene.sensor(sensor).film().crop_size()))
    spp, error = samples_per_pixel(
        settings_probe,
        mean=reference.value.mean(),
        shared_noise=closure == "tail" and not each_pixel,
        bias=lobe_error + bounce_error,
        tolerance=tolerance,
        pixels=pixels,
        each_pixel=each_pixel,
    )
    if progress:
        progress(probes.done, probes.done)
    return Plan(
        **asdict(settings),
        spp=spp,
        tolerance=tolerance,
        each_pixel=each_pixel,
        predicted_error=error,
        predicted_seconds=settings_probe.seconds * spp * pixels,
        probe_seconds=time.perf_counter() - start,
        left_out=left_out,
    )


# ---------------------- Reference probe ----------------------


def reference_probe(probes: ProbeSeries, own: Settings, tolerance: float) -> tuple[Settings, Probe]:
    """Settings of full fidelity, and a probe under them that has missed no important source.

    The first probe uses the scene's own emitter sampling. If it may have missed a source, a second
    one samples emitters, and further ones trace more paths. `own` are the scene's own settings.
    Raises InputError for a dark scene, and if too many paths would be needed.
    """
    scene = probes.scene
    full = Settings(
        lobe=dict.fromkeys(own.lobe, "brdf"),
        max_bounces=min(max(own.max_bounces, PROBED_BOUNCES), MOST_BOUNCES),
        emitter_sampling=own.emitter_sampling,
    )
    reference = probes(full)
    if not reference.value.mean() > 0:
        raise InputError(
            f"{scene.name}: nothing to plan for: "
            f"{'the image' if probes.each_pixel else 'the target'} is dark; let the sensor see "
            f"something that radiates in band {scene.band.label}"
        )

    # Emitter sampling is adopted if it excludes more, or if it finds radiance that paths missed.
    allowed = BOUNCE_SHARE * tolerance
    if reference.may_lack > allowed:
        sampling_emitters = replace(full, emitter_sampling=True)
        second = probes(sampling_emitters)
        if second.may_lack < reference.may_lack or differ(second, reference, allowed):
            full, reference = sampling_emitters, second

    # The bound falls as 1 / paths. The next probe takes the paths that it needs, and 20 % more.
    while reference.may_lack > allowed:
        factor = probes.factor * reference.may_lack / allowed
        if factor > MOST_PATHS:
            raise InputError(
                f"{scene.name}: no plan for {tolerance:.2%}: a source of up to "
                f"{reference.chance:.3g} W m^-2 sr^-1 is met by chance alone, and to rule out "
                f"one that matters takes {factor / probes.factor * reference.paths:.2g} paths; "
                "allow a larger tolerance, or set --spp yourself"
            )
        probes.factor = int(np.ceil(1.2 * factor))
        reference = probes(full)
    return full, reference


# -------------------------- Bounces --------------------------


def fewer_bounces(
    probes: ProbeSeries,
    lobe_probe: Probe,
    full: Settings,
    lobe_error: float,
    tolerance: float,
    left_out: list[str],
) -> tuple[int, str, float]:
    """The number of reflections to follow, the closure, and the error bound of both.

    A line about the reflections beyond is appended to `left_out`. Raises InputError if this error
    and that of the lobes together exceed the tolerance.
    """
    bounces, closure, error = fewest_bounces(
        lobe_probe.by_bounce, tolerance * BOUNCE_SHARE, probes.each_pixel
    )
    if error > 0:
        continued = " but for their geometric continuation" if closure == "tail" else ""
        left_out.append(f"reflections beyond {bounces}{continued}: at most {error:.2g} of the mean")
    if not lobe_error + error < tolerance:
        raise InputError(
            f"{probes.scene.name}: no plan for {tolerance:.2%}: what lies beyond {bounces} "
            f"reflections may be {error:.2%} of the mean, and no more than {full.max_bounces} were "
            "probed; allow a larger tolerance, or set max_bounces and --tolerance yourself"
        )
    return bounces, closure, error


# --------------------- Emitter sampling ----------------------


def cheaper_emitter_sampling(
    probes: ProbeSeries, settings: Settings, tolerance: float
) -> tuple[Settings, Probe]:
    """The cheaper of `settings` with and without emitter sampling, and its probe.

    The cost is that of a path times the variance of a sample: the time for a given error.
    """
    other_settings = replace(settings, emitter_sampling=not settings.emitter_sampling)
    current, other = probes(settings), probes(other_settings)
    current_cost, other_cost = (
        result.cost * np.mean(result.deviation**2) for result in (current, other)
    )
    # Emitter sampling must stay where the probe without it misses radiance.
    misses_radiance = settings.emitter_sampling and differ(current, other, BOUNCE_SHARE * tolerance)
    if other_cost < WORTHWHILE * current_cost and not misses_radiance:
        return other_settings, other
    return settings, current


# -------------------------- Samples --------------------------


def samples_per_pixel(
    result: Probe,
    mean: float,
    shared_noise: bool,
    bias: float,
    tolerance: float,
    pixels: int,
    each_pixel: bool,
) -> tuple[int, float]:
    """Samples per pixel that keep the error within the tolerance, and the predicted error.

    Parameters
    ----------
    result : Probe
        Probe under the plan's settings.
    mean : float
        Mean radiance, W m^-2 sr^-1, that errors are fractions of.
    shared_noise : bool
        Whether all samples of a batch share noise, as with the ratio of a geometric tail.
    bias : float
        Upper bound of the error that more samples do not reduce, as a fraction of `mean`.
    tolerance : float
        Error that is allowed, as a fraction of `mean`; larger than `bias`.
    pixels : int
        Number of pixels of the image.
    each_pixel : bool
        Whether the error is the rms over the pixels. Otherwise it is that of their mean.

    Returns
    -------
    spp : int
        Samples per pixel.
    error : float
        Predicted error, as a fraction of `mean`.
    """
    deviation = upper(result.deviation) / mean
    if shared_noise:
        deviation = max(deviation, FEW_BATCHES * result.between / mean)
    missed = result.chance / mean  # radiance that one path adds if it hits a source missed so far

    if each_pixel:
        # Solve deviation^2 / spp + missed^2 / (spp^2 pixels) = tolerance^2 - bias^2 for spp.
        room = tolerance**2 - bias**2
        root = np.sqrt(deviation**4 + 4 * room * missed**2 / pixels)
        spp = max(LEAST_SPP, int(np.ceil((deviation**2 + root) / (2 * room))))
        error = np.sqrt(bias**2 + deviation**2 / spp + missed**2 / (spp**2 * pixels))
        return spp, float(error)

    # Solve CONFIDENCE deviation / sqrt(paths) + missed / paths = tolerance - bias for sqrt(paths).
    room, spread = tolerance - bias, CONFIDENCE * deviation
    root_of_paths = (spread + np.sqrt(spread**2 + 4 * room * missed)) / (2 * room)
    spp = max(LEAST_SPP, int(np.ceil(root_of_paths**2 / pixels)))
    return spp, float(bias + spread / np.sqrt(spp * pixels) + missed / (spp * pixels))
