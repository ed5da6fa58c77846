"""Spots and areas of an image of temperatures, with the errors that their pixels share."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.estimate import Estimate

EXAMPLES = {"spot": "x,y, such as 120,80", "area": "x,y,width,height, such as 100,60,20,10"}


def plane(values: np.ndarray) -> np.ndarray:
    """An array as an image (H, W); a number is one pixel."""
    values = np.asarray(values)
    return values.reshape(-1, *values.shape[-1:] or (1,))


@dataclass(frozen=True)
class Region:
    """A rectangle of pixels. x, y: column and row of its upper left pixel, from 0."""

    name: str
    x: int
    y: int
    width: int = 1
    height: int = 1

    @staticmethod
    def parsed(kind: str, given: str | Sequence[int]) -> "Region":
        """A "spot" of x and y or an "area" of x, y, width and height. Raises InputError."""
        parts = given.split(",") if isinstance(given, str) else given
        try:
            numbers = [int(part) for part in parts]
        except (TypeError, ValueError):
            numbers = []
        is_place = len(numbers) == {"spot": 2, "area": 4}[kind] and min(numbers) >= 0
        if not is_place or 0 in numbers[2:]:
            raise InputError(f"{kind} '{given}': give whole numbers {EXAMPLES[kind]}")
        return Region(f"{kind} {','.join(map(str, numbers))}", *numbers)

    def of(self, values: np.ndarray) -> np.ndarray:
        """Values of an image in its pixels, (height, width)."""
        return plane(values)[self.y : self.y + self.height, self.x : self.x + self.width]

    def mean(self, values: np.ndarray) -> float:
        """Mean over its pixels that have a value."""
        return float(np.nanmean(self.of(values)))

    def check(self, kelvin: np.ndarray) -> None:
        """Raise InputError if the region is not within an image, or has no temperature there."""
        height, width = plane(kelvin).shape
        if self.x + self.width > width or self.y + self.height > height:
            raise InputError(
                f"{self.name} lies outside the image of {width} x {height} pixels, whose last one "
                f"is {width - 1},{height - 1}"
            )
        if not np.isfinite(self.of(kelvin)).any():
            raise InputError(f"{self.name} has no temperature")

    def typical(self, kelvin: np.ndarray) -> int:
        """Place in the flat image of the pixel that is nearest to the mean."""
        off = np.full(plane(kelvin).shape, np.inf)
        self.of(off)[:] = np.nan_to_num(abs(self.of(kelvin) - self.mean(kelvin)), nan=np.inf)
        return int(np.argmin(off))

    def highest(self, kelvin: np.ndarray) -> tuple[int, int]:
        """Column and row of its hottest pixel."""
        values = self.of(kelvin)
        row, column = np.unravel_index(np.nanargmax(values), values.shape)
        return self.x + int(column), self.y + int(row)


def of_image(kelvin: np.ndarray) -> tuple[Region, Region]:
    """The hottest pixel and the whole image."""
    height, width = plane(kelvin).shape
    whole = Region("image", 0, 0, width, height)
    x, y = whole.highest(kelvin)
    return Region(f"hottest pixel {x},{y}", x, y), whole


def combined(estimate: Estimate, weigh: Callable[..., float]) -> Estimate:
    """The estimate of a linear function of the pixels, whose errors they share."""
    rows = [
        replace(row, contribution=weigh(row.contribution), sensitivity=weigh(row.sensitivity))
        for row in estimate.contributions
    ]
    return Estimate.of(weigh(estimate.value), estimate.unit, rows)


def regional(
    estimate: Estimate, places: Sequence[Region], draws: np.ndarray, interval: tuple[float, float]
) -> tuple[dict, dict]:
    """Tables of regions, and of their differences from the first one.

    Parameters
    ----------
    estimate : Estimate
        Temperatures of an image.
    places : sequence of Region
    draws : ndarray, shape (N, regions)
        Random temperatures of the typical pixel of each region.
    interval : tuple of float
        Shares below the ends of an interval.
    """

    def table(what: str, names: list[str], means: list[Estimate], columns: list) -> dict:
        ends = [
            np.nanquantile(values, interval) + mean.value - at
            for (values, at), mean in zip(columns, means)
        ]
        low, high = np.reshape(ends, (-1, 2)).T
        return {
            what: np.array(names),
            "mean_K": np.array([mean.value for mean in means]),
            "mean_error_K": np.array([mean.standard_error for mean in means]),
            "from_K": low,
            "to_K": high,
        }

    kelvin = estimate.value
    flat = [np.ravel(kelvin)[place.typical(kelvin)] for place in places]
    means = [combined(estimate, place.mean) for place in places]
    regions = table("region", [p.name for p in places], means, list(zip(draws.T, flat)))
    regions["lowest_K"] = np.array([np.nanmin(place.of(kelvin)) for place in places])
    regions["highest_K"] = np.array([np.nanmax(place.of(kelvin)) for place in places])
    regions["highest_x"], regions["highest_y"] = np.transpose([p.highest(kelvin) for p in places])
    first, *others = places[:-2] or places[:1]  # without the hottest pixel and the image
    return regions, table(
        "difference",
        [f"{first.name} - {place.name}" for place in others],
        [combined(estimate, lambda a, p=p: first.mean(a) - p.mean(a)) for p in others],
        [(draws[:, 0] - draws[:, k], flat[0] - flat[k]) for k in range(1, 1 + len(others))],
    )
