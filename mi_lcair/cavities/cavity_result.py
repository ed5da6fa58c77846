"""The effective emissivity of a cavity, as a result."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from mi_lcair.cavities.description import ViewTable
from mi_lcair.cavities.shape import Shape
from mi_lcair.cavities.walls import OwnMesh
from mi_lcair.estimate import Estimate
from mi_lcair.results import Result, entry
from mi_lcair.results.contributions import contributions
from mi_lcair.results.result import summary_of
from mi_lcair.results.sections import Table

METHODS = {"rings": "radiosity of diffuse rings", "paths": "paths of the renderer"}


@dataclass(frozen=True, repr=False)
class Cavity(Result):
    """Effective emissivity of a cavity by wavelength, with its uncertainty.

    It is the mean radiance of the rays that the view counts, divided by the radiance of a blackbody
    of the reference temperature.

    Attributes
    ----------
    name : str
    shape : Shape or OwnMesh
    wavelengths_um : ndarray, shape (w,)
    wall_emissivity : ndarray, shape (w,)
        Hemispherical emissivity of the wall.
    estimate : Estimate
        Effective emissivity, (w,); with a temperature profile it may exceed 1. The
        contribution "numerical error" is that of the computation. All are independent.
    reference : float
        Temperature of the reference [K].
    method : str
        "rings" or "paths".
    gouffe : ndarray, shape (w,)
        Gouffé's emissivity, which holds for an isothermal diffuse cavity seen from all directions.
    view : ViewTable
    depths, kelvin : ndarray, shape (n,)
        Temperature of the wall by depth [m, K].
    remarks : tuple of str
    """

    name: str
    shape: Shape | OwnMesh = entry("shape", "kind")
    wavelengths_um: np.ndarray
    wall_emissivity: np.ndarray
    estimate: Estimate
    reference: float = entry("reference_K")
    method: str
    gouffe: np.ndarray
    view: ViewTable = entry()
    depths: np.ndarray = entry("depths_m")
    kelvin: np.ndarray = entry("wall_K")
    remarks: tuple[str, ...] = ()

    kind = "cavity"
    drawn_by = "mi_lcair.reports.pictures.cavity:figure"
    computed = {"view": "seen"}

    @property
    def effective(self) -> np.ndarray:
        """Effective emissivity, (w,)."""
        return self.estimate.value

    @property
    def sigma(self) -> np.ndarray:
        """Combined standard uncertainty, with the error of the computation, (w,)."""
        return self.estimate.standard_error

    @property
    def numerical(self) -> np.ndarray:
        """Standard error of the computation, (w,)."""
        return self.estimate["numerical error"].contribution

    @property
    def first(self) -> Estimate:
        """The effective emissivity at the first wavelength."""
        return self.estimate.reduced(lambda values: float(values[0]))

    @property
    def seen(self) -> str:
        """The view in words."""
        view = self.view
        spot = "aperture" if view.spot_m is None else f"spot of {view.spot_m:g} m"
        if view.distance_m is not None:
            return f"{spot} from {view.distance_m:g} m"
        if view.direction == "hemisphere":
            return f"{spot}, all directions"
        return (
            f"{spot}, {f'{view.angle_deg:g} degrees from the axis' if view.angle_deg else 'normal'}"
        )

    def summary(self) -> str:
        """One line with the effective emissivity at the first wavelength."""
        text = f"effective emissivity of {self.name}, {self.seen}: {self.first}"
        if np.ptp(self.effective) == 0:
            return text
        return f"{text} at {self.wavelengths_um[0]:g} um"

    def facts(self) -> Iterator[Any]:
        """The effective emissivity by wavelength, the method, and the budget."""
        coldest, hottest = self.kelvin.min(), self.kelvin.max()
        wall = f"{coldest:g} K" if coldest == hottest else f"{coldest:g} to {hottest:g} K"
        yield summary_of(self)
        yield "shape", f"{self.shape.kind.replace('_', ' with ')}, {self.shape.depth:g} m deep"
        yield "view", self.seen
        yield "wall", f"{wall}, compared with a blackbody of {self.reference:g} K"
        yield "method", METHODS[self.method]
        yield Table.of(
            {
                "wavelength um": (self.wavelengths_um, "g"),
                "wall": (self.wall_emissivity, ".4f"),
                "effective emissivity": (self.effective, ".6f"),
                "sigma": (self.sigma, ".2g"),
                "of which numerical": (self.numerical, ".2g"),
                "Gouffé": (self.gouffe, ".4f"),
            }
        )
        if len(self.estimate.contributions) > 1:
            yield contributions(self.first)

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each wavelength."""
        return {
            "wavelength_um": self.wavelengths_um,
            "wall_emissivity": self.wall_emissivity,
            "effective_emissivity": self.effective,
            "sigma": self.sigma,
            "numerical_error": self.numerical,
            "gouffe": self.gouffe,
        }
