"""The result `Fit`, and reports of fits in JSON, which scenes can use as materials."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np

import mi_lcair
from mi_lcair.errors import InputError, option
from mi_lcair.extras import named
from mi_lcair.fitting.model import model_of
from mi_lcair.fitting.quality import Quality
from mi_lcair.fitting.scatterometer.reading import DirectionalData, Measurements
from mi_lcair.fitting.uncertainty import LEVEL
from mi_lcair.physics import reflection
from mi_lcair.physics.reflection.models import MODELS
from mi_lcair.results import Result, entry
from mi_lcair.sections import Facts, OwnPicture, Section, Table, unpacked, words_of

KIND = "fit"  # value of the key `kind` in a fit's JSON file
UNKNOWN_BAND = "unknown: scenes need it; give {}, or '# band_um: 3 5' in the data"
SHOWN_DEG = (0, 30, 60, 80)  # angles at which the predicted emissivity is listed
TOO_MUCH = 2  # scatter of repeated points, in stated sigmas, that is told
CORRELATED = 0.9  # correlation of errors from which a pair of parameters is listed
COMPARED = ["model", "free parameters", ("rms deviation", "decades"), "criterion", "chosen"]


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
        Number of independent points with the same information as the correlated points.
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
    used_points: np.ndarray = entry()
    dropped: dict[str, int]
    effective_points: float
    outliers: int
    converged: bool
    gradient_norm: float
    starts_in_basin: float
    candidates: list[dict]
    emissivity: tuple[np.ndarray, np.ndarray] = entry()
    emissivity_error: np.ndarray = entry()
    emissivity_interval: np.ndarray = entry()
    brdf_interval: np.ndarray = entry()
    emissivity_rms: float | None = entry()
    seconds: float = entry()
    compile_seconds: float = entry()
    settings: dict
    quality: Quality
    measurements: Measurements = entry()
    directional: dict[str, DirectionalData] = entry()

    kind = KIND
    heading = "Fit"
    computed = {
        "name": "measurements.name",
        "band_um": "measurements.band_um",
        "reading": "measurements.reading",
    }
    drawn_by = "mi_lcair.show.pictures.fit:figure"

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

    def facts(self) -> Iterator[Any]:
        """Parameters and curves, and the data that they were made from."""
        made = sections_of_report(self.as_dict(), self, self.measurements, self.directional)
        return iter([*made[0].parts, *made[1:]])

    def entries(self) -> dict:
        """Entries of the JSON report, which is a material for scenes."""
        theta, emissivity = self.emissivity
        measured = self.directional.get("emissivity")
        return super().entries() | {
            "band": band_name(self.measurements),
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
    names = [entry.get("band") for entry in reports.values() if isinstance(entry, dict)]
    return [band for band in names if isinstance(band, str)]


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


def sections_of_report(report: dict, fit, measurements=None, directional=None) -> list[Section]:
    """Parameters, curves and residuals of a fit, from its report.

    fit: the Fit, or `fit_of_report` with `used_points` if there are measurements.
    directional: measured tables by quantity; by default the emissivity of the report.
    """
    directional = measured_emissivity(report) if directional is None else directional
    note = "The measured data are not in the report's folder. Only the fit is shown."
    data = [note] if measurements is None else []
    draw = named("mi_lcair.show.pictures.fit:curves")
    words = "Measured and fitted BRDF, residuals, and emissivity"
    picture = OwnPicture(words, partial(draw, fit, measurements, directional))
    compared = [
        [
            ", ".join(filter(None, (c["model"], c["form"], c["restriction"]))),
            c["free_parameters"],
            c["rms_dex"],
            c["criterion"],
            c["chosen"],
        ]
        for c in report["candidates"]
    ]
    settings = [(words_of(key), unpacked(value)) for key, value in report["settings"].items()]
    sources = [(f"file {s['file']}", f"SHA-256 {s['sha256']}") for s in report["source"]]
    made = Facts([*settings, *sources, ("version", report["version"])])
    return [
        Section("Fit", [Facts(described(report, fit)), parameters(report), *emissivities(report)]),
        Section("Data, model and residuals", [*data, picture]),
        Section("Models that were compared", [Table(COMPARED, compared)], is_detail=True),
        Section("How the fit was made", [made], is_detail=True),
    ]


def described(report: dict, fit) -> list[tuple[str, str]]:
    """Rows about data, model and misfit."""
    quality, noise = report["quality"], report["quality"]["noise_dex"]
    explained = "" if noise is None else f"; sigma explains {noise:.4f}"
    dropped = "; ".join(f"{count} {reason}" for reason, count in report["dropped"].items())
    emissivity = report["emissivity"]["rms_error"]
    repeated = report["reading"].get("repeated", 0)  # older reports do not have it
    averaged = f"; {repeated} rows repeat angles of others, and are averaged" if repeated else ""
    if (scatter := report["reading"].get("scatter_sigmas") or 0) > TOO_MUCH:
        averaged += f", though they scatter {scatter:.3g} times as much as sigma says"
    unknown_band = UNKNOWN_BAND.format(option("band", "3-5"))
    converged = "converged" if report["converged"] else "NOT converged"
    return [
        ("surface", f"{report['name'] or 'not named'} ({report['source'][0]['file']})"),
        ("band", f"{report['band']} um" if report["band"] else unknown_band),
        ("model", model_of(fit)),
        ("points used", f"{report['used']}{averaged}"),
        ("left out", dropped or "none"),
        ("rms", f"{report['rms_dex']:.4f} decades{explained}"),
        ("fit", quality["verdict"]),
        *([("correlated", pairs)] if (pairs := correlated(report)) else []),
        *([("emissivity", f"rms error {emissivity:.3f}")] if emissivity is not None else []),
        (
            "minimum",
            f"{converged}, relative gradient {report['gradient_norm']:.1e}; "
            f"{report['starts_in_basin']:.0%} of the starts reached it",
        ),
    ]


def parameters(report: dict) -> Table:
    """A row for each parameter of the model."""
    rows = []
    for parameter in reflection.model(report["model"]).parameters:
        name, unit = parameter.name, parameter.unit
        low, high = report["interval"][name]
        rows.append(
            [
                name if unit in ("", "1") else f"{name} ({unit})",
                f"{report['parameters'][name]:.5g}",
                f"{report['standard_error'][name]:.2g}",
                f"{low:.4g} to {high:.4g}",
                report["verdict"][name],
            ]
        )
    return Table(["parameter", "value", "standard error", "95 % interval", "verdict"], rows)


def emissivities(report: dict) -> list[Table]:
    """The predicted emissivity with its error at some angles; none in a report of an older version.

    The angles are those of the table that are nearest to SHOWN_DEG.
    """
    table = report["emissivity"]
    if "interval" not in table:
        return []
    angles = np.asarray(table["theta_deg"], float)
    rows = []
    for k in dict.fromkeys(int(abs(angles - shown).argmin()) for shown in SHOWN_DEG):
        low, high = table["interval"][k]
        error = f"{table['standard_error'][k]:.2g}"
        interval = f"{low:.4g} to {high:.4g}"
        rows.append([f"{angles[k]:g}", f"{table['predicted'][k]:.4g}", error, interval])
    condition = LEVEL if any(LEVEL in words for words in report["verdict"].values()) else ""
    names = ["theta (deg)", "emissivity", "standard error", f"95 % interval{condition}"]
    return [Table(names, rows)]


def correlated(report: dict) -> str:
    """Pairs of parameters whose errors are strongly correlated, in words; "" for none."""
    names, matrix = list(report["parameters"]), np.asarray(report["correlation"], float)
    pairs = [
        f"{names[i]} and {names[j]} {matrix[i, j]:+.2f}"
        for i, j in zip(*np.triu_indices(len(names), 1))
        if abs(matrix[i, j]) > CORRELATED
    ]
    return ", ".join(pairs)


def fit_of_report(report: dict, used_points=None) -> SimpleNamespace:
    """The fit of a report in JSON, with what its drawing needs.

    used_points: mask of the fitted points, where the measurements are known.
    """
    names = ("model", "form", "restriction", "parameters", "settings")
    table = report["emissivity"]
    theta, predicted = (np.asarray(table[name], float) for name in ("theta_deg", "predicted"))
    interval = table.get("interval")
    if interval is not None:
        interval = np.asarray(interval, float).reshape(len(theta), 2)
    return SimpleNamespace(
        **{name: report[name] for name in names},
        used_points=used_points,
        emissivity=(np.radians(theta), predicted.reshape(theta.shape)),
        emissivity_interval=interval,
        brdf_interval=None,
    )


def measured_emissivity(report: dict) -> dict:
    """The measured emissivity of a report in JSON by quantity; empty without one."""
    table = report["emissivity"]
    if table.get("measured") is None:
        return {}
    theta, value = np.radians(table["theta_deg"]), np.asarray(table["measured"], float)
    return {"emissivity": DirectionalData(theta, value)}
