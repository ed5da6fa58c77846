"""The least squares of `fit` on reference problems of nonlinear regression: NIST StRD.

Certified values are those of NIST's Statistical Reference Datasets (public domain), one problem of
each level: Misra1a (lower), Thurber and MGH09 (higher), from both of NIST's starts. Digits are
-log10 of the largest relative error of a parameter; the certified values have 11.
"""

import numpy as np

from docs.studies.cases.comparison import Comparison, columns
from mi_lcair.fitting.search import levenberg_marquardt

ROOM = 20.0  # half width of the box in which values are sought, in the larger of start and value
STEP = 1e-30  # of complex steps


def misra1a(x, b):
    return b[0] * (1 - np.exp(-b[1] * x))


def thurber(x, b):
    above = b[0] + x * (b[1] + x * (b[2] + x * b[3]))
    return above / (1 + x * (b[4] + x * (b[5] + x * b[6])))


def mgh09(x, b):
    return b[0] * (x**2 + x * b[1]) / (x**2 + x * b[2] + b[3])


PROBLEMS = {  # model, starts, and certified values
    "Misra1a": (misra1a, ((500, 1e-4), (250, 5e-4)), (2.3894212918e02, 5.5015643181e-04)),
    "Thurber": (
        thurber,
        ((1000, 1000, 400, 40, 0.7, 0.3, 0.03), (1300, 1500, 500, 75, 1, 0.4, 0.05)),
        (
            1.2881396800e03, 1.4910792535e03, 5.8323836877e02, 7.5416644291e01, 9.6629502864e-01,
            3.9797285797e-01, 4.9727297349e-02,
        ),
    ),
    "MGH09": (
        mgh09,
        ((25, 39, 41.5, 39), (0.25, 0.39, 0.415, 0.39)),
        (1.9280693458e-01, 1.9128232873e-01, 1.2305650693e-01, 1.3606233068e-01),
    ),
}  # fmt: skip


def solved(model, start, x, y) -> np.ndarray:
    """Values that the house's least squares finds from a start."""
    start = np.array(start, float)
    width = ROOM * abs(start)

    def residuals(u, _):
        b = start + (2 * u[0] - 1) * width
        steps = b[:, None] + 1j * STEP * np.diag(width)
        slopes = [2 * model(x, column).imag / STEP for column in steps.T]
        return (model(x, b) - y)[None], np.array(slopes).T[None]

    residuals.unit = float(np.sqrt(np.mean(y**2)))
    half = np.full((1, len(start)), 0.5)
    u = levenberg_marquardt(residuals, half, iterations=2000, tolerance=1e-14).u[0]
    return start + (2 * u - 1) * width


def compare() -> Comparison:
    """Relative errors of all parameters."""
    data, errors, notes = columns("nist_strd.csv"), [], []
    for name, (model, starts, certified) in PROBLEMS.items():
        mine = data["problem"] == name
        for start in starts:
            found = solved(model, start, data["x"][mine], data["y"][mine])
            errors.append(found / certified - 1)
            notes.append(f"{name} {-np.log10(max(abs(errors[-1]).max(), 1e-11)):.1f}")
    errors = np.concatenate(errors)
    note = f"NIST StRD, digits from the two starts: {', '.join(notes)}."
    return Comparison("NIST StRD, relative", "1", errors, 0 * errors, reach=1e-6, note=note)
