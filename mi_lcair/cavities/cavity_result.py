"""The effective emissivity of a cavity, as a result."""

from dataclasses import dataclass

import numpy as np

from mi_lcair.cavities.description import ViewTable
from mi_lcair.cavities.shape import Shape
from mi_lcair.cavities.walls import OwnMesh
from mi_lcair.estimate import Estimate
from mi_lcair.results import Result


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
    shape: Shape | OwnMesh
    wavelengths_um: np.ndarray
    wall_emissivity: np.ndarray
    estimate: Estimate
    reference: float
    method: str
    gouffe: np.ndarray
    view: ViewTable
    depths: np.ndarray
    kelvin: np.ndarray
    remarks: tuple[str, ...] = ()

    kind = "cavity"

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

    def entries(self) -> dict:
        """Entries for JSON: by wavelength, and the budget."""
        return {
            "name": self.name,
            "shape": self.shape.kind,
            "view": self.seen,
            "method": self.method,
            "reference_K": self.reference,
            "remarks": self.remarks,
            "columns": self.columns(),
            "budget": self.estimate.contributions,
        }

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
