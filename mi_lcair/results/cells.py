"""Cells and headings of tables as text."""

import json
import re

import numpy as np

from mi_lcair.results.units import quantity_of, unit_of
from mi_lcair.table import NUMBER

NO_VALUE = "no value"
# Units as pages write them, by UDUNITS' parts
WRITTEN = {"m2": "m²", "um": "µm", "degree": "°"}
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


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
        return f"{cell_text(number, digits_for(number, error))} +- {cell_text(error, 2)}"
    if value is None or isinstance(value, (float, np.floating)) and not np.isfinite(value):
        return NO_VALUE
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    if isinstance(value, (float, np.floating)):
        return f"{value:.{digits}g}"
    return str(value)


def digits_for(value, error) -> int:
    """Significant digits of a value that end at the second digit of its error, 2 to 9."""
    if not (value and error and np.isfinite(value) and np.isfinite(error)):
        return 6
    orders = np.floor(np.log10(np.abs([value, error])))
    return int(np.clip(orders[0] - orders[1] + 2, 2, 9))


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
