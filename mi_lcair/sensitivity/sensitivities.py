"""Derivatives of one number, an intensity, with respect to parameters of a scene."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Sensitivities:
    """An intensity and its derivatives.

    Attributes
    ----------
    names : tuple of str
        Names of K parameters, see `mi_lcair.sensitivity.parameters`.
    value : float
        Intensity, W/sr, or the weighted sum over the sources that was asked for.
    derivative : ndarray, shape (K,)
        Its derivative with respect to each parameter, per unit of the parameter.
    deviations : ndarray, shape (1 + K, R)
        Deviations of R independent randomisations from the value (first row) and from the
        derivatives. The sum of the products of two rows is the covariance of the two results.
    method : tuple of str
        How each derivative was found: "linear", "score", "control variate" or "difference".
    bounces : ndarray, shape (N,)
        Intensity of paths with 0, 1, ... N - 1 reflections, W/sr.
    paths : int
        Number of paths of the value.
    """

    names: tuple[str, ...]
    value: float
    derivative: np.ndarray
    deviations: np.ndarray
    method: tuple[str, ...]
    bounces: np.ndarray
    paths: int

    @property
    def error(self) -> np.ndarray:
        """Standard errors of the value and of the derivatives, (1 + K,)."""
        return np.sqrt(np.sum(self.deviations**2, axis=1))

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the value and the derivatives, (1 + K, 1 + K)."""
        return self.deviations @ self.deviations.T
