"""Absorbers whose density depends on height: a model of the optical depth of slant paths.

The optical depth at a wavelength is a sum of c (amount)^p over absorbers. The amount is the
integral of a density along the path. A power p below 1 is that of a band of unresolved lines whose
strong lines saturate, as in LOWTRAN. The densities are exponentials of height, an increasing one
for ozone, and Gaussians, which fall faster, as the boundary layer's aerosol and vapour do. They are
enough for `fitted` to describe a table of slant paths within a few per cent of its optical depth.
What remains is interpolated (see `mi_lcair.physics.slant_air`).
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from mi_lcair.physics.line_geometry import height_along

# Scale heights [m] of the densities exp(-(h / scale)^power); a negative scale means growth.
DENSITIES = (
    *((scale, 1) for scale in (1000.0, 2000.0, 4000.0, -10000.0)),
    *((scale, 2) for scale in (1500.0, 2000.0, 2500.0, 3000.0)),
)
POWERS = np.array([0.5, 0.6, 0.7, 0.85, 1.0])  # powers of the amount
NODES, WEIGHTS = np.polynomial.legendre.leggauss(32)
NODES, WEIGHTS = (NODES + 1) / 2, WEIGHTS / 2
LEAST_WEIGHT = 2e-3  # of a table's entry in the fit, where the air is very clear or opaque
MOST_STEPS = 10_000  # of the fit at one wavelength
STEPS = 48  # pieces of a path over which its emission is summed


def terms(lower_m, elevation_deg, start_m, end_m) -> np.ndarray:
    """The absorbers' amounts between two lengths along a line, raised to their powers.

    Parameters
    ----------
    lower_m
        Height of the line's lower end [m].
    elevation_deg
        Elevation of the line at its lower end [degrees].
    start_m, end_m
        Lengths from the lower end [m]; they are broadcast against the elevations.

    Returns
    -------
    numpy.ndarray
        (..., densities * powers), in km^p.
    """
    elevation, start, end = np.broadcast_arrays(elevation_deg, start_m, end_m)
    length = start[..., None] + (end - start)[..., None] * NODES
    height = height_along(lower_m, elevation[..., None], length)
    amounts = [
        (np.exp(-np.sign(scale) * (height / abs(scale)) ** power) * WEIGHTS).sum(axis=-1)
        * (end - start)
        / 1000
        for scale, power in DENSITIES
    ]
    return (np.stack(amounts, axis=-1)[..., None] ** POWERS).reshape(*elevation.shape, -1)


@dataclass(frozen=True, eq=False)
class Absorbers:
    """Absorbers above a height.

    Attributes
    ----------
    lower_m
        Height [m] at which all lines begin.
    coefficients
        Optical depth per term of `terms` and wavelength, (terms, k).
    """

    lower_m: float
    coefficients: np.ndarray

    @staticmethod
    def fitted(lower_m, elevation_deg, lengths_m, depths) -> "Absorbers":
        """The absorbers that describe a table best, with no negative coefficient.

        Parameters
        ----------
        lower_m
            Height of the lower end of all paths [m].
        elevation_deg, lengths_m
            Elevations [degrees] and lengths [m] of the paths, (n,).
        depths
            Optical depths, above 0, (n, k).
        """
        of_paths = terms(lower_m, elevation_deg, np.zeros_like(lengths_m), lengths_m)
        # Relative errors of the optical depth count where they change the transmittance.
        weights = np.maximum(np.exp(-depths / 2) * depths, LEAST_WEIGHT)
        columns = [
            nnls(of_paths * (weight / depth)[:, None], weight, maxiter=MOST_STEPS)[0]
            for depth, weight in zip(depths.T, weights.T)
        ]
        return Absorbers(lower_m, np.array(columns).T)

    def depths(self, elevation_deg, start_m, end_m) -> np.ndarray:
        """Optical depths between two lengths [m] along lines, (..., k)."""
        of_paths = terms(self.lower_m, elevation_deg, start_m, end_m)
        # Threads of a BLAS wait for each other on a busy machine; einsum uses none.
        return np.einsum("...t,tk->...k", of_paths, self.coefficients)

    def source(self, elevation_deg, start_m, end_m, seen_from_below: bool, emitted) -> np.ndarray:
        """Mean of the emission along paths, weighted by what reaches one end of each.

        Parameters
        ----------
        elevation_deg
            Elevations of the lines at their lower end [degrees], (n,) or one number.
        start_m, end_m
            Lengths at which the paths begin and end, from the line's lower end [m], (n,) or one
            number.
        seen_from_below
            Whether the radiance is seen from the paths' lower ends.
        emitted
            Function of heights [m], (n, steps), that gives the emission, (n, steps, k).

        Returns
        -------
        numpy.ndarray
            (n, k), in the unit of `emitted`.
        """
        elevation, start, end = (
            values[:, None]
            for values in np.broadcast_arrays(*np.atleast_1d(elevation_deg, start_m, end_m))
        )
        # The pieces are short at the end from which the path is seen.
        share = np.linspace(0, 1, STEPS + 1) ** 2
        near, far = (start, end) if seen_from_below else (end, start)
        edges = near + (far - near) * share
        depths = self.depths(elevation, np.minimum(near, edges), np.maximum(near, edges))
        arriving = -np.diff(np.exp(-depths), axis=1)
        emission = emitted(
            height_along(self.lower_m, elevation, (edges[:, 1:] + edges[:, :-1]) / 2)
        )
        total = arriving.sum(axis=1)
        mean = (arriving * emission).sum(axis=1) / np.where(total > 0, total, 1)
        return np.where(total > 0, mean, emission[:, 0])
