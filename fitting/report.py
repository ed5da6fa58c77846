"""The result `Fit`, and reports of fits in JSON, which scenes can use as materials."""

import json
from dataclasses import dataclass

import numpy as np

import mi_lcair
from mi_lcair.errors import InputError, option
from mi_lcair.fitting.quality import Quality
from mi_lcair.fitting.scatterometer.measurements import DirectionalData, Measurements
from mi_lcair.physics.reflection.models import MODELS
from mi_lcair.results import Result

KIND = "fit"  # value of the key `kind` in a fit's JSON file


@dataclass(repr=False)
class Fit(Result):
    """Parameters of a surface, how well they are determined, and how they were found.

    Attributes
    ----------
    parameters
        Values by parameter name, in the model's units.
    standard_error
        Standard errors by parameter name.
    interval
        95 % intervals (low, high) by parameter name.
    verdict
        How well each parameter is determined, in words.
    correlation
        Correlation matrix of the parameters in their order, (n, n).
    model, form
        Names of the reflection model and of the form of its equations.
    restriction
        Name of the simpler case; None for the whole model.
    rms_dex
        Root mean square of log10(data / model) [decades].
    used, used_points
        Number of fitted points, and their mask over the measurements.
    dropped
        Number of points that were left out, by reason.
    effective_points
        Number of independent points that the correlated points are worth.
    outliers
        Number of points that lie far from the model.
    converged, gradient_norm
        Whether the minimum was reached, and the relative gradient there.
    starts_in_basin
        Share of the starts that reached this minimum.
    candidates
        The variants that were compared, one report each.
    emissivity
        Angles [radians] and the emissivities 1 - HDR that the model predicts there.
    emissivity_error, emissivity_interval
        Standard errors (a,) and 95 % intervals (a, 2) of these emissivities.
    brdf_interval
        95 % intervals of the fitted BRDF at the fitted points [1/sr], (p, 2). They are those of the
        model's curve. Single points scatter more.
    emissivity_rms
        Root mean square error of the predicted emissivity up to the largest fitted angle; None
        without a measured one.
    seconds, compile_seconds
        Time of the whole fit, and the part of it spent on compiling kernels.
    settings
        The settings of the fit.
    quality
        Whether the model describes the data, see `Quality`.
    measurements, directional
        The data, and the tables of "emissivity" and "dhr" that were given, by quantity.
    """

    parameters: dict[str, float]
    standard_error: dict[str, float]
    interval: dict[str, tuple[float, float]]
    verdict: dict[str, str]
    correlation: np.ndarray
    model: str
    form: str
    restriction: str | None
    rms_dex: float
    used: int
    used_points: np.ndarray
    dropped: dict[str, int]
    effective_points: float
    outliers: int
    converged: bool
    gradient_norm: float
    starts_in_basin: float
    candidates: list[dict]
    emissivity: tuple[np.ndarray, np.ndarray]
    emissivity_error: np.ndarray
    emissivity_interval: np.ndarray
    brdf_interval: np.ndarray
    emissivity_rms: float | None
    seconds: float
    compile_seconds: float
    settings: dict
    quality: Quality
    measurements: Measurements
    directional: dict[str, DirectionalData]

    kind = KIND

    def summary(self) -> str:
        """One line: model, surface, parameters with standard errors, misfit."""
        values = ", ".join(
            f"{name} {value:.4g} +- {self.standard_error[name]:.1g}"
            for name, value in self.parameters.items()
        )
        judged = {True: "; LACK OF FIT", False: "", None: "; fit not judged"}
        return (
            f"fit of {self.model} to {self.measurements.name}: {values}; rms {self.rms_dex:.3g} "
            f"decades{judged[self.quality.lack_of_fit]}"
        )

    def entries(self) -> dict:
        """Entries of the JSON report, which is a material for scenes."""
        theta, emissivity = self.emissivity
        measured = self.directional.get("emissivity")
        alike = (
            *("model", "parameters", "form", "restriction", "standard_error", "interval"),
            *("verdict", "correlation", "rms_dex", "quality", "used", "dropped"),
            *("effective_points", "outliers", "converged", "gradient_norm", "starts_in_basin"),
            "candidates",
        )
        return {
            "name": self.measurements.name,
            "band": band_name(self.measurements),
            "band_um": self.measurements.band_um,
            **{name: getattr(self, name) for name in alike},
            "dropped": self.measurements.dropped | self.dropped,
            "emissivity": {
                "theta_deg": np.degrees(theta),
                "predicted": emissivity,
                "standard_error": self.emissivity_error,
                "interval": self.emissivity_interval,
                "measured": measured and measured.value,
                "rms_error": self.emissivity_rms,
            },
            "settings": {
                "min_brdf_per_sr" if key == "min_brdf" else key: value
                for key, value in self.settings.items()
            },
            "reading": self.measurements.reading,
            "source": self.measurements.source
            + [source for data in self.directional.values() for source in data.source],
            "version": mi_lcair.__version__,
        }

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each parameter: value, standard error, 95 % interval, unit and verdict.

        The unit "1" is that of a number without one.
        """
        units = {parameter.name: parameter.unit for parameter in MODELS[self.model].parameters}
        names = list(self.parameters)
        low, high = np.array([self.interval[name] for name in names], dtype=float).T
        return {
            "parameter": np.array(names),
            "value": np.array([self.parameters[name] for name in names], dtype=float),
            "standard_error": np.array([self.standard_error[name] for name in names], dtype=float),
            "low": low,
            "high": high,
            "unit": np.array([units[name] for name in names]),
            "verdict": np.array([self.verdict[name] for name in names]),
        }


def as_dict(fits: list[Fit]) -> dict:
    """The report on one fit or on several.

    The keys `model`, `parameters`, `form` and `band` make a report a material. Times are left out,
    so that the same data and settings give the same report.

    Returns the report of a single fit, or {"kind": "fit", "materials": {band: report}} for several.
    """
    reports = [fit.as_dict() for fit in fits]
    if len(reports) == 1:
        return reports[0]
    return {"kind": KIND, "materials": {report["band"]: report for report in reports}}


def bands(report: dict) -> list[str]:
    """The bands of the report in a fit's JSON file, such as ["3-5"] [um].

    report: the file's content. The list is empty if the data did not state their band, or if the
    file holds no fit.
    """
    reports = report.get("materials", {"": report})
    stated = [entry.get("band") for entry in reports.values() if isinstance(entry, dict)]
    return [band for band in stated if isinstance(band, str)]


def to_json(report: dict) -> str:
    """The report as strict JSON, with at most 17 digits a number, from which it is read exactly."""
    return json.dumps(report, indent=2, allow_nan=False, ensure_ascii=False) + "\n"


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
                f"band; say it in the file, '# band_um: 3 5', or with {option('band')} for "
                "each file"
            )
        if band in file_of_band:
            raise InputError(
                f"{file_of_band[band]} and {file} have the same band, {band} um; put repeated "
                f"scans of one surface into one file, and fit different surfaces one by one"
            )
        file_of_band[band] = file
