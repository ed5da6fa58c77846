"""Measured directional quantities: CSV `theta_deg,emissivity[,emissivity_std]` or
`theta_deg,dhr[,dhr_std]`.
"""

from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError


def read_directional_table(
    path, quantity: str = "emissivity"
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Angles [radians, ascending], values [0..1] and their standard deviations (or None) of a
    measured table.

    quantity: the name of the value's column; its standard deviation is `<quantity>_std`. Lines that
    start with # are comments. InputError for a missing file or column, a cell that is no number, a
    value outside 0..1, a standard deviation that is not positive, an angle outside 0..90, or an
    angle given twice.
    """
    path = Path(path)
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"{path}: cannot be read as a text file ({error.__class__.__name__})"
        ) from None
    rows = [
        (number, line.split(","))
        for number, line in enumerate(lines, 1)
        if line.strip() and not line.startswith("#")
    ]
    columns = [cell.strip() for cell in rows[0][1]] if rows else []
    if "theta_deg" not in columns or quantity not in columns:
        raise InputError(
            f"{path}: the header must name theta_deg and {quantity}; found: {', '.join(columns) or 'nothing'}"
        )
    names = ["theta_deg", quantity] + [name for name in columns if name == f"{quantity}_std"]
    table = {}
    for number, cells in rows[1:]:
        try:
            theta, value, *std = (float(cells[columns.index(name)]) for name in names)
        except (ValueError, IndexError):
            raise InputError(
                f"{path}, line {number}: {' and '.join(names)} must be numbers"
            ) from None
        if not (0 <= theta <= 90 and 0 <= value <= 1):
            raise InputError(
                f"{path}, line {number}: theta_deg must lie in 0..90 and {quantity} in 0..1"
            )
        if std and not 0 < std[0] < np.inf:
            raise InputError(f"{path}, line {number}: {names[2]} must be positive")
        if theta in table:
            raise InputError(f"{path}, line {number}: theta_deg {theta:g} appears twice")
        table[theta] = value, *std
    if not table:
        raise InputError(f"{path}: no rows; expected theta_deg,{quantity}")
    angles = sorted(table)
    value, *std = np.array([table[angle] for angle in angles]).T
    return np.radians(angles), value, std[0] if std else None
