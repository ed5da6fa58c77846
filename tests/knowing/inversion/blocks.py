"""Predictions and unknowns of invented data, for tests without a render."""

from types import SimpleNamespace

import numpy as np

from mi_lcair.knowing.inversion.least_squares.prediction import DatumBlock
from mi_lcair.knowing.inversion.unknowns import Unknown
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance, in_band_slope

LWIR = band("LWIR")
SKY = in_band_radiance(LWIR, 290.0)
VALUES = 16


def block(radiance, columns, measured, sigma=1.0, **changes) -> DatumBlock:
    """A block of values (n,) with radiance (R, n) and columns (R, n, K) at the reference 0."""
    radiance, columns = np.asarray(radiance, float), list(np.asarray(columns, float))
    count = columns[0].shape[1]
    return DatumBlock(
        **{
            "measured": np.asarray(measured, float),
            "noise": lambda predicted: np.full(len(predicted), sigma),
            "radiance": radiance,
            "columns": columns,
            "unknown": np.arange(count),
            "reference": np.zeros(count),
            "band": None,
            "is_temperature": np.zeros(count, dtype=bool),
            "weight": np.full(radiance.shape[1], sigma**-2.0),
        }
        | changes
    )


def unknown(label="paint.reflectance", **changes) -> Unknown:
    """An unknown of kind material without a unit, 0.3 in 0..1."""
    return Unknown(
        **{
            "label": label,
            "name": label.partition(" [")[0],
            "kind": "material",
            "unit": "1",
            "start": 0.3,
            "lower": 0.0,
            "upper": 1.0,
            "prior": None,
            "data": (0,),
        }
        | changes
    )


def kelvin(label="plate.temperature", **changes) -> Unknown:
    """A temperature, 300 K."""
    return unknown(
        label,
        **{"kind": "temperature", "unit": "K", "start": 300.0, "upper": np.inf} | changes,
    )


def estimated(x, covariance, at_bound=0, held=False):
    """What an estimate says about its unknowns, alike at their bounds and hidden."""
    count = len(x)
    return SimpleNamespace(
        x=x,
        covariance=np.asarray(covariance),
        at_bound=[at_bound] * count,
        held=[held] * count,
        intervals=np.full((count, 2), np.nan),
    )


def wall(x, R=2, measured=None, **changes):
    """The radiance (1 - R) B(T) + R B(290 K) of a wall at x = (T, R), alike in all values."""
    T, rho = x
    B = in_band_radiance(LWIR, T)
    radiance = np.full((R, VALUES), (1 - rho) * B + rho * SKY)
    columns = np.tile([(1 - rho) * in_band_slope(LWIR, T), SKY - B], (R, VALUES, 1))
    options = {"reference": np.array(x), "band": LWIR, "is_temperature": np.array([True, False])}
    measured = np.zeros(VALUES) if measured is None else measured
    return block(radiance, columns, measured, **options | changes)
