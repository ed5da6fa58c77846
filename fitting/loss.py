"""Scales on which model and data are compared.

BRDFs of one surface span five decades and their errors are factors, so residuals are differences of
log10 (in decades). The linear and the cube-root scale let the few points of the peak outweigh the
rest; they are here for comparison.
"""

import numpy as np

DARKEST = 1e-30  # [1/sr]; a surface that reflects nothing stays comparable


def log10(f):
    f = np.maximum(f, DARKEST)
    return np.log10(f), 1 / (f * np.log(10))


def cube_root(f):
    root = np.cbrt(np.maximum(f, DARKEST))
    return root, 1 / (3 * root * root)


def linear(f):
    return f, np.ones_like(f)


SCALES = {
    "log": log10,
    "cube_root": cube_root,
    "linear": linear,
}  # each: value, and derivative by the BRDF


class Residuals:
    """Rows in units of their own standard deviations: BRDF points on a scale, then emissivities or
    DHRs.

    instrument: a `Scatterometer`; brdf [1/sr] what it measured; scale: key of SCALES; spread:
    standard deviation of a row on that scale, a number or one per point. directional:
    (`Hemispherical`, value, std) triples. Calling with coordinates u (m, n) gives rows (m, rows)
    and their derivatives (m, rows, n); `lanes` says which of its starts a descent asks for, which
    only matters where starts have residuals of their own. unit: change of a typical row for a
    decade of the BRDF.
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
    """The same rows with outliers pulled in: r becomes c sqrt(log(1 + (r/c)^2)), whose influence
    falls beyond c.

    Half its square is the Cauchy loss, so that everything that minimizes squares minimizes that
    instead.
    """

    def __init__(self, residuals, c: float):
        self.residuals, self.c, self.unit = residuals, c, residuals.unit

    def __call__(self, u, lanes=None):
        rows, slopes = self.residuals(u)
        ratio2 = np.square(rows / self.c)
        size = self.c * np.sqrt(np.log1p(ratio2))
        shrink = np.where(ratio2 > 1e-16, np.abs(rows) / np.maximum(size, 1e-300) / (1 + ratio2), 1)
        return np.copysign(size, rows), slopes * shrink[..., None]
