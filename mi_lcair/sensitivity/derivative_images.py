"""Images of the radiance and of its derivatives with respect to parameters of a scene."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class DerivativeImages:
    """Independent images of the radiance and of its derivatives.

    Attributes
    ----------
    names : tuple of str
        Names of K parameters, see `mi_lcair.sensitivity.parameters`.
    radiance : ndarray, shape (R, height, width), float32
        Radiance, W m^-2 sr^-1, in each of R independent randomisations.
    columns : ndarray, shape (R, K, height, width), float32
        Its derivatives, per unit of the parameter, from the same randomisations.
    method : tuple of str
        How each derivative was found, as for `Sensitivities`.
    """

    names: tuple[str, ...]
    radiance: np.ndarray
    columns: np.ndarray
    method: tuple[str, ...]

    @property
    def mean(self) -> np.ndarray:
        """Radiance, (height, width)."""
        return mean(self.radiance)

    @property
    def derivative(self) -> np.ndarray:
        """Derivatives of the radiance, (K, height, width)."""
        return mean(self.columns)

    @property
    def error(self) -> np.ndarray:
        """Standard error of `mean`, (height, width); infinite for one randomisation."""
        return standard_error(self.radiance)

    @property
    def derivative_error(self) -> np.ndarray:
        """Standard errors of `derivative`, (K, height, width); infinite for one randomisation."""
        return standard_error(self.columns)


def mean(images: np.ndarray) -> np.ndarray:
    return images.mean(axis=0, dtype=float)


def standard_error(images: np.ndarray) -> np.ndarray:
    """Standard error of the mean over the first axis."""
    if len(images) < 2:
        return np.full(images.shape[1:], np.inf)
    return images.std(axis=0, ddof=1, dtype=float) / np.sqrt(len(images))
