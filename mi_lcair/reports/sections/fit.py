"""Sections of a fit, in memory or from its report in JSON."""

from functools import partial
from types import SimpleNamespace

import numpy as np

from mi_lcair.errors import option
from mi_lcair.fitting.scatterometer.measurements import DirectionalData
from mi_lcair.physics import reflection
from mi_lcair.reports.fit_curves import model_of
from mi_lcair.reports.pictures.fit import curves
from mi_lcair.results.cells import unpacked, words_of
from mi_lcair.results.sections import Facts, OwnPicture, Section, Table

UNKNOWN_BAND = "unknown: scenes need it; give {}, or '# band_um: 3 5' in the data"
SHOWN_DEG = (0, 30, 60, 80)  # angles at which the predicted emissivity is listed
TOO_MUCH = 2  # scatter of repeated points, in stated sigmas, that is told
CORRELATED = 0.9  # correlation of errors from which a pair of parameters is listed
COMPARED = ["model", "free parameters", ("rms deviation", "decades"), "criterion", "chosen"]


def sections(fit) -> list[Section]:
    """Sections of a fit and the data that it was made from."""
    return sections_of_report(fit.as_dict(), fit, fit.measurements, fit.directional)


def sections_of_report(report: dict, fit, measurements=None, directional=None) -> list[Section]:
    """Parameters, curves and residuals of a fit, from its report.

    fit: the Fit, or `fit_of_report` with `used_points` if there are measurements.
    directional: measured tables by quantity; by default the emissivity of the report.
    """
    directional = measured_emissivity(report) if directional is None else directional
    note = "The measured data are not beside the report. Only the fitted curves are shown."
    data = [note] if measurements is None else []
    words = "Measured and fitted BRDF, residuals, and emissivity"
    picture = OwnPicture(words, partial(curves, fit, measurements, directional))
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
    return [Table(["theta (deg)", "emissivity", "standard error", "95 % interval"], rows)]


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
    return SimpleNamespace(
        **{name: report[name] for name in names},
        used_points=used_points,
        emissivity=(np.radians(table["theta_deg"]), np.asarray(table["predicted"], float)),
        emissivity_interval=table.get("interval"),
        brdf_interval=None,
    )


def measured_emissivity(report: dict) -> dict:
    """The measured emissivity of a report in JSON by quantity; empty without one."""
    table = report["emissivity"]
    if table.get("measured") is None:
        return {}
    theta, value = np.radians(table["theta_deg"]), np.asarray(table["measured"], float)
    return {"emissivity": DirectionalData(theta, value)}
