"""Measured directional quantities: CSV `theta_deg,emissivity[,emissivity_std]` or
`theta_deg,dhr[,dhr_std]`.
"""

import warnings

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.table import read_table

SMALLEST_STD = 1e-6  # no instrument is better; the square of its inverse stays finite
FARTHEST_DEG = 15.0  # from a measured angle to any other one, without a remark


def read_directional_table(
    path, quantity: str = "emissivity"
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Angles [radians, ascending], values [0..1] and their standard deviations (or None) of a
    measured table.

    quantity: the name of the value's column; its standard deviation is `<quantity>_std`. Lines that
    start with # are comments. InputError for a missing file or column, a row with more or fewer
    cells than the header, a cell that is no number, a value outside 0..1, a standard deviation that
    is not positive, an angle outside 0..90, or an angle given twice.
    """
    table = read_table(path, ("theta_deg", quantity))
    std = f"{quantity}_std"
    columns = table.numbers(
        [name for name in ("theta_deg", quantity, std) if name in table.columns]
    )
    theta, value = columns["theta_deg"], columns[quantity]
    table.check_range("theta_deg", theta, 0, 90)
    table.check_range(quantity, value, 0, 1)
    if std in columns:
        table.check_range(std, columns[std], SMALLEST_STD, 1)
    order = np.argsort(theta, kind="stable")
    repeated = order[1:][np.diff(theta[order]) == 0]
    if repeated.size:
        row = repeated.min()
        raise InputError(
            f"{path}, line {table.rows[row][0]}: theta_deg {theta[row]:g} appears twice"
        )
    return np.radians(theta[order]), value[order], columns[std][order] if std in columns else None


def over_the_hemisphere(path, theta: np.ndarray, values: np.ndarray, nodes: np.ndarray):
    """Values of a measured table at the angles `nodes` [radians] from 0 to pi/2: straight lines
    between its angles, and the nearest value outside them.

    A Python warning says so where the table ends more than FARTHEST_DEG from 0 or 90 degrees.
    """
    first, last = np.degrees(theta[[0, -1]])
    if first > FARTHEST_DEG or 90 - last > FARTHEST_DEG:
        measured = f"{first:g}..{last:g} degrees" if last > first else f"{first:g} degrees alone"
        warnings.warn(
            f"{path}: measured at {measured}; its nearest value is taken at the other angles of 0..90",
            stacklevel=2,
        )
    return np.interp(nodes, theta, values)
