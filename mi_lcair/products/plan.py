"""No more model than a scene needs: the cheapest settings whose error stays within a tolerance, from cheap probes.

Full fidelity is the whole BRDF of every material and reflections without end. A plan leaves out what the probes show not
to matter: it may take a material as a mirror or as diffuse, follow fewer reflections, continue them geometrically (closure
`tail`), and draw emitters or not. Everything stated holds with 95 % confidence, as far as the probes can see: what they
never met, such as a source smaller than a pixel in a million, they cannot account for.
"""
import time
from dataclasses import asdict, dataclass

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.products.probe import BATCHES, T_95, Probe, Settings, applied, probe
from mi_lcair.rendering.scene import Scene

PROBED_BOUNCES = 32
LOBE_SHARE, BOUNCE_SHARE = 0.35, 0.15       # of the tolerance that simpler lobes and fewer bounces may use; noise has the rest
NARROW = 0.2                                # lobe width e above which a mirror is not tried
NEGLIGIBLE = 1e-6                           # reflectance of a part that cannot matter
WORTHWHILE = 0.8                            # a change is made if it costs less than this share of the time
CONFIDENCE = 2.24                           # standard errors, 97.5 %: what the probes do not know of the noise comes on top
FEW_BATCHES = 2.03                          # upper bound (97.5 %) of a standard deviation from BATCHES values
LEAST_SPP = 2                               # one sample per pixel has no standard error


@dataclass(frozen=True)
class Plan:
    """Settings for a scene, and what they are predicted to cost.

    lobe: rung for each Sandford-Robertson material. predicted_error: fraction of the mean radiance, 95 %: of the intensity of the
    target, or rms over the pixels. predicted_seconds: of the run alone, compiled; probe_seconds: of finding the plan.
    left_out: what the plan leaves out and how much that is estimated to matter, one line each.
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
        return Settings(self.lobe, self.max_bounces, self.emitter_sampling, self.closure)

    def as_dict(self) -> dict:
        return asdict(self)

    def applied(self, scene: Scene):
        """Context manager: within, the scene is rendered as planned."""
        return applied(scene, self.settings)


def plan(scene: Scene, tolerance: float = 0.01, each_pixel: bool = False, seed: int = 0, sensor: int = 0, progress=None) -> Plan:
    """Plans a render of `scene` whose error is below `tolerance`, a fraction of the mean radiance.

    each_pixel: the rms error over the pixels, as `render` reports it; otherwise that of the target's intensity. progress: called with
    (probes done, expected). Raises InputError for a tolerance outside 0..1, and for a scene that shows nothing.
    """
    if not 0 < tolerance < 1:
        raise InputError(f"tolerance = {tolerance} must lie between 0 and 1")
    start = time.perf_counter()
    own = Settings.of(scene)
    full = Settings(dict.fromkeys(own.lobe, "brdf"), max(own.max_bounces, PROBED_BOUNCES), own.emitter_sampling)
    done = 0

    def look(settings):
        nonlocal done
        done += 1
        found = probe(scene, settings, each_pixel, seed, sensor)
        if progress:
            progress(done, done + 2)
        return found

    reference = look(full)
    mean = reference.value.mean()
    if not mean > 0:
        raise InputError(f"{scene.name}: nothing to plan for: {'the image' if each_pixel else 'the target'} is dark")

    # ------------------------ Lobes ------------------------
    lobe, lobe_error, shown, left_out = simpler_lobes(scene, full, reference, tolerance * LOBE_SHARE, each_pixel, look)

    # ----------------------- Bounces -----------------------
    bounces, closure, bounce_error = fewest_bounces(shown.by_bounce, tolerance * BOUNCE_SHARE, each_pixel)
    if bounce_error > 0:
        left_out.append(f"reflections beyond {bounces}" + (" but for their geometric continuation" if closure == "tail" else "")
                        + f": at most {bounce_error:.2g} of the mean")

    # ------------------ Emitter sampling -------------------
    chosen = Settings(lobe, bounces, own.emitter_sampling, closure)
    other = Settings(lobe, bounces, not own.emitter_sampling, closure)
    probes = {settings.emitter_sampling: (settings, look(settings)) for settings in (chosen, other)}
    cost = {sampling: found.seconds * np.mean(found.deviation**2) for sampling, (_, found) in probes.items()}
    better = not own.emitter_sampling
    sampling = better if cost[better] < WORTHWHILE * cost[own.emitter_sampling] else own.emitter_sampling
    settings, found = probes[sampling]

    # ----------------------- Samples -----------------------
    pixels = int(np.prod(scene.sensor(sensor).film().crop_size()))
    bias = lobe_error + bounce_error
    deviation = upper(found.deviation) / mean
    if closure == "tail" and not each_pixel:
        deviation = max(deviation, FEW_BATCHES * found.between / mean)
    if each_pixel:
        spp = int(np.ceil(max(LEAST_SPP, deviation**2 / (tolerance**2 - bias**2))))
        error = float(np.hypot(bias, deviation / np.sqrt(spp)))
    else:
        spp = int(np.ceil(max(LEAST_SPP, (CONFIDENCE * deviation / (tolerance - bias)) ** 2 / pixels)))
        error = float(bias + CONFIDENCE * deviation / np.sqrt(spp * pixels))
    return Plan(settings.lobe, bounces, sampling, closure, spp, tolerance, each_pixel, error, found.seconds * spp * pixels,
                time.perf_counter() - start, left_out)


def simpler_lobes(scene, full: Settings, reference: Probe, budget: float, each_pixel: bool, look):
    """The lowest rung of each material within the budget: (lobes, error bound, probe of them all, what is left out)."""
    lobe, error, left_out, shown = dict(full.lobe), 0.0, [], reference
    for material, rungs in candidates(scene).items():
        for rung, exact in rungs:
            tried = lobe | {material: rung}
            if exact:
                lobe = tried
                break
            found = look(Settings(tried, full.max_bounces, full.emitter_sampling))
            bound = difference(found, reference, each_pixel)
            if bound <= budget:     # against the reference: it bounds what all changes so far do together
                left_out.append(f"the BRDF of {material or 'an unnamed material'}, taken as {rung}: with what came before at most {bound:.2g} of the mean")
                lobe, error, shown = tried, bound, found
                break
    return lobe, error, shown, left_out


def candidates(scene: Scene) -> dict[str, list[tuple[str, bool]]]:
    """For each material the rungs to try, lowest first, and whether the rung is exact for it."""
    found = {}
    for surface in scene.surfaces():
        S, sharp = surface.surface, float(surface.e[0]) <= NARROW
        lobe = 1 - float(surface.epsilon[0]) - float(surface.rho_d[0])       # what is left for the lobe at normal incidence
        floor = float(S.floor[0]) * float(S.G[0])
        if lobe <= NEGLIGIBLE and float(surface.b[0]) <= NEGLIGIBLE:
            rungs = [("diffuse", True)]
        elif floor <= NEGLIGIBLE or sharp:
            rungs = [("mirror", False)] if sharp else []
        else:
            rungs = [("diffuse", False)]
        found[surface.material] = rungs
    return found


def difference(found: Probe, reference: Probe, each_pixel: bool) -> float:
    """Upper bound (95 %) on how far two settings lie apart, as a fraction of the mean radiance."""
    mean = reference.value.mean()
    apart = (found.value - reference.value) / mean
    if not each_pixel:
        return upper(apart.mean(axis=1), signed=True)
    # products of independent looks: their mean is the square of the difference, without the noise of each
    products = np.mean(apart[0::2] * apart[1::2], axis=1)
    error = products.std(ddof=1) / np.sqrt(len(products))
    return float(np.sqrt(max(0.0, products.mean() + T_95 * error)))


def upper(values: np.ndarray, signed: bool = False) -> float:
    """Upper bound (95 %) of the mean of BATCHES independent values; of its absolute value."""
    mean = abs(values.mean()) if signed else values.mean()
    return float(mean + T_95 * values.std(ddof=1) / np.sqrt(BATCHES))


def fewest_bounces(by_bounce: np.ndarray, budget: float, each_pixel: bool) -> tuple[int, str, float]:
    """The smallest number of reflections within the budget, with or without a geometric tail, and the bound on what is missing.

    Beyond the last count probed the geometric continuation is added to what is missing.
    """
    shown = by_bounce.mean(axis=0)                      # (bounces, pixels); radiance is never negative, so noise adds little
    counts = shown.mean(axis=1)
    total, last = counts.sum(), len(counts) - 1
    ratio = min(counts[last] / counts[last - 1], 0.999) if counts[last - 1] > 0 else 0.0
    beyond = counts[last] * ratio / (1 - ratio) / total
    looks = by_bounce.mean(axis=2)

    def bound(missing_pixels, missing_looks):
        if each_pixel:
            return float(np.sqrt(np.mean(missing_pixels**2)) / total) + beyond
        return upper(missing_looks / looks.sum(axis=1), signed=True) + beyond

    best = (last, "none", beyond)
    for n in range(last, -1, -1):
        missing = bound(shown[n + 1:].sum(axis=0), looks[:, n + 1:].sum(axis=1))
        if missing > budget:
            break
        best = (n, "none", missing)
    for n in range(2, best[0] - 1):
        factor = counts[n] / max(counts[n - 1] - counts[n], 1e-300) if counts[n] < counts[n - 1] else 0.0
        missing = bound(shown[n + 1:].sum(axis=0) - factor * shown[n],
                        looks[:, n + 1:].sum(axis=1) - looks[:, n] ** 2 / np.maximum(looks[:, n - 1] - looks[:, n], 1e-300))
        if missing <= budget:
            return n, "tail", missing
    return best
