"""Numbers with a standard uncertainty, such as 0.92+-0.02."""

from dataclasses import dataclass

from mi_lcair.declared import Bounds
from mi_lcair.errors import InputError, shown


@dataclass(frozen=True)
class Uncertain:
    """A number and its standard uncertainty, 0 if it is known."""

    value: float
    sigma: float = 0.0

    def __str__(self) -> str:
        return f"{self.value:g}" + (f" +- {self.sigma:.3g}" if self.sigma else "")


def uncertain(given: object, name: str, bounds: Bounds = Bounds()) -> Uncertain:
    """A number with its uncertainty.

    Parameters
    ----------
    given : float, pair of float, str or Uncertain
        The number, with its standard uncertainty as a pair (0.92, 0.02) or in a text "0.92+-0.02"
        or "0.92+-2%".
    name : str
        Name of the number in messages.
    bounds : Bounds
        Bounds of the number.

    Raises
    ------
    InputError
        If it is no such number, if it is out of bounds, or if the uncertainty is negative.
    """
    if isinstance(given, Uncertain):
        value, sigma = given.value, given.sigma
    else:
        try:
            value, sigma = parsed(given)
        except (TypeError, ValueError):
            raise InputError(
                f"{name} {shown(str(given))} is no number; give one, such as 0.9 or 0.9+-0.02"
            ) from None
    bounds.check(value, name)
    Bounds(lower=0, unit=bounds.unit).check(sigma, f"standard uncertainty of {name}")
    return Uncertain(value, sigma)


def parsed(given) -> tuple[float, float]:
    """Value and uncertainty; raises TypeError or ValueError."""
    if not isinstance(given, str):
        value, sigma = given if isinstance(given, (tuple, list)) else (given, 0)
        return float(value), float(sigma)
    number, mark, error = given.replace("±", "+-").partition("+-")
    value = float(number)
    if error.strip().endswith("%"):
        return value, abs(value) * float(error.strip().removesuffix("%")) / 100
    return value, float(error) if mark else 0.0
