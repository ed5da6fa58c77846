"""Derivatives of one number, an intensity, with respect to parameters of a scene."""

from dataclasses import dataclass

import numpy as np

from mi_lcair.results import Result, entry
from mi_lcair.sensitivity.motions.differences import Difference


@dataclass(frozen=True, repr=False)
class Sensitivities(Result):
    """An intensity and its derivatives.

    Attributes
    ----------
    names : tuple of str
        Names of K parameters, see `mi_lcair.rendering.parameters.values`.
    value : float
        Intensity, W/sr, or the weighted sum over the sources that was asked for.
    derivative : ndarray, shape (K,)
        Its derivative with respect to each parameter, per unit of the parameter.
    deviations : ndarray, shape (1 + K, R)
        Deviations of R independent randomisations from the value (first row) and from the
        derivatives. The sum of the products of two rows is the covariance of the two results.
    unscattered : ndarray, shape (1 + K,)
        Standard errors of the value and of the derivatives that the deviations do not show, as
        from a source that no path has met.
    method : tuple of str
        How each derivative was found: "linear", "score", "control variate", "mirror" (the same with
        the radiance of the mirror direction), "difference" (of renders), or for a motion "attached
        difference" or "difference on the film".
    by_bounce : ndarray, shape (N,)
        Intensity of paths with 0, 1, ... N - 1 reflections, W/sr.
    paths : int
        Number of paths of the value.
    scene_name, band : str
        Names of the scene and of its band.
    units : tuple of str
        Units of the parameters; "1" for a dimensionless one.
    differences : dict of str to Difference
        The differences with respect to motions, with their steps and verdicts.
    """

    names: tuple[str, ...] = entry()
    value: float = entry("intensity_W_sr")
    derivative: np.ndarray = entry()
    deviations: np.ndarray = entry()
    unscattered: np.ndarray = entry()
    method: tuple[str, ...] = entry()
    by_bounce: np.ndarray = entry("by_bounce_W_sr")
    paths: int
    scene_name: str
    band: str
    units: tuple[str, ...] = entry()
    differences: dict[str, Difference] = entry(default_factory=dict)

    kind = "sensitivities"
    computed = {
        "standard_error_W_sr": "standard_error",
        "derivatives": "as_rows",
        "covariance": "covariance",
    }

    @property
    def error(self) -> np.ndarray:
        """Standard errors of the value and of the derivatives, (1 + K,)."""
        return np.hypot(np.sqrt(np.sum(self.deviations**2, axis=1)), self.unscattered)

    @property
    def standard_error(self) -> float:
        """Standard error of the value, W/sr."""
        return float(self.error[0])

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the value and the derivatives by the deviations, (1 + K, 1 + K)."""
        return self.deviations @ self.deviations.T

    def summary(self) -> str:
        """One line with the intensity, its standard error, and the number of derivatives."""
        return (
            f"sensitivities of {self.scene_name}, {self.band}: intensity {self.value:.6g} +- "
            f"{self.error[0]:.2g} W/sr (standard error) and its derivatives with respect to "
            f"{len(self.names)} parameters"
        )

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each parameter; derivative and standard error are in the row's unit.

        With motions, also the steps of differences, the one-sided derivatives, and whether the
        curve is smooth there.
        """
        table = {
            "parameter": np.array(self.names),
            "derivative": np.array(self.derivative),
            "standard_error": self.error[1:],
            "unit": np.array([per_unit("W/sr", unit) for unit in self.units]),
            "method": np.array(self.method),
        }
        if not self.differences:
            return table
        steps = [self.differences.get(name) for name in self.names]
        below, above = np.array([d.one_sided if d else (np.nan, np.nan) for d in steps]).T
        return table | {
            "step": np.array([d.step if d else np.nan for d in steps]),
            "truncation": np.array([d.truncation if d else np.nan for d in steps]),
            "derivative_below": below,
            "derivative_above": above,
            "verdict": np.array([d.verdict if d else "" for d in steps]),
        }


def per_unit(unit: str, of_parameter: str) -> str:
    """Unit of a derivative: "W/sr per K", or "W/sr" for a dimensionless parameter."""
    return unit if of_parameter in ("", "1") else f"{unit} per {of_parameter}"
