"""The temperature of an object, as a result."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from mi_lcair.estimate import Estimate
from mi_lcair.files import replacing
from mi_lcair.formats import tiff
from mi_lcair.physics.bands import Band
from mi_lcair.rendering.images.exr import write_exr as write_channels
from mi_lcair.results import Result, entry
from mi_lcair.results.contributions import contributions
from mi_lcair.results.result import summary_of


@dataclass(frozen=True, repr=False)
class Temperature(Result):
    """The temperature of an object, or of each pixel of an image.

    Attributes
    ----------
    name : str
        Name of the image.
    band : Band
        Band of the camera.
    estimate : Estimate
        Temperatures [K], of the image's shape, with their errors; NaN for nothing. The errors of
        the quantities are independent, and each is the same in all pixels.
    conditions : dict of str to Estimate
        The quantities of the measurement.
    transmittance : float
        Mean transmittance of the air in the band, for the median temperature.
    remarks : tuple of str
    """

    name: str = entry("image")
    band: Band = entry("band", "label")
    estimate: Estimate = entry()
    conditions: dict[str, Estimate]
    transmittance: float
    remarks: tuple[str, ...] = ()

    kind = "temperature"
    drawn_by = "mi_lcair.reports.pictures.temperature:figure"
    computed = {"estimate": "typical", "pixels": "pixels", "range_K": "range_K"}
    saved_by = {
        suffix: f"mi_lcair.thermography.temperature_result:write_{suffix[1:4]}"
        for suffix in (".tif", ".tiff", ".exr", ".csv")
    }

    @property
    def kelvin(self) -> np.ndarray:
        """Temperatures [K], of the image's shape; NaN for nothing."""
        return self.estimate.value

    @property
    def sigma(self) -> np.ndarray:
        """Standard uncertainty of each temperature [K]."""
        return self.estimate.standard_error

    @property
    def typical(self) -> Estimate:
        """Medians over the pixels that have a temperature."""
        known = np.isfinite(self.kelvin)
        return self.estimate.reduced(lambda values: float(np.median(np.asarray(values)[known])))

    @property
    def pixels(self) -> int:
        """Number of pixels that have a temperature."""
        return int(np.isfinite(self.kelvin).sum())

    @property
    def range_K(self) -> tuple[float, float]:
        """Lowest and highest temperature [K]."""
        return float(np.nanmin(self.kelvin)), float(np.nanmax(self.kelvin))

    def summary(self) -> str:
        """One line with the temperature or its range, and its uncertainty."""
        head = f"temperature of {self.name}, {self.band.label}: {self.typical}"
        if self.kelvin.size == 1:
            return head
        low, high = self.range_K
        return f"{head} (median), {low:.5g} to {high:.5g} K"

    def facts(self) -> Iterator[Any]:
        """The temperature, the air, and the budget of the uncertainty."""
        typical = self.typical
        yield summary_of(self)
        if not typical.contributions:
            yield "uncertainty", "none is stated; 0.92+-0.02 states one"
        else:
            yield "expanded", typical.expanded
        yield "transmittance", f"{self.transmittance:.4f}, mean in the band"
        if self.kelvin.size > 1:
            yield "pixels", f"{self.pixels} of {self.kelvin.size} have a temperature"
        if typical.contributions:
            yield contributions(typical)

    def columns(self) -> dict[str, np.ndarray]:
        """The budget: a row for each uncertain quantity, with medians over the pixels."""
        return self.typical.columns()


def write_tif(path, temperature: Temperature) -> None:
    """Write the temperatures [K] as a TIFF of 32-bit floats, NaN for nothing."""
    text = f"object temperature (K) of {temperature.name}"
    tiff.write(path, np.atleast_2d(temperature.kelvin), text)


def write_exr(path, temperature: Temperature) -> None:
    """Write the temperatures and their standard uncertainties [K] as an EXR, 0 for nothing."""
    images = {"temperature.Y": temperature.kelvin, "sigma_K.Y": temperature.sigma}
    channels = {name: np.nan_to_num(np.atleast_2d(values)) for name, values in images.items()}
    write_channels(path, channels, {"band": temperature.band.name, "scene": temperature.name})


def write_csv(path, temperature: Temperature) -> None:
    """Write the temperatures [K] as text, a row of pixels a line, nan for nothing."""
    with replacing(path) as partial, partial.open("w", encoding="utf-8") as file:
        for row in np.atleast_2d(temperature.kelvin):
            file.write(",".join(f"{value:.9g}" for value in row) + "\n")
