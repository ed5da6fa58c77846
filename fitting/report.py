"""A fit as data: a material that a scene can use at once, with all that is known about it."""

import json

import numpy as np

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.fitting.scatterometer.measurements import Measurements


def as_dict(results) -> dict:
    """The report on `results`, each (Measurements, Fit, {quantity: DirectionalData}): that of the
    fit, or of several fits {"materials": {band: report}}.

    `model`, `parameters`, `form` and `band` of a report make it a material. Times are left out:
    the same data and settings give the same report.
    """
    reports = [_report(*result) for result in results]
    return (
        reports[0]
        if len(reports) == 1
        else {"materials": {report["band"]: report for report in reports}}
    )


def to_json(report: dict) -> str:
    """Strict JSON; each number with the digits, at most 17, that give it back exactly."""
    return (
        json.dumps(
            report,
            indent=2,
            allow_nan=False,
            ensure_ascii=False,
            default=lambda value: value.tolist(),
        )
        + "\n"
    )


def band_name(measurements: Measurements) -> str | None:
    """The band as scenes name it, "3-5" in um, or None where the file does not state it."""
    return "{:g}-{:g}".format(*measurements.band_um) if measurements.band_um else None


def check_bands(measurements: list[Measurements]) -> None:
    """InputError unless several files have each a band of its own, by which the report can tell
    them apart.
    """
    seen = {}
    for one in measurements if len(measurements) > 1 else []:
        file, band = one.source[0]["file"], band_name(one)
        if band is None:
            raise InputError(
                f"{file}: which band is it? several files are one material with a fit for each "
                f"band; say it in the file, '# band_um: 3 5'"
            )
        if band in seen:
            raise InputError(
                f"{seen[band]} and {file} have the same band, {band} um; put repeated scans of "
                f"one surface into one file, and fit different surfaces one by one"
            )
        seen[band] = file


def _report(measurements: Measurements, fit, directional: dict) -> dict:
    theta, emissivity = fit.emissivity
    measured = directional.get("emissivity")
    return {
        "name": measurements.name,
        "band": band_name(measurements),
        "model": fit.model,
        "parameters": fit.parameters,
        "form": fit.form,
        "restriction": fit.restriction,
        "standard_error": fit.standard_error,
        "interval": fit.interval,
        "verdict": fit.verdict,
        "correlation": fit.correlation,
        "rms_dex": fit.rms_dex,
        "used": fit.used,
        "dropped": measurements.dropped | fit.dropped,
        "effective_points": fit.effective_points,
        "outliers": fit.outliers,
        "converged": fit.converged,
        "gradient_norm": fit.gradient_norm,
        "starts_in_basin": fit.starts_in_basin,
        "candidates": fit.candidates,
        "emissivity": {
            "theta_deg": np.degrees(theta),
            "predicted": emissivity,
            "measured": measured and measured.value,
            "rms_error": fit.emissivity_rms,
        },
        "settings": fit.settings,
        "reading": measurements.reading,
        "source": measurements.source
        + [source for data in directional.values() for source in data.source],
        "version": mi_lcair.__version__,
    }
