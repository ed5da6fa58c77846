"""Which panels and tables a result gets."""

import json

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.reports.page.image_panel import image_panel
from mi_lcair.reports.page.model_panel import model_panel, with_emissivity
from mi_lcair.reports.page.page import Section, paragraph
from mi_lcair.reports.page.spectrum_panel import contrast_panel, spectrum_panel
from mi_lcair.reports.page.tables import facts, listed, long_table, table, with_error, words_of
from mi_lcair.reports.page.trend_panel import trend_panel

IMAGE_FIRST = ("apparent.Y", "Y", "temperature.Y")  # channels that are shown first, at most two
CAMERA_FIRST = ("temperature.Y", "apparent.Y")


def of_result(result, **options) -> tuple[str, list[Section]]:
    """Title and sections of a result in memory.

    options: of a Signature with facets, `scene`, the Scene whose model is shown; of a Fit,
    `measurements`. Raises InputError for a result of another kind.
    """
    kind = type(result).__name__
    if kind not in RESULTS:
        raise InputError(f"no page for a {kind}; report takes {', '.join(RESULTS)}, or their files")
    return RESULTS[kind](result, **options)


def image_sections(channels: dict, header: dict, size_m=None) -> list[Section]:
    """The images of an EXR or of a render, and its header as how it was made."""
    first = CAMERA_FIRST if "counts.Y" in channels else IMAGE_FIRST
    shown = [name for name in first if name in channels][:2]
    height, width = next(iter(channels.values())).shape
    words = f"{width} × {height} pixels, {len(channels)} channels. "
    return [
        Section(
            "Image",
            [paragraph(words + image_words(channels)), image_panel(channels, shown, size_m)],
        ),
        Section("How the image was made", [header_table(header)]),
    ]


def image_words(channels: dict) -> str:
    """What the channels of an image are, in a sentence or two."""
    known = {
        "stderr.Y": "stderr.Y is the standard error of Y",
        "apparent.Y": "apparent.Y is the radiance that arrives through the air",
        "temperature.Y": "temperature.Y is the brightness temperature",
        "range.Y": "range.Y is the distance to what is seen",
    }
    told = [words for name, words in known.items() if name in channels]
    if any(name.startswith("seen.") for name in channels):
        told.append(
            "group.LABEL.Y is radiance by what emitted it, seen.LABEL.Y by what is seen first"
        )
    return "; ".join(told) + "." if told else ""


def header_table(header: dict) -> str:
    """The header of an image as a table."""
    rows = []
    for name, value in header.items():
        rows.append((words_of(name), unpacked(value)))
    return facts(rows)


def unpacked(value):
    """A header's value; JSON's objects as `key=value` pairs."""
    if isinstance(value, str) and value.startswith("{"):
        try:
            entries = json.loads(value)
        except ValueError:
            return value
        return ", ".join(f"{key}={item}" for key, item in entries.items()) or "none given"
    return value


def intensity_section(entries: dict) -> Section:
    """Tables of a signature's intensities, from the dictionary of its JSON."""
    target, scene = entries["target"], entries["scene"]
    parts = {"target": target, "scene": scene}
    columns = ["", *((name, "W sr⁻¹") for name in parts)]
    pick = lambda part, *names: next(part[name] for name in names if name in part)
    value = lambda part: pick(part, "intensity_W_sr", "intensity")
    error = lambda part: pick(part, "standard_error_W_sr", "standard_error")
    half = lambda part: pick(part, "half_width_W_sr", "half_width")
    whole = table(
        columns,
        [
            [
                "intensity ± standard error",
                *(with_error(value(p), error(p)) for p in parts.values()),
            ],
            ["half of the 95 % interval", *(f"{half(p):.2g}" for p in parts.values())],
        ],
    )
    pieces = [
        paragraph(
            f"Band {entries['band']}. The target is what comes from the model's facets, the "
            "scene is all that lies in the sensor's window. Errors are standard errors."
        ),
        whole,
    ]
    bounces = [pick(part, "by_bounce_W_sr", "by_bounce") for part in parts.values()]
    pieces.append(
        table(
            ["number of reflections", *columns[1:]],
            [[k, *values] for k, values in enumerate(zip(*bounces))],
        )
    )
    for key, title in (("by_group", "emitted by"), ("by_seen", "seen first")):
        values = [pick(part, f"{key}_W_sr", key) for part in parts.values()]
        errors = [pick(part, f"{key}_error_W_sr", f"{key}_error") for part in parts.values()]
        rows = [
            [label, *(with_error(v.get(label), e.get(label)) for v, e in zip(values, errors))]
            for label in values[1]
        ]
        pieces.append(table([title, *columns[1:]], rows))
    return Section("Intensity", pieces)


def facets_section(columns: dict[str, np.ndarray], facet_table=None, toward=None) -> Section:
    """The facets: the model in space, if the scene's table is known, and a long table."""
    parts = []
    if facet_table is not None:
        parts.append(model_panel(facet_table, columns, toward))
    sort = "intensity_W_sr" if "intensity_W_sr" in columns else None
    parts.append(long_table(columns, sort))
    return Section("Facets", parts)


def spectrum_section(wavelengths_um, curves: dict) -> Section:
    """Spectral intensity of target and scene, by what emitted it."""
    return Section(
        "Spectral intensity",
        [
            paragraph(
                "Before any atmosphere, by what emitted it. A click on a name hides a curve."
            ),
            spectrum_panel(wavelengths_um, curves),
        ],
    )


def signature_sections(signature, scene=None, sensor: int = 0) -> list[Section]:
    """All that a Signature in memory holds; scene: the Scene it was made from."""
    sections = [intensity_section(signature.as_dict())]
    if signature.effective_areas is not None:
        from mi_lcair.signatures.spectral_intensity import curves

        wavelengths = signature.effective_areas.wavelengths_um()
        sections.append(
            spectrum_section(wavelengths, curves(signature.effective_areas, wavelengths))
        )
    if signature.facets is not None:
        columns, facet_table, toward = dict(signature.facets.columns), None, None
        if scene is not None:
            facet_table, toward = model_of(scene, sensor)
            columns = with_emissivity(columns, scene.band)
        sections.append(facets_section(columns, facet_table, toward))
    return sections


def model_of(scene, sensor: int = 0):
    """Facets of a scene, and the direction toward its sensor."""
    from mi_lcair.rendering.facet_table import FacetTable
    from mi_lcair.rendering.window import window

    return FacetTable(scene), -window(scene.sensor(sensor))[3]


def trend_sections(columns: dict, band: str) -> list[Section]:
    """Polar curves and the table of a trend."""
    return [
        Section(
            "Intensity by aspect",
            [
                paragraph(
                    f"Band {band}. Azimuth 0° sees the nose, 90° the left side. Shaded bands are "
                    "95 % intervals of the intensity; its parts have none in the table."
                ),
                trend_panel(columns),
                long_table(columns),
            ],
        )
    ]


def contrast_sections(contrast) -> list[Section]:
    """Irradiances, spectra and detection ranges of a contrast."""
    detector = contrast.detector
    rows = [
        [
            row.max_bounces,
            with_error(*row.intensity),
            *(with_error(*term) for term in (row.target, row.background, row.path)),
            f"{row.total.value:.5g} ± {row.half_width:.2g}",
            with_error(*row.nei_max),
            *([] if row.detected is None else ["yes" if row.detected else "no"]),
        ]
        for row in contrast.rows
    ]
    watts = "W m⁻²"
    columns = [
        "reflections up to",
        ("intensity", "W sr⁻¹"),
        ("target", watts),
        ("background", watts),
        ("path", watts),
        ("contrast (95 %)", watts),
        ("largest nei", watts),
        *([] if contrast.rows[0].detected is None else ["detected"]),
    ]
    first = contrast.rows[-1]
    pieces = [
        facts(
            [
                ("scenario", f"{contrast.scenario.name}: {contrast.scenario.title}"),
                ("band", detector.band.label),
                ("range", f"{contrast.path.range_m:.6g} m"),
                ("elevation of the line of sight", f"{contrast.sight_elevation_deg:.4g}°"),
                (
                    "atmosphere",
                    f"{contrast.air.name}: mean transmittance {contrast.transmittance:.4f}, path "
                    f"{contrast.path_radiance:.5g} W m⁻² sr⁻¹",
                ),
                (
                    "background",
                    f"{contrast.background_name}: {contrast.background_radiance:.5g} W m⁻² sr⁻¹",
                ),
                (
                    "target",
                    f"projected area {with_error(*first.projected_area)} m², "
                    f"{first.solid_angle:.5g} sr",
                ),
            ]
        ),
        table(columns, rows),
        listed(contrast.remarks),
    ]
    sections = [Section("Contrast", pieces), Section("Spectra", [contrast_panel(contrast)])]
    if detector.nei is not None:
        sections.insert(1, ranges_section(contrast))
    return sections


def ranges_section(contrast) -> Section:
    """Detection ranges of a contrast whose sensor has a nei."""
    rows = []
    for row, detection in zip(contrast.rows, contrast.detection_ranges()):
        intervals = ", ".join(f"{a:.5g} to {b:.5g}" for a, b in detection.intervals_m)
        if detection.at_least:
            note = "at least: the table of the air ends there"
        elif detection.intervals_m:
            note = f"± {detection.standard_error_m:.2g} m (standard error of the largest)"
        else:
            note = "no range"
        rows.append([row.max_bounces, intervals or "none", note])
    words = (
        f"Ranges at which the contrast reaches {contrast.detector.snr:g} times the "
        f"noise-equivalent irradiance of {contrast.detector.nei:g} W m⁻²."
    )
    return Section(
        "Detection range",
        [paragraph(words), table(["reflections up to", ("detected", "m"), "remark"], rows)],
    )


def audit_section(audit) -> Section:
    """Energy of a scene: what is emitted, absorbed and escapes, by material."""
    percent = lambda name, key: "{:.3f} ± {:.1g}".format(
        *(100 * v for v in audit.shares[name][key])
    )
    keys = ("absorbed", "escaped", "behind", "created", "unfinished", "balance")
    shares = ("absorbed", "reflected", "behind", "created", "scaled")
    return Section(
        "Energy audit",
        [
            paragraph(
                f"Band {audit.band}, {audit.photons} photons. Flux is followed from the emitters "
                "until it is absorbed or escapes. Shares of the emitted flux:"
            ),
            table(
                [("emitted", "W"), *((key, "%") for key in keys)],
                [[with_error(*audit.total["emitted"]), *(percent("scene", key) for key in keys)]],
            ),
            table(
                ["material", ("emitted", "W"), ("incident", "W")]
                + [(f"{key}, of incident", "%") for key in shares],
                [
                    [name, flux["emitted"][0], flux["incident"][0]]
                    + [percent(name, key) for key in shares]
                    for name, flux in audit.materials.items()
                ],
            ),
            listed(audit.remarks or ["Energy is conserved within these errors."]),
        ],
    )


def plan_section(plan) -> Section:
    """Settings that a plan chose, and what it leaves out."""
    closure = plan.closure
    if plan.ambient_temperature is not None:
        closure += f" at {plan.ambient_temperature:.1f} K"
    of = "rms over the pixels" if plan.each_pixel else "of the target's intensity"
    lobes = ", ".join(f"{name or 'unnamed'}: {lobe}" for name, lobe in plan.lobe.items())
    return Section(
        "Plan",
        [
            facts(
                [
                    ("tolerance", f"{plan.tolerance:.2%}"),
                    ("lobes", lobes or "no material with a fidelity ladder"),
                    ("reflections", f"{plan.max_bounces}, closure {closure}"),
                    ("emitter sampling", "on" if plan.emitter_sampling else "off"),
                    ("error", f"at most {plan.bias:.2%} of the mean (95 %), {of}"),
                    ("left for noise", f"{plan.noise_tolerance:.2%}"),
                    *(("left out", line) for line in plan.left_out or ["nothing"]),
                    *(("not tried", line) for line in plan.untried),
                ]
            )
        ],
    )


def fit_sections(report: dict, fit=None, measurements=None, directional=None) -> list[Section]:
    """Parameters, curves and residuals of a fit, from its report.

    fit: the Fit, with `used_points` if there are measurements; by default that of the report.
    """
    from mi_lcair.physics import reflection
    from mi_lcair.reports.page.fit_panel import fit_of_report, fit_panel

    model = reflection.model(report["model"])
    fit = fit or fit_of_report(report)
    rows = [
        [
            f"{parameter.name} ({parameter.unit})" if parameter.unit not in ("", "1") else parameter.name,
            report["parameters"][parameter.name],
            f"{report['standard_error'][parameter.name]:.2g}",
            "{:.4g} to {:.4g}".format(*report["interval"][parameter.name]),
            report["verdict"][parameter.name],
        ]
        for parameter in model.parameters
    ]
    columns = ["parameter", "value", "standard error", "95 % interval", "verdict"]
    dropped = "; ".join(f"{count} {reason}" for reason, count in report["dropped"].items())
    described = [
        ("surface", report["name"] or "not named"),
        ("band", f"{report['band']} µm" if report["band"] else "not stated"),
        ("model", ", ".join(filter(None, (model.title, report["form"], report["restriction"])))),
        ("points used", report["used"]),
        ("left out", dropped or "none"),
        ("rms deviation", f"{report['rms_dex']:.4f} decades"),
        ("rms error of the emissivity", report["emissivity"]["rms_error"]),
        ("minimum", "converged" if report["converged"] else "NOT converged"),
    ]
    compared = [
        [
            ", ".join(filter(None, (c["model"], c["form"], c["restriction"]))),
            c["free_parameters"],
            c["rms_dex"],
            c["criterion"],
            "yes" if c["chosen"] else "no",
        ]
        for c in report["candidates"]
    ]
    settings = [(words_of(key), unpacked(value)) for key, value in report["settings"].items()]
    settings = [
        (key, value if not isinstance(value, dict) else str(value)) for key, value in settings
    ]
    sources = [(f"file {s['file']}", f"SHA-256 {s['sha256']}") for s in report["source"]]
    note = [] if measurements is not None else [
        paragraph(
            "The measured data are not beside the report. Only the fitted curves are shown.",
            "note",
        )
    ]  # fmt: skip
    return [
        Section("Fit", [facts(described), table(columns, rows)]),
        Section("Data, model and residuals", [*note, fit_panel(fit, measurements, directional)]),
        Section(
            "Models that were compared",
            [
                table(
                    [
                        "model",
                        "free parameters",
                        ("rms deviation", "decades"),
                        "criterion",
                        "chosen",
                    ],
                    compared,
                )
            ],
        ),
        Section(
            "How the fit was made", [facts([*settings, *sources, ("version", report["version"])])]
        ),
    ]


def render_page(result, size_m=None):
    """Title and sections of a Render."""
    return str(result.header.get("scene", "Image")), image_sections(
        result.channels, result.header, size_m
    )


def camera_page(result):
    """Title and sections of an Image of a camera."""
    return f"{result.scenario.name}, camera", image_sections(result.channels, result.header)


def signature_page(result, scene=None, sensor: int = 0):
    """Title and sections of a Signature."""
    name = f"Signature of {scene.name}" if scene else "Signature"
    return name, signature_sections(result, scene, sensor)


def trend_page(result):
    """Title and sections of a Trend."""
    return "Trend", trend_sections(result.columns, result.band)


def contrast_page(result):
    """Title and sections of a Contrast."""
    return f"Contrast of {result.scenario.name}", contrast_sections(result)


def fit_page(result, measurements=None, directional=None):
    """Title and sections of a Fit; measurements: the data that were fitted."""
    from mi_lcair.fitting.report import as_dict
    from mi_lcair.fitting.scatterometer.measurements import Measurements

    data = measurements or Measurements(np.empty(0), np.empty(0), np.empty(0))
    report = json.loads(
        json.dumps(
            as_dict([(data, result, directional or {})]), default=lambda v: np.asarray(v).tolist()
        )
    )
    return f"Fit of {data.name or result.model}", fit_sections(
        report, result, measurements, directional
    )


RESULTS = {
    "Render": render_page,
    "Image": camera_page,
    "Signature": signature_page,
    "Trend": trend_page,
    "Contrast": contrast_page,
    "Fit": fit_page,
    "Audit": lambda result: (f"Energy audit of {result.scene}", [audit_section(result)]),
    "Plan": lambda result: ("Plan", [plan_section(result)]),
}
