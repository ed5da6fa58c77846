"""Likely causes of a gross misfit: signs of theta_r, and the unit of the BRDF."""

from dataclasses import replace

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.fitting.data import select
from mi_lcair.fitting.scatterometer.measurements import Measurements
from mi_lcair.fitting.search import compare
from mi_lcair.fitting.selection import Variant
from mi_lcair.fitting.settings import FitSettings

GROSS_DEX = 0.2  # misfit from which causes are tried [decades]: a factor of 1.6
STARTS = 6  # starting points of each trial
SHARE = 0.35  # a cause is likely if it leaves at most this share of the misfit [decades]
DECADES = 4  # of the largest scale by which a BRDF is divided
FALLS = 0.75  # ratio of misfits below which a further decade is tried
HALVINGS = 4  # of a decade, in the search for the least scale that fits
ENOUGH = 2.0  # a scale fits if its misfit is at most this multiple of that of a larger scale
REFLECTANCE = np.pi, 1.25  # scale of a reflectance factor, and the factor within which it is named


def likely_cause(
    measurements: Measurements, compared: list[Variant], settings: FitSettings, misfit_dex: float
) -> str:
    """The cause of a misfit [decades] in words, if a trial finds one; otherwise "".

    The models are fitted with the opposite sign of theta_r, and with the BRDF divided by a scale.
    The least scale that fits is named, since any larger one looks like an absorber. A BRDF that is
    too small looks so itself.
    """
    if misfit_dex < GROSS_DEX:
        return ""
    whole = [variant for variant in compared if variant.restriction is None]
    settings = replace(settings, starts=min(settings.starts, STARTS))
    sigma, allowed = measurements.sigma, SHARE * misfit_dex

    def left(scale: float = 1.0, sign: float = 1.0) -> float:
        """Misfit of changed measurements [decades]."""
        changed = replace(
            measurements,
            theta_r=sign * measurements.theta_r,
            brdf=measurements.brdf / scale,
            sigma=None if sigma is None else sigma / scale,
        )
        try:
            data, _, _ = select(
                changed,
                settings.loss,
                settings.half_angle,
                settings.max_angle_deg,
                settings.min_brdf / scale,
                min(len(variant.model.parameters) for variant in whole),
            )
        except InputError:  # too few points
            return np.inf
        return data.rms_dex(compare(data, whole, settings, lambda: None)[0])

    trials = [(left(sign=-1.0), "the opposite sign of theta_r")]
    misfit, high = misfit_dex, 0.0
    while high < DECADES and (smaller := left(10 ** (high + 1))) < FALLS * misfit:
        misfit, high = smaller, high + 1
    if misfit <= allowed:
        low = high - 1
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            low, high = (low, middle) if left(10**middle) <= ENOUGH * misfit else (middle, high)
        trials.append((misfit, f"the BRDF divided by {_named(10**high)}"))
    misfit, words = min(trials)
    return f"with {words} it fits to {misfit:.2g} decades; check the file" * (misfit <= allowed)


def _named(scale: float) -> str:
    """A scale in words, with what has such a scale."""
    pi, near = REFLECTANCE
    what = " (pi? a reflectance factor has it)" if 1 / near < scale / pi < near else ""
    return f"{float(f'{scale:.2g}'):g} or more{what}"
