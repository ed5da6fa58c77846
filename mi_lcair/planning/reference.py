"""The probe under full fidelity, with which the other probes are compared."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.planning.lobes import candidates
from mi_lcair.planning.probe import (
    FEW_COUNTS,
    Probe,
    ProbeSeries,
    Settings,
    differ,
    half_width,
)
from mi_lcair.plugins.recorders.by_bounce import MAX_BOUNCE_CHANNELS
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.window import FIRST_PATHS, PILOT_SPP

# Reflections that a probe follows: at least the first number, at most the second.
PROBED_BOUNCES, MOST_BOUNCES = 32, MAX_BOUNCE_CHANNELS - 1
# A scene whose own number of reflections is smaller is first probed with few bounce channels. So is
# every image, because it takes so many paths that another kernel matters little.
MANY_BOUNCES = 16
LACK_SHARE = 0.3  # share that a source which no path has hit may add
MORE_PATHS = 2**19  # paths of a probe up to which it is enlarged before emitters are sampled
MOST_PATHS = 2**20  # paths of the longest probe
LARGE_PROBE = 0.5  # share of the render's paths from which on a probe is too large to pay


def reference_probe(
    probes: ProbeSeries, given: Settings, tolerance: float, expected: Callable
) -> tuple[Settings, Probe]:
    """Settings of full fidelity, and a probe under them that has missed no important source.

    Lobes that are exact take the place of the BRDF at once. The first probe uses the scene's own
    emitter sampling. If it may have missed a source, further ones trace more paths or sample
    emitters. The first probe is returned, whatever it has missed, if a probe with more paths would
    cost about as much as the render.

    Parameters
    ----------
    probes : ProbeSeries
    given : Settings
        The scene's own settings.
    tolerance : float
        Error that is allowed, as a fraction of the mean radiance.
    expected : callable
        Number of paths of all renders under full fidelity, estimated from a probe.

    Raises InputError for a dark scene, and if too many paths would be needed.
    """
    scene = probes.scene
    full = Settings(
        lobe=dict.fromkeys(given.lobe, "brdf") | candidates(scene, exact=True),
        max_bounces=min(max(given.max_bounces, PROBED_BOUNCES), MOST_BOUNCES),
        emitter_sampling=given.emitter_sampling,
    )
    counted = FEW_COUNTS if probes.each_pixel or given.max_bounces < MANY_BOUNCES else None
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
            # Where the source matters more than the noise, the render needs this answer too.
            noise = half_width(reference.value.mean(axis=1)) / reference.mean
            is_large = more * reference.paths > LARGE_PROBE * expected(reference)
            if is_first and is_large and noise > reference.may_lack:
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
