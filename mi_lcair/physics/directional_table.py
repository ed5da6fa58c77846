"""Tables of measured directional quantities.

They are CSV files `theta_deg,emissivity[,emissivity_std]` or `theta_deg,dhr[,dhr_std]`.
"""

import warnings

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.table import read_table

# Smallest accepted standard deviation. No instrument is better, and 1 / std^2 stays finite.
SMALLEST_STD = 1e-6
# Largest distance from the table's first angle to 0 degrees, and from its last angle to 90 degrees,
# that causes no warning.
FARTHEST_DEG = 15.0


def read_directional_table(
    path, quantity: str = "emissivity"
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Read angles, values and standard deviations of a measured table.

    Parameters
    ----------
    path
        CSV file. Lines that start with # are comments.
    quantity
        Name of the column of values. Their standard deviations are in `<quantity>_std`.

    Returns
    -------
    tuple
        Ascending angles [radians], values (0..1) and standard deviations, (n,) each. The last is
        None if the file has no such column.

    Raises
    ------
    InputError
        If the file or a column is missing, a row has more or fewer cells than the header, a cell is
        no number, a value lies outside 0..1, a standard deviation is not positive, or an angle lies
        outside 0..90 degrees or appears twice.
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
    """Values of a measured table at other angles over the hemisphere.

    They are interpolated linearly between the measured angles. Outside them the nearest value is
    used. A Python warning says so if the table ends more than FARTHEST_DEG from 0 or 90 degrees.

    Parameters
    ----------
    path
        Name of the table, for the warning.
    theta
        Ascending measured angles [radians], (n,).
    values
        Measured values, (n,).
    nodes
        Angles from 0 to pi/2 at which values are returned [radians], (m,).

    Returns
    -------
    numpy.ndarray
        Values at `nodes`, (m,).
    """
    first, last = np.degrees(theta[[0, -1]])
    if first > FARTHEST_DEG or 90 - last > FARTHEST_DEG:
        measured = f"{first:g}..{last:g} degrees" if last > first else f"{first:g} degrees alone"
        warnings.warn(
            f"{path}: measured at {measured}; its nearest value is taken at the other angles of "
            "0..90",
            stacklevel=2,
        )
    return np.interp(nodes, theta, values)
