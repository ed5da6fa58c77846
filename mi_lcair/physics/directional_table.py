"""Measured directional quantities: CSV `theta_deg,emissivity[,emissivity_std]` or `theta_deg,dhr[,dhr_std]`."""
from pathlib import Path

import numpy as np

from ..errors import InputError


def read_directional_table(path, quantity: str = "emissivity") -> tuple[np.ndarray, np.ndarray]:
    """Angles [radians, ascending] and values [0..1] of a measured table; lines that start with # are comments.

    quantity: the name of the value's column. InputError for a missing file or column, a cell that is no number, a
    value outside 0..1, an angle outside 0..90, or an angle given twice.
    """
    path = Path(path)
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read as a text file ({error.__class__.__name__})") from None
    rows = [(number, line.split(",")) for number, line in enumerate(lines, 1) if line.strip() and not line.startswith("#")]
    columns = [cell.strip() for cell in rows[0][1]] if rows else []
    if "theta_deg" not in columns or quantity not in columns:
        raise InputError(f"{path}: the header must name theta_deg and {quantity}; found: {', '.join(columns) or 'nothing'}")
    table = {}
    for number, cells in rows[1:]:
        try:
            theta, value = (float(cells[columns.index(name)]) for name in ("theta_deg", quantity))
        except (ValueError, IndexError):
            raise InputError(f"{path}, line {number}: theta_deg and {quantity} must be numbers") from None
        if not (0 <= theta <= 90 and 0 <= value <= 1):
            raise InputError(f"{path}, line {number}: theta_deg must lie in 0..90 and {quantity} in 0..1")
        if theta in table:
            raise InputError(f"{path}, line {number}: theta_deg {theta:g} appears twice")
        table[theta] = value
    if not table:
        raise InputError(f"{path}: no rows; expected theta_deg,{quantity}")
    angles = np.array(sorted(table))
    return np.radians(angles), np.array([table[angle] for angle in angles])
