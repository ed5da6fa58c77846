"""Which panels and tables a result gets."""

import numpy as np

from mi_lcair.errors import InputError, printable
from mi_lcair.fraction import percent
from mi_lcair.rendering.image import window_of
from mi_lcair.reports.page.image_panel import image_panel
from mi_lcair.reports.page.model_panel import model_panel, with_emissivity
from mi_lcair.reports.page.page import Section, paragraph
from mi_lcair.reports.page.spectrum_panel import spectrum_panel
from mi_lcair.reports.page.tables import (
    facts,
    listed,
    long_table,
    number,
    table,
    unpacked,
    with_error,
    words_of,
)
from mi_lcair.reports.page.trend_panel import trend_panel
from mi_lcair.results.result import Result, check_options

IMAGE_FIRST = ("apparent.Y", "Y", "temperature.Y")  # channels that are shown first, at most two
SPECTRAL = "_W_sr_um"  # end of the names of a spectrum's columns
CAMERA_FIRST = ("temperature.Y", "apparent.Y")


def of_result(result, **options) -> tuple[str, list[Section]]:
    """Title and sections of a result in memory.

    options: of a Signature or FacetResults, `scene` and `sensor`, from which the model is seen at
    first. A result without panels of its own gets its table. Raises InputError for what is no
    result.
    """
    kind = type(result).__name__
    if kind in RESULTS or isinstance(result, Result):
        page = RESULTS.get(kind, table_page)
        check_options(f"the page of a result of kind '{result.kind}'", page, options)
        return page(result, **options)
    raise InputError(f"report has no page for {printable(result, 60)}; it takes results, or files")


def image_sections(channels: dict, header: dict) -> list[Section]:
    """The images of an EXR or of a render, and its header as how it was made.

    Axes are in metres if the header states the window of an orthographic sensor.
    """
    first = CAMERA_FIRST if "counts.Y" in channels else IMAGE_FIRST
    shown = [name for name in first if name in channels][:2]
    height, width = next(iter(channels.values())).shape
    words = f"{width} × {height} pixels, {len(channels)} channels. "
    return [
        Section(
            "Image",
            [
                paragraph(words + image_words(channels)),
                image_panel(channels, shown, window_of(header)),
            ],
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


def intensity_section(entries: dict) -> Section:
    """Tables of a signature's intensities, from the dictionary of its JSON."""
    parts = [entries["target"], entries["scene"]]
    columns = [("target", "W sr⁻¹"), ("scene", "W sr⁻¹")]
    pair = lambda name: [part[f"{name}_W_sr"] for part in parts]
    whole = [
        ["intensity ± standard error", *map(with_error, pair("intensity"), pair("standard_error"))],
        ["half of the 95 % interval", *(number(value, 2) for value in pair("half_width"))],
    ]
    bounces = [
        [number, *cells]
        for number, cells in enumerate(
            zip(
                *(
                    map(with_error, *rows)
                    for rows in zip(pair("by_bounce"), pair("by_bounce_error"))
                )
            )
        )
    ]
    pieces = [
        paragraph(
            f"Band {entries['band']}. The target is what comes from the model's facets, the "
            "scene is all that lies in the sensor's window. Errors are standard errors."
        ),
        table(["", *columns], whole),
        table(["number of reflections", *columns], bounces),
    ]
    for key, title in (("by_group", "emitted by"), ("by_seen", "seen first")):
        values, errors = pair(key), pair(f"{key}_error")
        rows = [
            [label, *(with_error(v.get(label), e.get(label)) for v, e in zip(values, errors))]
            for label in values[1]
        ]
        pieces.append(table([title, *columns], rows))
    return Section("Intensity", pieces)


def facets_section(columns: dict[str, np.ndarray], model=None, toward=None, band=None) -> Section:
    """The facets: the model in space, if it is known, and a long table.

    model: triangles and their facets' numbers, as `model_panel` takes them. toward: direction
    toward the sensor. band: Band of the radiances, for the emissivity.
    """
    columns = columns if band is None else with_emissivity(columns, band)
    parts = [] if model is None else [model_panel(*model, columns, toward)]
    sort = "intensity_W_sr" if "intensity_W_sr" in columns else None
    return Section("Facets", [*parts, long_table(columns, sort)])


def spectrum_section(columns: dict[str, np.ndarray]) -> Section:
    """Spectral intensity of target and scene by what emitted it: wavelength_um, NAME_W_sr_um."""
    curves = {
        name.removesuffix(SPECTRAL): np.asarray(values, float)
        for name, values in columns.items()
        if name.endswith(SPECTRAL)
    }
    return Section(
        "Spectral intensity",
        [
            paragraph(
                "Before any atmosphere, by what emitted it. A click on a name hides a curve."
            ),
            spectrum_panel(np.asarray(columns["wavelength_um"], float), curves),
        ],
    )


def signature_sections(signature, scene=None, sensor: int = 0) -> list[Section]:
    """All that a Signature in memory holds.

    scene: the scene it was made from, from whose sensor the model is seen at first.
    """
    sections = [intensity_section(signature.as_dict())]
    if signature.effective_areas is not None:
        sections.append(spectrum_section(signature.effective_areas.columns()))
    if signature.facets is not None:
        toward = None if scene is None else toward_sensor(scene, sensor)
        sections.append(facets_of(signature.facets, toward))
    return sections


def facets_of(facets, toward=None) -> Section:
    """The section of FacetResults."""
    model = facets.triangles, facets.triangle_facet
    return facets_section(facets.columns(), model, toward, known_band(facets.band))


def known_band(name: str):
    """The Band of a name; None for one that was read from a file."""
    from mi_lcair.physics.bands import band

    try:
        return band(name)
    except InputError:
        return None


def toward_sensor(scene, sensor: int = 0):
    """Direction from a scene, in any form that `load` takes, toward its sensor, (3,)."""
    from mi_lcair.rendering.scene import scene_of
    from mi_lcair.rendering.window import window

    return -window(scene_of(scene).sensor(sensor))[3]


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


def audit_section(audit) -> Section:
    """Energy of a scene: what is emitted, absorbed and escapes, by material."""
    share = lambda name, key: "{:.3f} ± {:.1g}".format(*(100 * v for v in audit.shares[name][key]))
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
                [[with_error(*audit.total["emitted"]), *(share("scene", key) for key in keys)]],
            ),
            table(
                ["material", ("emitted", "W"), ("incident", "W")]
                + [(f"{key}, of incident", "%") for key in shares],
                [
                    [name, flux["emitted"][0], flux["incident"][0]]
                    + [share(name, key) for key in shares]
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
                    ("tolerance", f"{100 * plan.tolerance:.4g} %"),
                    ("lobes", lobes or "no material with a fidelity ladder"),
                    ("reflections", f"{plan.max_bounces}, closure {closure}"),
                    ("emitter sampling", "on" if plan.emitter_sampling else "off"),
                    ("error", f"at most {percent(plan.bias)} of the mean (95 %), {of}"),
                    ("left for noise", percent(plan.noise_tolerance)),
                    *(("left out", line) for line in plan.left_out or ["nothing"]),
                    *(("not tried", line) for line in plan.untried),
                ]
            )
        ],
    )


def render_page(result):
    """Title and sections of a Render."""
    return result.scene_name, image_sections(result.channels, result.header)


def camera_page(result):
    """Title and sections of an Image of a camera."""
    return f"{result.scenario.name}, camera", camera_sections(result)


def camera_sections(result) -> list[Section]:
    """The frame of a camera, its measures, and the target over range."""
    *images, made = image_sections(result.channels, result.header)
    measures = result.as_dict()["measures"]
    rows = [(words_of(name), value) for name, value in measures.items() if is_plain(value)]
    detected = result.detected_to_m
    words = "The target is detected at no range." if detected is None else (
        f"The target is detected up to {detected:.5g} m."
    )  # fmt: skip
    return [
        *images,
        Section("Camera", [facts(rows), listed(result.remarks)]),
        Section("Target over range", [paragraph(words), long_table(result.columns())]),
        made,
    ]


def is_plain(value) -> bool:
    """Whether an entry is a number, a text, or nothing, and no list or table."""
    return not isinstance(value, (dict, list))


def table_page(result):
    """Title and sections of a result that has no panels of its own: its table."""
    rows = [
        (words_of(name), value)
        for name, value in result.as_dict().items()
        if is_plain(value) and not name.endswith("time_s")  # a page tells no durations
    ]
    title = result.kind.replace("_", " ").capitalize()
    pieces = [paragraph(result.summary()), long_table(result.columns())]
    return title, [Section(title, pieces), Section("How it was made", [facts(rows)])]


def signature_page(result, scene=None, sensor: int = 0):
    """Title and sections of a Signature."""
    return f"Signature of {result.scene_name}", signature_sections(result, scene, sensor)


def facets_page(result, scene=None, sensor: int = 0):
    """Title and sections of FacetResults."""
    toward = None if scene is None else toward_sensor(scene, sensor)
    return f"Facets of {result.scene_name}", [facets_of(result, toward)]


def spectrum_page(result):
    """Title and sections of EffectiveAreas."""
    return f"Spectrum of {result.scene_name}", [spectrum_section(result.columns())]


def trend_page(result):
    """Title and sections of a Trend."""
    return f"Trend of {result.scene_name}", trend_sections(result.columns(), result.band)


def contrast_page(result):
    """Title and sections of a Contrast."""
    from mi_lcair.reports.page.contrast_panel import contrast_sections

    return f"Contrast of {result.scenario.name}", contrast_sections(result)


def fit_page(result):
    """Title and sections of a Fit."""
    from mi_lcair.reports.page.fit_panel import fit_sections

    title = f"Fit of {result.measurements.name or result.model}"
    return title, fit_sections(result.as_dict(), result, result.measurements, result.directional)


RESULTS = {
    "Render": render_page,
    "Image": camera_page,
    "Signature": signature_page,
    "FacetResults": facets_page,
    "EffectiveAreas": spectrum_page,
    "Trend": trend_page,
    "Contrast": contrast_page,
    "Fit": fit_page,
    "Audit": lambda result: (f"Energy audit of {result.scene_name}", [audit_section(result)]),
    "Plan": lambda result: (f"Plan for {result.scene_name}", [plan_section(result)]),
}
