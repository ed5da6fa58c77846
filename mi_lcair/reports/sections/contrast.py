"""Sections of a contrast."""

from functools import partial

from mi_lcair.errors import option
from mi_lcair.reports.page.line_panel import line_panel
from mi_lcair.reports.pictures.contrast import charts
from mi_lcair.results.cells import error_row, interval
from mi_lcair.results.sections import Drawing, Facts, Remarks, Section, Table

WATTS = "W m-2"


def sections(contrast, ranges: bool = True) -> list[Section]:
    """Irradiances, detection ranges and spectra of a contrast.

    ranges: whether to find the detection ranges; they need a sensor with a nei.
    """
    result = [
        Section(
            "Contrast",
            [
                Facts(setting(contrast)),
                irradiances([row.as_dict() for row in contrast.rows]),
                *groups(contrast.groups()),
                Remarks(contrast.remarks),
            ],
        )
    ]
    if ranges and contrast.detector.nei is not None:
        result.append(Section("Detection range", [detection_ranges(contrast)]))
    return [*result, Section("Spectra", [Drawing(partial(spectra, contrast.as_dict()))])]


def sections_of_entries(entries: dict) -> list[Section]:
    """Irradiances and spectra of a contrast from the entries of its JSON."""
    return [
        Section(
            "Contrast",
            [
                irradiances(entries["rows"]),
                *groups(entries.get("groups", {})),
                Remarks(entries["remarks"]),
            ],
        ),
        Section("Spectra", [Drawing(partial(spectra, entries))]),
    ]


def spectra(entries: dict):
    """The panel of the spectra of a contrast's entries."""
    return line_panel(charts(entries))


def setting(contrast) -> list[tuple[str, str]]:
    """Rows about scenario, sight, air, background, target and error."""
    scenario, detector, row = contrast.scenario, contrast.detector, contrast.rows[-1]
    elevation = contrast.sight_elevation_deg
    heights = ""
    if contrast.observer_height_m is not None:
        heights = (
            f", at a height of {contrast.observer_height_m:.5g} m; target "
            f"{contrast.target_height_m:.5g} m"
        )
    area = row.projected_area
    rows = [
        ("scenario", scenario.heading),
        ("band", f"{detector.band.label}, optics transmit {detector.optics_transmittance:g}"),
        (
            "line of sight",
            f"{contrast.path.range_m:.6g} m, {abs(elevation):.4g} degrees "
            f"{'up' if elevation >= 0 else 'down'}ward, observer at azimuth "
            f"{scenario.observer.azimuth_deg:.6g}{heights}",
        ),
        (
            "atmosphere",
            f"{contrast.air.name}: mean transmittance {contrast.transmittance:.4f}, path "
            f"{contrast.path_radiance:.5g} W m^-2 sr^-1",
        ),
        (
            "background",
            f"{contrast.background_name}: {contrast.background_radiance:.5g} W m^-2 sr^-1",
        ),
        (
            "target",
            f"projected area {area.value:.5g} +- {area.standard_error:.2g} m^2, "
            f"{row.solid_angle:.5g} sr",
        ),
    ]
    if contrast.no_target is not None:
        rows.append(("without target", f"{contrast.no_target:.5g} W/m^2 in the field of view"))
    return [*rows, accuracy(contrast)]


def irradiances(entries: list[dict]) -> Table:
    """A row for each number of reflections, from the entries of a contrast's rows."""
    last = entries[-1]
    columns = [
        "reflections up to", ("intensity", "W sr-1"), ("target", WATTS), ("background", WATTS),
        ("path", WATTS), "total W/m^2 (95 %)", ("nei max", WATTS),
    ]  # fmt: skip
    more = {("observed", WATTS): "observed_W_m2", "detected": "detected"}
    more = {column: name for column, name in more.items() if last[name] is not None}
    estimates = ("intensity_W_sr", "target_W_m2", "background_W_m2", "path_W_m2")
    rows = [
        [
            row["max_bounces"],
            *(tuple(row[name].values()) for name in estimates),
            f"{row['total_W_m2']['value']:.5g} +- {row['half_width_W_m2']:.2g}",
            tuple(row["nei_max_W_m2"].values()),
            *(row[name] for name in more.values()),
        ]
        for row in entries
    ]
    return Table([*columns, *more], rows)


def groups(parts: dict) -> list[Table]:
    """The target of the last row by what emitted it, from a contrast's entry `groups`.

    There is no table for one group.
    """
    whole = sum(part["target_W_m2"]["value"] for part in parts.values()) or 1.0
    rows = [
        [
            group,
            *(tuple(estimate.values()) for estimate in part.values()),
            f"{part['target_W_m2']['value'] / whole:.1%}",
        ]
        for group, part in parts.items()
    ]
    columns = ["emitted by", ("intensity", "W sr-1"), ("target", WATTS), "share"]
    return [Table(columns, rows)] if len(rows) > 1 else []


def detection_ranges(contrast) -> Table:
    """The ranges at which the target is detected, by number of reflections."""
    detector = contrast.detector
    needed = (
        f"detected at, for a nei of {detector.nei:g} W/m^2 and a signal-to-noise ratio of "
        f"{detector.snr:g}"
    )
    words = [
        detection.summary().removeprefix("detected at ").removesuffix(" (standard error)")
        for detection in contrast.detection_ranges()
    ]
    return Table(
        ["reflections up to", needed],
        [[row.max_bounces, text] for row, text in zip(contrast.rows, words)],
    )


def accuracy(contrast) -> tuple[str, str]:
    """Row about the widest 95 % interval of a contrast, and about the tolerances if any."""
    sampling, rows = contrast.scenario.render, contrast.rows
    allowed = [
        *([] if sampling.tolerance is None else [f"{100 * sampling.tolerance:.4g} %"]),
        *([] if sampling.tolerance_W_m2 is None else [f"{sampling.tolerance_W_m2:.4g} W/m^2"]),
    ]
    stated = [row for row in rows if row.reached is False] or rows
    widest = max(stated, key=lambda row: row.half_width)
    several = len(rows) > 1
    of = f"the contrast with {widest.max_bounces} reflections" if several else "the contrast"
    may_be_zero = widest.half_width >= abs(widest.total.value)
    absolute = sampling.tolerance_W_m2 is not None
    return error_row(
        interval(widest.half_width, widest.total.value, "W/m^2", of, absolute),
        " or ".join(allowed) or None,
        contrast.reached,
        where=f"in {len(stated)} of {len(rows)} rows" if several else "",
        remedy=f"give {option('tolerance_W_m2')}, as no fraction of zero can be reached"
        if may_be_zero and not absolute
        else "",
    )
