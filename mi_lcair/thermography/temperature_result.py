"""The temperature of an object, as a result."""

from dataclasses import dataclass

import numpy as np

from mi_lcair.physics.bands import Band
from mi_lcair.results import Result
from mi_lcair.thermography.uncertain import Uncertain


@dataclass(frozen=True)
class Contribution:
    """What one quantity contributes to the uncertainty of a temperature.

    quantity, number, unit: its name, its value with the standard uncertainty, and its unit. slope:
    derivative of the temperature with respect to it, of the image's shape [K per unit].
    """

    quantity: str
    number: Uncertain
    unit: str
    slope: np.ndarray

    @property
    def sigma(self) -> np.ndarray:
        """Its part of the standard uncertainty [K], of the image's shape."""
        return abs(self.slope) * self.number.sigma


@dataclass(frozen=True, repr=False)
class Temperature(Result):
    """The temperature of an object, or of each pixel of an image.

    Attributes
    ----------
    name : str
        Name of the image.
    band : Band
        Band of the camera.
    kelvin : ndarray
        Temperatures [K], of the image's shape; NaN for nothing.
    contributions : tuple of Contribution
        What the uncertain quantities contribute. Their errors are independent, and each is the same
        in all pixels.
    conditions : dict of str to Uncertain
        The quantities of the measurement.
    transmittance : float
        Mean transmittance of the air in the band, for the median temperature.
    remarks : tuple of str
    """

    name: str
    band: Band
    kelvin: np.ndarray
    contributions: tuple[Contribution, ...]
    conditions: dict[str, Uncertain]
    transmittance: float
    remarks: tuple[str, ...] = ()

    kind = "temperature"
    saved_by = {
        suffix: f"mi_lcair.thermography.files:write_{suffix[1:4]}"
        for suffix in (".tif", ".tiff", ".exr", ".csv")
    }

    @property
    def sigma(self) -> np.ndarray:
        """Standard uncertainty of each temperature [K]."""
        squares = (row.sigma**2 for row in self.contributions)
        return np.sqrt(sum(squares, start=np.zeros(self.kelvin.shape)))

    def typical(self, values: np.ndarray) -> float:
        """Median over the pixels that have a temperature."""
        return float(np.median(values[np.isfinite(self.kelvin)]))

    def summary(self) -> str:
        """One line with the temperature or its range, and its uncertainty."""
        error = f" +- {self.typical(self.sigma):.3g}" if self.contributions else ""
        text = f"{self.typical(self.kelvin):.6g}{error}"
        head = f"temperature of {self.name}, {self.band.label}: {text} K"
        if self.kelvin.size == 1:
            return head
        low, high = np.nanmin(self.kelvin), np.nanmax(self.kelvin)
        return f"{head} (median), {low:.5g} to {high:.5g} K"

    def entries(self) -> dict:
        """Entries for JSON: medians over the pixels, and the budget."""
        return {
            "image": self.name,
            "band": self.band.label,
            "pixels": int(np.isfinite(self.kelvin).sum()),
            "temperature_K": self.typical(self.kelvin),
            "lowest_K": np.nanmin(self.kelvin),
            "highest_K": np.nanmax(self.kelvin),
            "sigma_K": self.typical(self.sigma),
            "transmittance": self.transmittance,
            "conditions": {
                name: {"value": number.value, "sigma": number.sigma}
                for name, number in self.conditions.items()
            },
            "columns": self.columns(),
            "remarks": self.remarks,
        }

    def columns(self) -> dict[str, np.ndarray]:
        """The budget: a row for each uncertain quantity, with medians over the pixels."""
        rows = self.contributions
        return {
            "quantity": np.array([row.quantity for row in rows], dtype=str),
            "value": np.array([row.number.value for row in rows]),
            "sigma": np.array([row.number.sigma for row in rows]),
            "unit": np.array([row.unit for row in rows], dtype=str),
            "slope_K_per_unit": np.array([self.typical(row.slope) for row in rows]),
            "contribution_K": np.array([self.typical(row.sigma) for row in rows]),
        }
