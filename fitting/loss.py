"""Residuals between model and data, and the scales on which they are computed.

BRDFs of one surface span five decades, and their errors are proportional to their values. The
residuals are therefore differences of log10 (in decades). On the linear and the cube-root scale the
few points of the peak outweigh all others. These two scales exist for comparison.
"""

import numpy as np

DARKEST = 1e-30  # lower limit of a BRDF [1/sr], so that its logarithm is finite


def log10(f):
    """log10 of BRDFs f [1/sr], and its derivative with respect to f."""
    f = np.maximum(f, DARKEST)
    return np.log10(f), 1 / (f * np.log(10))


def cube_root(f):
    """Cube root of BRDFs f [1/sr], and its derivative with respect to f."""
    root = np.cbrt(np.maximum(f, DARKEST))
    return root, 1 / (3 * root * root)


def linear(f):
    """BRDFs f [1/sr] themselves, and their derivative 1."""
    return f, np.ones_like(f)


# Each scale is a function that returns the scaled BRDF and its derivative with respect to the BRDF.
SCALES = {"log": log10, "cube_root": cube_root, "linear": linear}


class Residuals:
    """Residuals (rows) in units of their standard deviations.

    The rows are the BRDF points on a scale, followed by the entries of the directional tables. A
    call with coordinates u (m, n) returns rows (m, r) and their derivatives (m, r, n). The argument
    `lanes`, the indices of the starts, matters only for residuals that differ between starts. The
    attribute `unit` is the change of a typical row for one decade of the BRDF.

    Parameters
    ----------
    instrument
        A `Scatterometer`, which predicts the BRDFs.
    brdf
        Measured BRDFs [1/sr], (p,).
    scale
        Scale of the comparison, a key of SCALES.
    spread
        Standard deviation of the points on this scale, one number or (p,).
    directional
        Triples (`Hemispherical`, measured values, standard deviations).
    """

    def __init__(self, instrument, brdf, scale: str = "log", spread=1.0, directional=()):
        self.instrument, self.scale, self.directional = instrument, SCALES[scale], list(directional)
        self.measured = self.scale(np.asarray(brdf, dtype=float))[0]
        self.weight = np.broadcast_to(1 / np.asarray(spread, dtype=float), self.measured.shape)
        decade = self.scale(np.asarray(brdf, dtype=float))[1] * brdf * np.log(10) * self.weight
        self.unit = float(np.sqrt(np.mean(np.square(decade))))

    def __call__(self, u: np.ndarray, lanes=None) -> tuple[np.ndarray, np.ndarray]:
        f, df = self.instrument(u)
        value, slope = self.scale(f)
        rows, slopes = (
            [(value - self.measured) * self.weight],
            [df * (slope * self.weight)[..., None]],
        )
        for model, measured, std in self.directional:
            value, slope = model(u)
            rows.append((value - measured) / std)
            slopes.append(slope / std[:, None])
        if len(rows) == 1:
            return rows[0], slopes[0]
        return np.concatenate(rows, axis=1), np.concatenate(slopes, axis=1)


class Cauchy:
    """The same rows, transformed so that outliers have little weight.

    A row r becomes c sqrt(log(1 + (r/c)^2)). Its influence on the fit falls where |r| exceeds c.
    Half its square is the Cauchy loss; a method that minimizes a sum of squares then minimizes this
    loss.
    """

    def __init__(self, residuals, c: float):
        self.residuals, self.c, self.unit = residuals, c, residuals.unit

    def __call__(self, u, lanes=None):
        rows, slopes = self.residuals(u)
        ratio2 = np.square(rows / self.c)
        size = self.c * np.sqrt(np.log1p(ratio2))
        shrink = np.where(ratio2 > 1e-16, np.abs(rows) / np.maximum(size, 1e-300) / (1 + ratio2), 1)
        return np.copysign(size, rows), slopes * shrink[..., None]
