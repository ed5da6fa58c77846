"""Reports of fits in JSON, which scenes can use as materials."""

import json
from dataclasses import asdict

import numpy as np

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.fitting.scatterometer.measurements import Measurements

KIND = "fit"  # value of the key `kind` in a fit's JSON file


def as_dict(results) -> dict:
    """The report on one fit or on several.

    The keys `model`, `parameters`, `form` and `band` make a report a material. Times are left out,
    so that the same data and settings give the same report.

    results: tuples (Measurements, Fit, {quantity: DirectionalData}). Returns the report of a single
    fit, or {"kind": "fit", "materials": {band: report}} for several.
    """
    reports = [{"kind": KIND, **entries(*result)} for result in results]
    return (
        reports[0]
        if len(reports) == 1
        else {"kind": KIND, "materials": {report["band"]: report for report in reports}}
    )


def bands(report: dict) -> list[str]:
    """The bands of the report in a fit's JSON file, such as ["3-5"] [um].

    report: the file's content. The list is empty if the data did not state their band, or if the
    file holds no fit.
    """
    reports = report.get("materials", {"": report})
    found = [own.get("band") for own in reports.values() if isinstance(own, dict)]
    return [band for band in found if isinstance(band, str)]


def to_json(report: dict) -> str:
    """The report as strict JSON, with at most 17 digits a number, from which it is read exactly."""
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
    """The band as scenes name it, such as "3-5" [um]; None if the file does not state it."""
    return "{:g}-{:g}".format(*measurements.band_um) if measurements.band_um else None


def check_bands(measurements: list[Measurements]) -> None:
    """Raise InputError if several files do not each state a different band.

    The report of several fits is a table by band. A single file is always accepted.
    """
    file_of_band = {}
    for scan in measurements if len(measurements) > 1 else []:
        file, band = scan.source[0]["file"], band_name(scan)
        if band is None:
            raise InputError(
                f"{file}: which band is it? several files are one material with a fit for each "
                f"band; say it in the file, '# band_um: 3 5', or with --band for each file"
            )
        if band in file_of_band:
            raise InputError(
                f"{file_of_band[band]} and {file} have the same band, {band} um; put repeated "
                f"scans of one surface into one file, and fit different surfaces one by one"
            )
        file_of_band[band] = file


def entries(measurements: Measurements, fit, directional: dict) -> dict:
    """Entries of the report on one fit, after `kind`."""
    theta, emissivity = fit.emissivity
    measured = directional.get("emissivity")
    return {
        "name": measurements.name,
        "band": band_name(measurements),
        "band_um": measurements.band_um,
        "model": fit.model,
        "parameters": fit.parameters,
        "form": fit.form,
        "restriction": fit.restriction,
        "standard_error": fit.standard_error,
        "interval": fit.interval,
        "verdict": fit.verdict,
        "correlation": fit.correlation,
        "rms_dex": fit.rms_dex,
        "quality": asdict(fit.quality),
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
        "settings": {
            "min_brdf_per_sr" if key == "min_brdf" else key: value
            for key, value in fit.settings.items()
        },
        "reading": measurements.reading,
        "source": measurements.source
        + [source for data in directional.values() for source in data.source],
        "version": mi_lcair.__version__,
    }
