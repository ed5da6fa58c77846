"""Sections, cells and headings as text, and the units that the ends of columns' names state."""

import json
import re
from collections.abc import Iterator

import numpy as np

from mi_lcair.declared import percent
from mi_lcair.errors import option
from mi_lcair.estimate import with_error
from mi_lcair.results.sections import Facts, Heading, Lines, Part, Remarks, Section, Table
from mi_lcair.table import NUMBER

NO_VALUE = "no value"
# Units as pages write them, by UDUNITS' parts
WRITTEN = {"m2": "m²", "um": "µm", "degree": "°"}
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
# End of a column's name: its unit as UDUNITS, and so xarray and netCDF, write it.
UNITS = {
    "_W_m2_sr_um": "W m-2 sr-1 um-1",
    "_W_m2_sr": "W m-2 sr-1",
    "_W_sr_um": "W sr-1 um-1",
    "_W_sr": "W sr-1",
    "_W_m2": "W m-2",
    "_W": "W",
    "_mK": "mK",
    "_K": "K",
    "_m2": "m2",
    "_km": "km",
    "_um": "um",
    "_m": "m",
    "_per_sr": "sr-1",
    "_sr": "sr",
    "_deg": "degree",
    "_ms": "ms",
    "_s": "s",
}


def heading(name: str) -> tuple[str, str]:
    """Words and UDUNITS unit of a column from its name, such as ("intensity", "W sr-1")."""
    return quantity_of(name), unit_of(name)


def words_of(name: str) -> str:
    """Words of a column or entry with its unit as pages write it, such as "wavelengths (µm)"."""
    words, unit = heading(name)
    return f"{words} ({typeset_unit(unit)})" if unit else words


def typeset_unit(unit: str) -> str:
    """A unit of UDUNITS as pages write it, such as "W sr⁻¹" for "W sr-1"."""
    parts = (part.partition("-") for part in unit.split())
    return " ".join(
        WRITTEN.get(base, base) + (minus + power).translate(SUPERSCRIPT)
        for base, minus, power in parts
    )


def plain_unit(unit: str) -> str:
    """A unit of UDUNITS in ASCII, such as "W/sr" for "W sr-1", and "W m^-2 sr^-1"."""
    top, _, below = unit.partition(" ")
    if re.fullmatch(r"[a-z]+-\d", below):
        name, power = below.split("-")
        return f"{top}/{name}" + (f"^{power}" if power != "1" else "")
    return re.sub(r"(?<=[a-z])(-?\d)", r"^\1", unit)


def typeset(text: str) -> str:
    """A text in ASCII with the signs of print: ± for +-, and exponents raised."""
    raised = re.sub(r"\^(-?\d)", lambda power: power[1].translate(SUPERSCRIPT), text)
    return raised.replace("+-", "±")


def cell_text(value: object, digits: int = 6) -> str:
    """A cell as text in ASCII: numbers with `digits`, pairs (value, standard error) with +-."""
    if isinstance(value, tuple):
        number, error = value
        is_known = None not in value and np.isfinite(value).all()
        return (
            with_error(number, error)
            if is_known
            else f"{cell_text(number)} +- {cell_text(error, 2)}"
        )
    if value is None or isinstance(value, (float, np.floating)) and not np.isfinite(value):
        return NO_VALUE
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    if isinstance(value, (float, np.floating)):
        return f"{value:.{digits}g}"
    return str(value)


def is_number(text: str) -> bool:
    """Whether a cell's text is a number, also with its error, or says that there is none."""
    return text in (NO_VALUE, "") or NUMBER.fullmatch(text.partition(" +- ")[0]) is not None


def unpacked(value: object) -> object:
    """An entry as a cell: objects, also as JSON, as `key=value` pairs."""
    if isinstance(value, str) and value.startswith("{"):
        try:
            value = json.loads(value)
        except (ValueError, RecursionError):
            return value
    if isinstance(value, dict):
        return ", ".join(f"{key}={item}" for key, item in value.items()) or "none given"
    return value


def unit_of(name: str) -> str:
    """Unit of the column `name`, such as "W sr-1"; "" for a number without one."""
    return next((unit for end, unit in UNITS.items() if name.endswith(end)), "")


def quantity_of(name: str) -> str:
    """What the column `name` holds, in words: the name without its unit."""
    end = next((end for end in UNITS if name.endswith(end)), "")
    return name.removesuffix(end).replace("_", " ")


def interval(half_width: float, value: float, unit: str, of: str, absolute: bool = False) -> str:
    """The 95 % interval of a value in words, as a fraction of the value if it is not zero.

    `half_width` is half of the interval. `of` names the value, such as "the target's intensity".
    `absolute`: state the half width in its unit too.
    """
    width = f"{half_width:.2g} {unit}"
    if half_width >= abs(value):
        return f"the 95 % interval is +- {width}, and {of} may be zero"
    fraction = percent(half_width / abs(value))
    return f"the 95 % interval is +- {f'{width}, ' if absolute else ''}{fraction} of {of}"


def error_row(
    error: str,
    tolerance: float | str | None = None,
    reached: bool | None = None,
    where: str = "",
    remedy: str = "",
) -> tuple[str, str]:
    """Row (label, text) of `Facts`: the error of a result and whether it was allowed.

    Parameters
    ----------
    error : str
        The error in words, see `interval`.
    tolerance : float or str or None
        Allowed error, a fraction or in words. Without one, the row only states the error.
    reached : bool or None
        Whether the tolerance was reached.
    where : str
        Which of several results reached it.
    remedy : str
        What to do if it was not reached; by default to raise max_spp.
    """
    if tolerance is None:
        return "error", error
    allowed = tolerance if isinstance(tolerance, str) else f"{100 * tolerance:.4g} %"
    where = f" {where}" if where else ""
    remedy = remedy or f"raise {option('max_spp')}"
    if reached:
        return "tolerance", f"{allowed} reached{where}: {error}"
    return "tolerance", f"{allowed} NOT reached{where}: {error}; {remedy}"


def blocks(sections: list[Section], rows=()) -> Iterator[list[list[str]]]:
    """Yield the facts, tables and lists of sections as rows of texts, without their details.

    rows: further facts (label, value), which follow the first ones.
    """
    parts = list(parts_of(section for section in sections if not section.is_detail))
    for part in parts:
        match part:
            case Facts():
                yield [[label, cell_text(value)] for label, value in [*part.rows, *rows]]
                rows = ()
            case Table():
                head = [heading_text(column) for column in part.columns]
                yield [head, *([cell_text(cell) for cell in row] for row in part.rows)]
            case Lines(title, lines):
                head = [[f"{title}:"]] if title else []
                yield head + [[f"  {line}" if title else line] for line in lines]


def remarks(sections: list[Section]) -> list[str]:
    """The remarks of all sections."""
    remarks = [part for part in parts_of(sections) if isinstance(part, Remarks)]
    return [line for part in remarks for line in part.lines]


def parts_of(sections) -> Iterator[Part]:
    """Yield the parts of all sections."""
    return (part for section in sections for part in section.parts)


def heading_text(heading: Heading) -> str:
    """A heading of a table with its unit, such as "target W/sr"."""
    if isinstance(heading, str):
        return heading
    words, unit = heading
    return f"{words} {plain_unit(unit)}".rstrip()
