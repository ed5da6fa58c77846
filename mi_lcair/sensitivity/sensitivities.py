"""Derivatives of one number, an intensity, with respect to parameters of a scene."""

from dataclasses import dataclass, field

import numpy as np

from mi_lcair.results import Result
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

    names: tuple[str, ...]
    value: float
    derivative: np.ndarray
    deviations: np.ndarray
    unscattered: np.ndarray
    method: tuple[str, ...]
    by_bounce: np.ndarray
    paths: int
    scene_name: str
    band: str
    units: tuple[str, ...]
    differences: dict[str, Difference] = field(default_factory=dict)

    kind = "sensitivities"

    @property
    def error(self) -> np.ndarray:
        """Standard errors of the value and of the derivatives, (1 + K,)."""
        return np.hypot(np.sqrt(np.sum(self.deviations**2, axis=1)), self.unscattered)

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

    def entries(self) -> dict:
        """Entries for JSON."""
        return {
            "scene_name": self.scene_name,
            "band": self.band,
            "intensity_W_sr": self.value,
            "standard_error_W_sr": self.error[0],
            "by_bounce_W_sr": self.by_bounce,
            "paths": self.paths,
            "derivatives": [
                dict(zip(self.columns(), row)) for row in zip(*self.columns().values())
            ],
            "covariance": self.covariance,
        }

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
