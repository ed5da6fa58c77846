"""Whether a scene is rendered sooner with or without emitter sampling."""

from dataclasses import replace

from scipy.special import fdtri

from mi_lcair.planning.bounces import BOUNCE_SHARE
from mi_lcair.planning.probe import Probe, ProbeSeries, Settings, cost, differ
from mi_lcair.planning.reference import LACK_SHARE

WORTHWHILE = 0.8  # emitter sampling is switched only if the cost falls below this share
CONFIDENCE = 0.95  # confidence with which one variance must be the smaller one


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
