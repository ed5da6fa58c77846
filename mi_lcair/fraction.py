"""Fractions that are read as a number or in percent, and written in percent."""

from mi_lcair.errors import InputError


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
