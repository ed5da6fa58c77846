"""Declared numbers: bounds, unit and meaning, with one check and one message; fractions.

Parameters of reflection models, properties of plugins and entries of TOML tables are declared with
`Bounds`.
"""

import math
from dataclasses import dataclass, fields

from mi_lcair.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """Bounds of a number, its unit and its meaning.

    lower, upper: inclusive bounds. is_positive: whether the number must be larger than 0. unit: in
    messages and tables; "1" for a dimensionless number, or if the number's name ends with the unit.
    meaning: description in one line.
    """

    lower: float = -math.inf
    upper: float = math.inf
    is_positive: bool = False
    unit: str = "1"
    meaning: str = ""

    def check(self, value: float, name: str, rounding: float = 0.0) -> None:
        """Raise InputError if a number is not finite or lies outside the bounds.

        name: the number's name in the message. rounding: relative excess that is allowed.
        """
        least = self.lower - rounding * abs(self.lower) if rounding else self.lower
        most = self.upper + rounding * abs(self.upper) if rounding else self.upper
        if not (
            math.isfinite(value) and least <= value <= most and (value > 0 or not self.is_positive)
        ):
            unit = "" if self.unit == "1" else f" {self.unit}"
            raise InputError(f"{name} = {in_words(value)}{unit}; must {self}")

    def __str__(self) -> str:
        """The allowed numbers, to follow "must" in a message."""
        upper = f" and at most {in_words(self.upper)}" if self.upper < math.inf else ""
        if self.is_positive:
            return f"be positive{upper}" if upper else "be positive and finite"
        if self.lower == -math.inf:
            return f"be finite{upper}"
        if upper:
            return f"lie in {in_words(self.lower)}..{in_words(self.upper)}"
        return f"be {in_words(self.lower)} or more, and finite"


def in_words(number: float) -> str:
    """An integer with all its digits, another number with six."""
    return str(number) if isinstance(number, int) else f"{number:g}"


def within(**bounds) -> dict[str, Bounds]:
    """Metadata of a dataclass field whose numbers have these `Bounds`."""
    return {"bounds": Bounds(**bounds)}


def check_fields(table, where: str = "") -> None:
    """Raise InputError if a dataclass has a number outside the bounds of its field.

    Fields that are None or a word are not checked; of a tuple each number is. where: begins the
    message.
    """
    for entry in fields(table):
        value = getattr(table, entry.name)
        if "bounds" in entry.metadata and value is not None and not isinstance(value, str):
            for number in value if isinstance(value, tuple) else (value,):
                entry.metadata["bounds"].check(number, f"{where}{entry.name}")


def fraction(value: float | str | None) -> float | None:
    """A fraction as a number.

    Parameters
    ----------
    value : float, str or None
        A number below 1, which is returned as it is, or a text between 0 and 1 such as "0.01" or
        "1%". None stays None.

    Raises
    ------
    InputError
        If a text is not such a fraction, or if a number is 1 or more, as 5 is where 5 % is meant.
    """
    if not isinstance(value, str):
        if value is not None and value >= 1:
            raise InputError(f"{value} is not a fraction between 0 and 1, such as 0.01 or '1%'")
        return value
    number, percent, rest = value.partition("%")
    try:
        result = float(number) / (100 if percent else 1)
    except ValueError:
        result = 0.0
    if rest.strip() or not 0 < result < 1:
        raise InputError(f"'{value}' is not a fraction between 0 and 1, such as 0.01 or 1%")
    return result


def percent(value: float) -> str:
    """A fraction as text, in percent with two digits."""
    return f"{float(f'{100 * value:.2g}'):g} %"
