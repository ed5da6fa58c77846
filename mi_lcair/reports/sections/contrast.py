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
    head, *rest = sections_of_entries(contrast.as_dict())
    if ranges and contrast.detector.nei is not None:
        rest.insert(0, Section("Detection range", [detection_ranges(contrast)]))
    return [head, *rest]


def sections_of_entries(entries: dict) -> list[Section]:
    """Irradiances and spectra of a contrast from the entries of its JSON."""
    parts = [
        Facts(setting(entries)),
        irradiances(entries["rows"]),
        *groups(entries.get("groups", {})),
        Remarks(entries["remarks"]),
    ]
    drawing = Drawing(partial(spectra, entries))
    return [Section("Contrast", parts), Section("Spectra", [drawing])]


def spectra(entries: dict):
    """The panel of the spectra of a contrast's entries."""
    return line_panel(charts(entries))


def setting(entries: dict) -> list[tuple[str, str]]:
    """Rows about scenario, sight, air, background, target and error."""
    scenario, elevation, row = (
        entries["scenario"],
        entries["sight_elevation_deg"],
        entries["rows"][-1],
    )
    transmittance = scenario["sensor"]["optics_transmittance"]
    heights = ""
    if entries["observer_height_m"] is not None:
        heights = (
            f", at a height of {entries['observer_height_m']:.5g} m; target "
            f"{entries['target_height_m']:.5g} m"
        )
    area, error = row["projected_area_m2"].values()
    rows = [
        ("scenario", ": ".join(filter(None, (scenario["name"], scenario["title"])))),
        ("band", f"{entries['band']}, optics transmit {transmittance:g}"),
        (
            "line of sight",
            f"{entries['range_m']:.6g} m, {abs(elevation):.4g} degrees "
            f"{'up' if elevation >= 0 else 'down'}ward, observer at azimuth "
            f"{scenario['observer']['azimuth_deg']:.6g}{heights}",
        ),
        (
            "atmosphere",
            f"{entries['atmosphere']}: mean transmittance {entries['transmittance']:.4f}, path "
            f"{entries['path_radiance_W_m2_sr']:.5g} W m^-2 sr^-1",
        ),
        (
            "background",
            f"{entries['background']}: {entries['background_radiance_W_m2_sr']:.5g} W m^-2 sr^-1",
        ),
        ("target", f"projected area {area:.5g} +- {error:.2g} m^2, {row['solid_angle_sr']:.5g} sr"),
    ]
    if entries["no_target_W_m2"] is not None:
        empty = f"{entries['no_target_W_m2']:.5g} W/m^2 in the field of view"
        rows.append(("without target", empty))
    return [*rows, accuracy(entries)]


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


def accuracy(entries: dict) -> tuple[str, str]:
    """Row about the widest 95 % interval of a contrast, and about the tolerances if any."""
    relative, absolute, rows = (entries[k] for k in ("tolerance", "tolerance_W_m2", "rows"))
    allowed = [
        *([] if relative is None else [f"{100 * relative:.4g} %"]),
        *([] if absolute is None else [f"{absolute:.4g} W/m^2"]),
    ]
    stated = [row for row in rows if row["reached"] is False] or rows
    widest = max(stated, key=lambda row: row["half_width_W_m2"])
    half_width, total = widest["half_width_W_m2"], widest["total_W_m2"]["value"]
    several = len(rows) > 1
    of = f"the contrast with {widest['max_bounces']} reflections" if several else "the contrast"
    remedy = f"give {option('tolerance_W_m2')}, as no fraction of zero can be reached"
    return error_row(
        interval(half_width, total, "W/m^2", of, absolute is not None),
        " or ".join(allowed) or None,
        entries["reached"],
        where=f"in {len(stated)} of {len(rows)} rows" if several else "",
        remedy=remedy if half_width >= abs(total) and absolute is None else "",
    )
