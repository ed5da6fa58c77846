"""No more model than a scene needs: the cheapest settings whose error stays within a tolerance,
from cheap probes.

Full fidelity is the whole BRDF of every material and reflections without end. A plan leaves out
what the probes show not to matter: it may take a material as a mirror or as diffuse, follow fewer
reflections, continue them geometrically (closure `tail`), and draw emitters or not. Everything
stated holds with 95 % confidence, as far as the probes can see. A source may be so bright that one
path more might have met it and changed the mean. Then the probes draw emitters, trace more paths,
and refuse the plan if neither settles it.
"""

import time
from dataclasses import asdict, dataclass, replace

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.physics.reflection.interface import Rung
from mi_lcair.planning.probe import BATCHES, T_95, Probe, Settings, probe
from mi_lcair.plugins.paths.channels import MAX_BOUNCE_CHANNELS
from mi_lcair.rendering.render import check_bounded
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.window import window_area

PROBED_BOUNCES, MOST_BOUNCES = 32, MAX_BOUNCE_CHANNELS - 1
LOBE_SHARE, BOUNCE_SHARE = (
    0.35,
    0.15,
)  # of the tolerance that simpler lobes and fewer bounces may use; noise has the rest
WORTHWHILE = 0.8  # a change is made if it costs less than this share
CONFIDENCE = 2.24  # standard errors, 97.5 %: what the probes do not know of the noise comes on top
FEW_BATCHES = 2.03  # upper bound (97.5 %) of a standard deviation from BATCHES values
LARGEST_RATIO = 0.999  # of successive bounces: beyond it noise decides what is left
LEAST_SPP = 2  # one sample per pixel has no standard error
MOST_PATHS = 16  # of a probe, in those of the shortest one


@dataclass(frozen=True)
class Plan:
    """Settings for a scene, and what they are predicted to cost.

    lobe: rung for each material with a ladder. predicted_error: fraction of the mean radiance,
    95 %: of the intensity of the target, or rms over the pixels. predicted_seconds: of the run
    alone, compiled; probe_seconds: of finding the plan. left_out: what the plan leaves out and how
    much that is estimated to matter, one line each.
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
        return Settings(
            lobe=self.lobe,
            max_bounces=self.max_bounces,
            emitter_sampling=self.emitter_sampling,
            closure=self.closure,
        )

    def as_dict(self) -> dict:
        return asdict(self)

    def applied(self, scene: Scene):
        """Context manager: within, the scene is rendered as planned."""
        return self.settings.applied(scene)


def plan(
    scene: Scene,
    tolerance: float = 0.01,
    each_pixel: bool = False,
    seed: int = 0,
    sensor: int = 0,
    progress=None,
) -> Plan:
    """Plans a render of `scene` whose error is below `tolerance`, a fraction of the mean radiance.

    each_pixel: the rms error over the pixels, as `render` reports it; otherwise that of the
    target's intensity, which needs an orthographic sensor. progress: called with (probes done,
    expected). Raises InputError for a tolerance outside 0..1, for a scene that shows nothing, and
    where no number of reflections that can be probed suffices.
    """
    if not 0 < tolerance < 1:
        raise InputError(f"tolerance = {tolerance} must lie between 0 and 1")
    if not each_pixel:
        window_area(scene.sensor(sensor), scene.name)
    start = time.perf_counter()
    own = Settings.of(scene)
    full = Settings(
        lobe=dict.fromkeys(own.lobe, "brdf"),
        max_bounces=min(max(own.max_bounces, PROBED_BOUNCES), MOST_BOUNCES),
        emitter_sampling=own.emitter_sampling,
    )
    with scene.prepared() as tracer:
        check_bounded(tracer.emitters, scene.name)
    done, factor = 0, 1

    def look(settings):
        nonlocal done
        done += 1
        found = probe(scene, settings, each_pixel, seed, sensor, factor)
        if progress:
            progress(done, done + 2)
        return found

    reference = look(full)
    mean = reference.value.mean()
    if not mean > 0:
        raise InputError(
            f"{scene.name}: nothing to plan for: {'the image' if each_pixel else 'the target'} is dark; let the sensor see "
            f"something that radiates in band {scene.band.label}"
        )
    drawn = own.emitter_sampling
    if reference.may_lack > BOUNCE_SHARE * tolerance:
        second = look(replace(full, emitter_sampling=True))
        # paths alone have missed a source, or cannot tell
        if second.may_lack < reference.may_lack or differ(
            second, reference, BOUNCE_SHARE * tolerance
        ):
            full, reference, drawn = replace(full, emitter_sampling=True), second, True
    while reference.may_lack > BOUNCE_SHARE * tolerance:
        needed = factor * reference.may_lack / (BOUNCE_SHARE * tolerance)
        if needed > MOST_PATHS:
            raise InputError(
                f"{scene.name}: no plan for {tolerance:.2%}: a source of up to {reference.chance:.3g} W m^-2 sr^-1 is met "
                f"by chance alone, and to rule out one that matters takes {needed / factor * reference.paths:.2g} paths; "
                "allow a larger tolerance, or set --spp yourself"
            )
        factor = int(np.ceil(1.2 * needed))
        reference = look(full)
    mean = reference.value.mean()

    # ------------------------ Lobes ------------------------
    lobe, lobe_error, shown, left_out = simpler_lobes(
        scene, full, reference, tolerance * LOBE_SHARE, each_pixel, look
    )

    # ----------------------- Bounces -----------------------
    if own.closure != "none":
        left_out.append(f"the scene's own closure, {own.closure}")
    bounces, closure, bounce_error = fewest_bounces(
        shown.by_bounce, tolerance * BOUNCE_SHARE, each_pixel
    )
    if bounce_error > 0:
        left_out.append(
            f"reflections beyond {bounces}"
            + (" but for their geometric continuation" if closure == "tail" else "")
            + f": at most {bounce_error:.2g} of the mean"
        )

    bias = lobe_error + bounce_error
    if not bias < tolerance:
        raise InputError(
            f"{scene.name}: no plan for {tolerance:.2%}: what lies beyond {bounces} reflections may be {bounce_error:.2%} of the mean, "
            f"and no more than {full.max_bounces} were probed; allow a larger tolerance, or set max_bounces and --tolerance yourself"
        )

    # ------------------ Emitter sampling -------------------
    settings = Settings(lobe=lobe, max_bounces=bounces, emitter_sampling=drawn, closure=closure)
    other = replace(settings, emitter_sampling=not drawn)
    found, alternative = look(settings), look(other)
    cost = [probed.cost * np.mean(probed.deviation**2) for probed in (found, alternative)]
    if cost[1] < WORTHWHILE * cost[0] and not (
        drawn and differ(found, alternative, BOUNCE_SHARE * tolerance)
    ):
        settings, found = other, alternative

    # ----------------------- Samples -----------------------
    pixels = int(np.prod(scene.sensor(sensor).film().crop_size()))
    deviation, left = upper(found.deviation) / mean, tolerance - bias
    missed = found.chance / mean  # what a source that no other path has met brings to one path
    if closure == "tail" and not each_pixel:
        deviation = max(deviation, FEW_BATCHES * found.between / mean)
    if each_pixel:  # deviation^2 / spp + missed^2 / (spp^2 pixels) = tolerance^2 - bias^2
        room = tolerance**2 - bias**2
        spp = max(
            LEAST_SPP,
            int(
                np.ceil(
                    (deviation**2 + np.sqrt(deviation**4 + 4 * room * missed**2 / pixels))
                    / (2 * room)
                )
            ),
        )
        error = float(np.sqrt(bias**2 + deviation**2 / spp + missed**2 / (spp**2 * pixels)))
    else:  # CONFIDENCE deviation / sqrt(paths) + missed / paths = tolerance - bias
        root = (
            CONFIDENCE * deviation + np.sqrt((CONFIDENCE * deviation) ** 2 + 4 * left * missed)
        ) / (2 * left)
        spp = max(LEAST_SPP, int(np.ceil(root**2 / pixels)))
        error = float(
            bias + CONFIDENCE * deviation / np.sqrt(spp * pixels) + missed / (spp * pixels)
        )
    if progress:
        progress(done, done)
    return Plan(
        **asdict(settings),
        spp=spp,
        tolerance=tolerance,
        each_pixel=each_pixel,
        predicted_error=error,
        predicted_seconds=found.seconds * spp * pixels,
        probe_seconds=time.perf_counter() - start,
        left_out=left_out,
    )


def simpler_lobes(scene, full: Settings, reference: Probe, budget: float, each_pixel: bool, look):
    """The lower rung of each material that stays within the budget: (lobes, error bound, probe of
    them all, what is left out).
    """
    lobe, error, left_out, shown = dict(full.lobe), 0.0, [], reference
    for material, rung in candidates(scene).items():
        tried = lobe | {material: rung.lobe}
        if rung.exact:
            lobe = tried
            continue
        found = look(replace(full, lobe=tried))
        bound = difference(found, reference, each_pixel)
        if bound <= budget:  # against the reference: it bounds what all changes so far do together
            left_out.append(
                f"the BRDF of {material or 'an unnamed material'}, taken as {rung.lobe}: with what came before at most {bound:.2g} of the mean"
            )
            lobe, error, shown = tried, bound, found
    return lobe, error, shown, left_out


def candidates(scene: Scene) -> dict[str, Rung]:
    """For each material that may have one, a lower rung of the fidelity ladder; surfaces of one name
    share it, or have none.
    """
    rungs = {}
    for surface in scene.surfaces():
        rung = surface.model.lower_rung(*surface.values, form=surface.form)
        rungs.setdefault(surface.material, []).append(rung)
    found = {}
    for material, each in rungs.items():
        if None not in each and len({rung.lobe for rung in each}) == 1:
            found[material] = Rung(each[0].lobe, exact=all(rung.exact for rung in each))
    return found


def differ(one: Probe, other: Probe, share: float) -> bool:
    """Whether the means of two probes lie further apart than this share of the first and than their
    scatter can explain.
    """
    apart = one.value.mean(axis=1) - other.value.mean(axis=1)
    return (
        abs(apart.mean()) - T_95 * apart.std(ddof=1) / np.sqrt(BATCHES) > share * one.value.mean()
    )


def difference(found: Probe, reference: Probe, each_pixel: bool) -> float:
    """Upper bound (95 %) on how far two settings lie apart, as a fraction of the mean radiance."""
    mean = reference.value.mean()
    apart = (found.value - reference.value) / mean
    if not each_pixel:
        return upper(apart.mean(axis=1), signed=True)
    # products of independent looks: their mean is the square of the difference, without the noise
    # of each
    products = np.mean(apart[0::2] * apart[1::2], axis=1)
    error = products.std(ddof=1) / np.sqrt(len(products))
    return float(np.sqrt(max(0.0, products.mean() + T_95 * error)))


def upper(values: np.ndarray, signed: bool = False) -> float:
    """Upper bound (95 %) of the mean of BATCHES independent values; of its absolute value."""
    mean = abs(values.mean()) if signed else values.mean()
    return float(mean + T_95 * values.std(ddof=1) / np.sqrt(BATCHES))


def fewest_bounces(
    by_bounce: np.ndarray, budget: float, each_pixel: bool
) -> tuple[int, str, float]:
    """The smallest number of reflections within the budget, with or without a geometric tail, and
    the bound on what is missing.

    Beyond the last count probed the geometric continuation is added to what is missing.
    """
    shown = by_bounce.mean(
        axis=0
    )  # (bounces, pixels); radiance is never negative, so noise adds little
    looks = by_bounce.mean(axis=2)  # (BATCHES, bounces)
    counts = shown.mean(axis=1)
    last = len(counts) - 1
    ratio = min(counts[last] / counts[last - 1], LARGEST_RATIO) if counts[last - 1] > 0 else 0.0
    beyond = ratio / (1 - ratio)  # of the last count
    total, total_looks = (
        counts.sum() + beyond * counts[last],
        looks.sum(axis=1) + beyond * looks[:, last],
    )

    def bound(missing_pixels, missing_looks):
        if each_pixel:
            return float(np.sqrt(np.mean(missing_pixels**2)) / total)
        return upper(missing_looks / total_looks, signed=True)

    def missing(n):
        return shown[n + 1 :].sum(axis=0) + beyond * shown[last], looks[:, n + 1 :].sum(
            axis=1
        ) + beyond * looks[:, last]

    def tail(n):
        factor = counts[n] / (counts[n - 1] - counts[n]) if counts[n] < counts[n - 1] else 0.0
        falls = np.maximum(
            looks[:, n - 1] - looks[:, n], 1e-6 * looks[:, n - 1]
        )  # a look whose counts do not fall has no tail
        return factor * shown[n], np.divide(
            looks[:, n] ** 2, falls, out=np.zeros(BATCHES), where=falls > 0
        )

    best = (last, "none", bound(*missing(last)))
    for n in range(last, -1, -1):
        error = bound(*missing(n))
        if error > budget:
            break
        best = (n, "none", error)
    for n in range(2, last if best[2] > budget else best[0] - 1):
        error = bound(*(left - continued for left, continued in zip(missing(n), tail(n))))
        if error <= budget:
            return n, "tail", error
    return best
