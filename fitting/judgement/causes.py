"""Likely causes of a gross misfit: signs of theta_r, and the unit of the BRDF."""

from dataclasses import replace

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.fitting.data import select
from mi_lcair.fitting.scatterometer.measurements import Measurements
from mi_lcair.fitting.search import compare
from mi_lcair.fitting.selection import Variant
from mi_lcair.fitting.settings import FitSettings

GROSS_DEX = 0.3  # misfit from which causes are tried [decades]: a factor of 2
STARTS = 6  # starting points of each trial
# A cause is likely if it leaves at most this share of the misfit [decades].
SHARE = 0.35
# Factors by which a BRDF may be too large, in words. One that is too small looks like an absorber.
FACTORS = {np.pi: "pi, as a reflectance factor is", 10.0: "10", 100.0: "100", 1000.0: "1000"}


def likely_cause(
    measurements: Measurements, compared: list[Variant], settings: FitSettings, misfit_dex: float
) -> str:
    """The cause of a misfit [decades] in words, if a trial finds one; otherwise "".

    The models are fitted with the opposite sign of theta_r, and with the BRDF divided by each of
    FACTORS. The trial that leaves the least misfit is named.
    """
    if misfit_dex < GROSS_DEX:
        return ""
    whole = [variant for variant in compared if variant.restriction is None]
    settings = replace(settings, starts=min(settings.starts, STARTS))
    sigma = measurements.sigma
    trials = {
        "the opposite sign of theta_r": (replace(measurements, theta_r=-measurements.theta_r), 1.0)
    }
    for factor, words in FACTORS.items():
        scaled = replace(
            measurements,
            brdf=measurements.brdf / factor,
            sigma=None if sigma is None else sigma / factor,
        )
        trials[f"the BRDF divided by {words}"] = scaled, factor
    left = {}
    for words, (changed, factor) in trials.items():
        try:
            data, _, _ = select(
                changed,
                settings.loss,
                settings.half_angle,
                settings.max_angle_deg,
                settings.min_brdf / factor,
                min(len(variant.model.parameters) for variant in whole),
            )
        except InputError:  # too few points
            continue
        best, _, _ = compare(data, whole, settings, lambda: None)
        left[words] = data.rms_dex(best)
    words = min(left, key=left.get, default="")
    if not words or left[words] > SHARE * misfit_dex:
        return ""
    return f"with {words} it fits to {left[words]:.2g} decades; check the file"
