"""The closure `ambient` with the temperature that fits best, as far as a probe shows."""

from dataclasses import replace

from mi_lcair.physics.blackbody import brightness_temperature, in_band_radiance
from mi_lcair.planning.probe import Probe, ProbeSeries, Settings, difference
from mi_lcair.plugins.properties import HOTTEST


def ambient_closure(
    probes: ProbeSeries, settings: Settings, reference: Probe, bounces: range, budget: float
) -> tuple[Settings, float, Probe] | None:
    """The first number of reflections after which the surroundings may be one blackbody.

    One ray after the last reflection receives the ambient radiance. Its temperature is chosen so
    that the mean radiance is that of full fidelity. Probes with a first temperature give it,
    because the closure is proportional to the ambient radiance.

    Parameters
    ----------
    probes : ProbeSeries
        Probes of the scene.
    settings : Settings
        Settings without a closure.
    reference : Probe
        Probe under full fidelity.
    bounces : range
        Numbers of reflections to try.
    budget : float
        Error that is allowed, as a fraction of the mean radiance.

    Returns
    -------
    settings : Settings
        `settings` with the closure.
    error : float
        Upper bound (95 %) of the error, as a fraction of the mean radiance.
    probe : Probe
        The probe with the first temperature, its closure scaled to the final one.

    It is None if no number suffices.
    """
    band = probes.scene.band
    first = float(brightness_temperature(band, reference.mean))
    for n in bounces:
        trial = replace(settings, max_bounces=n, closure="ambient", ambient_temperature=first)
        result = probes(trial)
        followed = result.value - result.closure
        missing = reference.value - followed
        if not (result.closure.mean() > 0 and missing.mean() > 0):
            continue
        scale = missing.mean() / result.closure.mean()
        radiance = scale * float(in_band_radiance(band, first))
        temperature = float(brightness_temperature(band, radiance))
        value = followed + scale * result.closure
        error = difference((value - reference.value) / reference.mean, probes.each_pixel)
        if error <= budget and temperature <= HOTTEST:
            settings = replace(trial, ambient_temperature=temperature)
            return settings, error, replace(result, value=value, closure=scale * result.closure)
    return None
