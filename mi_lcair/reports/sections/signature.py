"""Sections of a signature, in memory or from its JSON."""

import numpy as np

from mi_lcair.rendering.statistics import invalid_remark
from mi_lcair.reports.sections import facets
from mi_lcair.reports.sections.effective_areas import spectrum_section
from mi_lcair.results.cells import error_row, heading, interval
from mi_lcair.results.result import details
from mi_lcair.results.sections import Facts, Remarks, Section, Table

WATTS = "W sr-1"
PARTS = ("target", "scene")


def sections(signature, scene=None, sensor: int = 0) -> list[Section]:
    """All that a signature holds.

    scene: the scene it was made from, from whose sensor the model is seen at first.
    """
    others = []
    if signature.facets is not None:
        others += facets.sections(signature.facets, scene, sensor)
    return sections_of_entries(signature.as_dict(), others)


def sections_of_entries(entries: dict, others=()) -> list[Section]:
    """The sections of a signature's JSON. `others` are those of its facets."""
    result = [Section("Intensity", list(intensity(entries)))]
    if "spectrum" in entries:
        areas = entries["effective_areas"]
        heads = [heading(name) for name in areas[0]] if areas else []
        result.append(spectrum_section(columns_of(entries["spectrum"])))
        result.append(
            Section("Effective areas", [Table(heads, [list(row.values()) for row in areas])])
        )
    return [*result, *others, details(entries, "How the signature was made")]


def intensity(entries: dict):
    """Yield the parts of the section of intensities, from the dictionary of the JSON."""
    parts = [entries[name] for name in PARTS]
    main = entries[entries["main_part"]]
    yield (
        "The target is what comes from the model's facets, the scene is all that lies in the "
        "sensor's window. Errors in the tables are standard errors."
    )
    error = interval(
        main["half_width_W_sr"],
        main["intensity_W_sr"],
        "W/sr",
        f"the {entries['main_part']}'s intensity",
    )
    yield Facts(
        [
            ("band", entries["band"]),
            *(
                (
                    name,
                    f"{part['intensity_W_sr']:.6g} W/sr +- {part['half_width_W_sr']:.2g} (95 %), "
                    f"standard error {part['standard_error_W_sr']:.2g}",
                )
                for name, part in zip(PARTS, parts)
            ),
            error_row(error, entries["tolerance"], entries["reached"]),
            ("paths", entries["paths"]),
            *([("wavelengths", entries["bins"])] if entries.get("bins") else []),
        ]
    )
    bounces = zip(*(column for part in parts for column in by_bounce(part)))
    both = [("target", WATTS), ("scene", WATTS)]
    yield Table(
        ["reflections", both[0], "up to these", both[1], "up to these"],
        [[str(number), *cells] for number, cells in enumerate(bounces)],
    )
    for key, title in (("by_group", "emitted by"), ("by_seen", "seen first")):
        values = [(part[f"{key}_W_sr"], part[f"{key}_error_W_sr"]) for part in parts]
        labels = entries["scene"][f"{key}_W_sr"]
        rows = (
            [label, *((value[label], error[label]) for value, error in values)] for label in labels
        )
        yield Table([title, *both], list(rows))
    yield Remarks(invalid_remark(entries["invalid"], entries["paths"]))


def by_bounce(part: dict) -> tuple[list, list]:
    """Two columns of a part of the signature: by number of reflections, and their sums."""
    values, errors = part["by_bounce_W_sr"], part["by_bounce_error_W_sr"]
    return list(zip(values, errors)), part["up_to_bounce_W_sr"]


def columns_of(lists: dict) -> dict[str, np.ndarray]:
    """Columns from the lists of JSON; null is NaN in a column of numbers."""
    columns = {}
    for name, values in lists.items():
        is_text = any(isinstance(value, str) for value in values)
        columns[name] = np.array(values, dtype=object if is_text else float)
    return columns
