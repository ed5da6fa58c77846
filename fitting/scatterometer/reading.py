"""Reader of scatterometer files, which become `Measurements`.

The reader identifies the columns, their units, the sign of theta_r and the quantity (BRDF or BRDF
times cosine), and averages repeated scans. If a file leaves one of these open, the reader raises an
error that asks for it, and does not guess. `Measurements.reading` records how the file was read.
"""

import hashlib
import re
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from mi_lcair.declared import fraction
from mi_lcair.errors import InputError, check_known, errors_of, option, shown, unknown
from mi_lcair.estimate import WIDTH
from mi_lcair.files import read_bytes
from mi_lcair.fitting.scatterometer.layouts import ANGLES, VALUES, meaning, table_of
from mi_lcair.physics.bands import band as band_of
from mi_lcair.physics.spectral_table import read_directional_table
from mi_lcair.table import NUMBER, TextTable

# Measured data: in-plane BRDF points, and directional emissivities or reflectances
# ---------------------------------------------------------------------------------


@dataclass
class Measurements:
    """In-plane BRDF points of one surface in one band.

    Attributes
    ----------
    theta_i, theta_r
        Angles of source and observer to the normal [radians], Float64 (p,), with
        0 <= theta_i < pi/2. theta_r is positive on the specular side, so that the mirror direction
        is theta_r = theta_i.
    brdf
        BRDFs [1/sr], (p,).
    sigma
        Standard deviations of the BRDFs [1/sr], (p,), or None.
    sigma_freedom
        Degrees of freedom of the repeated scans from which sigma was computed; infinite if sigma
        was given.
    band_um
        Limits of the band [um], or None if unknown.
    source_half_angle
        Angular radius of the source as seen from the sample [radians]; 0 for a point source.
    source
        Name and checksum of each file, {"file", "sha256"}.
    dropped
        Number of rows that the reader left out, by reason.
    name
        Name of the sample.
    reading
        How the reader understood the file: columns, signs and quantity.
    calibration
        Standard deviation of a factor that all BRDFs have in common, relative; None if unknown.
    """

    theta_i: np.ndarray
    theta_r: np.ndarray
    brdf: np.ndarray
    sigma: np.ndarray | None = None
    band_um: tuple[float, float] | None = None
    source_half_angle: float = 0.0
    source: list[dict[str, str]] = field(default_factory=list)
    dropped: dict[str, int] = field(default_factory=dict)
    name: str = ""
    reading: dict = field(default_factory=dict)
    sigma_freedom: float = np.inf
    calibration: float | None = None


@dataclass
class DirectionalData:
    """A measured directional emissivity or reflectance.

    Attributes
    ----------
    theta
        Angles to the normal, 0..pi/2 [radians], (a,): of the observer for an emissivity, of the
        source for a DHR.
    value
        Values, 0..1, (a,).
    std
        Standard deviations of the values, (a,), or None.
    quantity
        "emissivity" (1 - HDR) or "dhr".
    source
        Name and checksum of each file, {"file", "sha256"}.
    """

    theta: np.ndarray
    value: np.ndarray
    std: np.ndarray | None = None
    quantity: str = "emissivity"
    source: list[dict[str, str]] = field(default_factory=list)


SPECTRAL = ("wavelength", "lambda", "wavenumber", "wl")  # beginnings of names of spectral columns
QUANTITIES = ("brdf", "brdf_cos", "brf")
SIDES = ("specular", "source")
LINE = 1e-3  # half the width of the band that stands for a laser's line, relative
RADIANS = np.pi / 180 * 1.01  # radians per degree, with a margin for rounding
# The keys of the header that change the numbers.
KEYS = ("band_um", "source_half_angle_deg", "theta_r_positive", "quantity", "calibration")

# Sine of the largest azimuth from the plane of incidence at which a row belongs to the plane.
IN_PLANE = np.sin(np.radians(0.05))
HORIZON = np.pi / 2 - 1e-4  # angle [radians] from which a row counts as being at 90 degrees
# Factor by which one side must be brighter than the other to be recognised as the specular side.
SIDE_RATIO = 2.0
# Weight of the mean variance of all points against a point's own variance [degrees of freedom].
PRIOR_SCANS = 4


def read(
    path, quantity: str | None = None, theta_r_positive: str | None = None, band: str | None = None
) -> Measurements:
    """Read the in-plane measurements in a file, see `mi_lcair.fitting.scatterometer.layouts`.

    Parameters
    ----------
    path
        The file.
    quantity
        Quantity in the value column, "brdf", "brdf_cos" (BRDF times cos theta_r) or "brf" (BRDF
        times pi, the reflectance factor), if the column's name does not say it.
    theta_r_positive
        Side on which theta_r is positive for positive theta_i, "specular" or "source", if the file
        does not say it. This and `quantity` overrule the keys of the same names in the file.
    band
        Band of the measurement, such as "3-5" [um], "MWIR", the wavelength of a laser such as
        "10.6" [um], or the CSV of a response. It overrules
        the key band_um of the file.

    Returns
    -------
    Measurements
        The points in the plane of incidence, repeated ones averaged.

    Raises
    ------
    InputError
        If the file cannot be read or leaves a question open.
    """
    path = Path(path)
    check_known("quantity", QUANTITIES, quantity)
    check_known("theta_r_positive", SIDES, theta_r_positive)
    table, layout = table_of(path)
    for key, (_, line) in table.header.items():
        if key not in KEYS and (near := get_close_matches(key, KEYS, 1, 0.7)):
            raise InputError(f"{path}, line {line}: unknown key {shown(key)}; is {near[0]} meant?")

    columns = _columns(table, quantity or _choice(table, "quantity", QUANTITIES))
    numbers = table.numbers([column for column, _ in columns.values()], may_lack=True)
    is_empty = np.isnan([numbers[columns[role][0]] for role in VALUES if role in columns]).any(0)
    if is_empty.all():
        raise InputError(f"{path}: no row has a BRDF")
    table.rows = [row for row, empty in zip(table.rows, is_empty) if not empty]
    data = {role: numbers[column][~is_empty] for role, (column, _) in columns.items()}
    check_one_band(table)
    angles = [role for role in ANGLES if role in columns]
    # Angles of more than a right angle, or azimuths of more than a turn, are no radians
    are_degrees = any(
        np.nanmax(abs(data[role])) > RADIANS * _limit(role)
        for role in angles
        if not columns[role][1] and not table.is_astm
    )
    for role in angles:
        column, unit = columns[role]
        data[role] = _radians(table, role, column, unit or "deg" * are_degrees, data[role])
    sigma = data.get("sigma")
    if sigma is not None:
        table.check_range("sigma", sigma, WIDTH)

    in_plane, theta_i, theta_r, side = _in_plane(table, columns, data, theta_r_positive)
    upright = np.maximum(theta_i, abs(theta_r)) < HORIZON
    dropped = {
        "without a value": np.count_nonzero(is_empty),
        "off the plane of incidence": np.count_nonzero(~in_plane),
        "at 90 degrees": np.count_nonzero(in_plane & ~upright),
    }
    kept = in_plane & upright
    if not kept.any():
        raise InputError(
            f"{path}: all {len(kept)} rows lie off the plane of incidence or at 90 degrees"
        )
    # BRDF times cosine becomes BRDF, and repeated points become one.
    quantity = next(name for name in QUANTITIES if name in columns)
    per_brdf = {"brdf": 1.0, "brdf_cos": np.cos(theta_r[kept]), "brf": np.pi}[quantity]
    value = data[quantity][kept] / per_brdf
    points = pool(
        theta_i[kept], theta_r[kept], value, None if sigma is None else sigma[kept] / per_brdf
    )
    scans = np.count_nonzero(kept) - len(points[0])
    by_scatter = pool(theta_i[kept], theta_r[kept], value)[3]
    is_tested = sigma is not None and by_scatter is not None
    scatter = float(np.sqrt(np.mean((by_scatter / points[3]) ** 2))) if is_tested else None
    return Measurements(
        *points,
        sigma_freedom=np.inf if sigma is not None or points[3] is None else float(scans),
        band_um=_band(table) if band is None else limits(band),
        source_half_angle=np.radians(_half_angle_deg(table)),
        calibration=_calibration(table),
        source=[identity(path)],
        dropped={why: n for why, n in dropped.items() if n},
        name=table.header.get("sample", table.header.get("sample_name", (path.stem, 0)))[0],
        reading={
            "format": layout,
            "columns": {role: column for role, (column, _) in columns.items()},
            "not_read": [
                name for name in table.columns if name not in numbers and not is_spectral(name)
            ],
            "quantity": quantity,
            "theta_r_positive": side,
            "rows": len(table.rows),
            "points": len(points[0]),
            "repeated": int(scans),
            "scatter_sigmas": scatter,
        },
    )


def is_spectral(column: str) -> bool:
    """Whether a column holds wavelengths or wavenumbers."""
    return column.strip().lower().startswith(SPECTRAL)


def check_one_band(table: TextTable) -> None:
    """Raise InputError if the rows have several wavelengths, which would count as repeats."""
    for place, column in enumerate(table.columns):
        values = sorted({cells[place] for _, cells in table.rows})
        if is_spectral(column) and len(values) > 1:
            raise InputError(
                f"{table.file}: column {shown(column)} has {len(values)} values "
                f"({', '.join(values[:4])}); give each wavelength a file of its own, with its band"
            )


def read_directional(path, quantity: str) -> DirectionalData:
    """Read a measured table of "emissivity" or "dhr" over angle.

    Its format is that of `mi_lcair.physics.spectral_table`.
    """
    path = Path(path)
    table = read_directional_table(path, quantity)
    return DirectionalData(*table, quantity, [identity(path)])


def identity(path: Path) -> dict[str, str]:
    """The name of a file and the SHA-256 of its bytes."""
    return {"file": path.name, "sha256": hashlib.sha256(read_bytes(path)).hexdigest()}


def pool(theta_i, theta_r, brdf, sigma=None):
    """Average repeated points, which have the same two angles to 1e-6 degrees.

    If sigma is given, it is that of the mean: sigma / sqrt(n) for n equal ones. If not, it is
    computed from the scatter of the scans, relative to the mean. Two or three scans give a poor
    variance. Each point's variance is therefore averaged with the mean variance of all points,
    which is used alone for a point that was measured once.

    Parameters
    ----------
    theta_i, theta_r
        Angles of source and observer [radians], (p,).
    brdf
        BRDFs [1/sr], (p,).
    sigma
        Their standard deviations [1/sr], (p,), or None.

    Returns
    -------
    tuple
        theta_i, theta_r, mean BRDF and its standard deviation, (q,) each, in the file's order. The
        last is None if sigma is None and there are no repeats or no scatter.
    """
    angles = np.round(np.degrees(np.stack([theta_i, theta_r], axis=1)), 6)
    _, first, which, count = np.unique(
        angles, axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    which = which.reshape(-1)

    def total(values):
        return np.bincount(which, values, len(first))

    mean = total(brdf) / count
    if sigma is not None:
        sigma = np.sqrt(total(sigma**2)) / count
    elif len(brdf) > len(mean):
        scale = np.where(mean == 0, 1, abs(mean))
        squares, freedom = total(((brdf - mean[which]) / scale[which]) ** 2), count - 1
        common = squares.sum() / freedom.sum()
        if common > 0:
            sigma = scale * np.sqrt(
                (squares + PRIOR_SCANS * common) / (freedom + PRIOR_SCANS) / count
            )
    order = np.argsort(first)  # the order of the file
    return (
        theta_i[first][order],
        theta_r[first][order],
        mean[order],
        None if sigma is None else sigma[order],
    )


def _columns(table: TextTable, quantity: str | None) -> dict[str, tuple[str, str]]:
    """The columns that are understood, as role -> (column's name, unit).

    Exactly one of the roles "brdf" and "brdf_cos" is among them.
    """
    known, others = {}, []
    for column in table.columns:
        role, unit = meaning(column)
        if role is None:
            others.append(column)
        elif role in known:
            raise InputError(
                f"{table.file}: columns {shown(known[role][0])} and {shown(column)} both read as "
                f"{role}; which one is meant?"
            )
        else:
            known[role] = column, unit
    # In an ASTM file the only variable that is no angle is the BRDF, whatever its name.
    if table.is_astm and len(others) == 1 and not known.keys() & set(QUANTITIES):
        known["brdf"] = others[0], ""
    present = [name for name in QUANTITIES if name in known]
    if present == ["brdf"] and quantity:
        known[quantity] = known["brdf"]
    value = quantity or (present + ["brdf"])[0]
    missing = [f"{ANGLES[role][0]}_deg" for role in ("theta_i", "theta_r") if role not in known]
    if missing or value not in known:
        missing += [] if value in known else [f"{value}_per_sr"]
        raise InputError(
            f"{table.file}: no column {' and no '.join(missing)}; found: "
            f"{', '.join(map(shown, table.columns[:12])) or 'nothing'}; rename the column that "
            "has it"
        )
    return {
        role: column for role, column in known.items() if role not in QUANTITIES or role == value
    }


def _radians(table: TextTable, role: str, column: str, unit: str, values: np.ndarray) -> np.ndarray:
    """Angles in radians; elevations within -90..90 degrees, azimuths within -360..360."""
    unit = unit or ("rad" if table.is_astm else "")
    if not unit:
        raise InputError(
            f"{table.file}: is column {shown(column)} in degrees or radians? name it "
            f"{column}_deg or {column}_rad"
        )
    angles = np.radians(values) if unit == "deg" else values
    limit = _limit(role)
    # Angles in radians are often rounded: 1.5708 is meant to be 90 degrees.
    outside = ~(abs(angles) <= np.radians(limit) + (1e-4 if unit == "rad" else 0))
    if outside.any():
        row = np.argmax(outside)
        bounds = (
            f"-{limit}..{limit} degrees"
            if unit == "deg"
            else f"-{np.radians(limit):.4f}..{np.radians(limit):.4f} rad"
        )
        raise InputError(
            f"{table.file}, line {table.rows[row][0]}: {column} = {values[row]:g} lies outside "
            f"{bounds}"
        )
    return angles


def _limit(role: str) -> float:
    """Largest size of an angle [degrees]."""
    return 90 if role.startswith("theta") else 360


def _in_plane(table, columns, data, given):
    """Find the rows in the plane of incidence, and give their angles this project's signs.

    Returns the mask of these rows, theta_i >= 0, theta_r that is positive on the specular side, and
    a remark that says how this side was identified. given: the side that the caller gave, or
    None.
    """
    theta_i, theta_r = data["theta_i"], data["theta_r"]
    rows = np.ones(len(theta_i), dtype=bool)
    # In the plane of incidence, (-theta_i, theta_r) is the mirror image of (theta_i, -theta_r).
    theta_r = np.where(theta_i < 0, -theta_r, theta_r)
    is_named_so = columns["theta_r"][0].lower().startswith("theta_r") and not (theta_i < 0).any()
    theta_i = abs(theta_i)
    azimuths = None  # what they say about the side: "opposite", "alike", or nothing
    if "phi_r" in data:
        between = data["phi_r"] - data.get("phi_i", 0)
        rows = abs(np.sin(between)) <= IN_PLANE
        # The azimuth of the specular half-plane differs by pi from that of the source.
        azimuths = "opposite" if (rows & (np.cos(between) < 0)).any() else "alike"
        theta_r = -theta_r * np.sign(np.cos(between)) if azimuths == "opposite" else theta_r
    elif "phi" in data:
        rows = abs(np.sin(data["phi"])) <= IN_PLANE
        opposite = np.cos(data["phi"]) < 0
        is_named_so = is_named_so and not (rows & opposite).any()
        theta_r = np.where(opposite, -theta_r, theta_r)
    side, how = _side(
        table,
        azimuths,
        given or _choice(table, "theta_r_positive", SIDES),
        columns["theta_r"][0] if is_named_so else None,
        (theta_i[rows], theta_r[rows], next(data[q] for q in QUANTITIES if q in data)[rows]),
    )
    return rows, theta_i, theta_r if side == "specular" else -theta_r, f"{side} ({how})"


def _side(table, azimuths, given, name, points) -> tuple[str, str]:
    """The side on which theta_r is positive, and how it was identified.

    azimuths: as in `_in_plane`. given: the side that was given, or None. name: name of the column
    if it says specular, or None. points: theta_i, theta_r and BRDF in the plane.
    """
    brighter, signed = _brighter_side(*points), (points[1] < 0).any()
    if azimuths == "opposite":
        if "source" not in (given, brighter):
            return "specular", "by azimuth"
        other = "statement" if given else "brighter side"
        reason = f"the azimuths say specular, the {other} says source"
    elif given:
        return given, "stated"
    elif name and azimuths != "alike":
        if brighter != "source":
            return "specular", "by the column's name"
        reason = f"the name {name} says specular, but the peaks lie at -theta_i"
    elif not signed and azimuths != "alike":
        return "specular", "theta_r has no sign"
    elif brighter:
        return brighter, "by the specular peaks"
    elif signed:
        reason = "the data do not show it: neither side holds the specular peaks alone"
    else:
        reason = "all azimuths are alike, which would put every observer on the source's side"
    raise InputError(
        f"{table.file}: on which side is theta_r positive? {reason}; say it in the header, "
        "'# theta_r_positive: specular' (or source; THETA_R_POSITIVE in ASTM files), or with "
        f"{option('theta_r_positive')}"
    )


def _brighter_side(theta_i, theta_r, brdf) -> str | None:
    """The side of positive theta_r: "specular" if it is the brighter one, "source" if it is darker.

    Only angles that both sides cover are compared. None if the data do not decide.
    """
    votes = []
    for incidence in np.unique(theta_i[theta_i >= np.radians(5)]):
        r, f = theta_r[theta_i == incidence], brdf[theta_i == incidence]
        reach = min(r.max(), -r.min()) + 1e-9
        ahead, behind = f[(r > 0) & (r <= reach)], f[(r < 0) & (r >= -reach)]
        if len(ahead) and len(behind):
            votes.append(
                int(ahead.max() > SIDE_RATIO * behind.max())
                - int(behind.max() > SIDE_RATIO * ahead.max())
            )
    verdict = np.mean(votes) if votes else 0
    return "specular" if verdict > 0.5 else "source" if verdict < -0.5 else None


def _choice(table: TextTable, key: str, known: tuple[str, ...]) -> str | None:
    """The value of a header's key that must be one of the words `known`; None without the key."""
    value, line = table.header.get(key, (None, 0))
    if value is not None and value not in known:
        raise InputError(f"{table.file}, line {line}: {unknown(key, value[:30], known)}")
    return value


def _band(table: TextTable) -> tuple[float, float] | None:
    """The band's limits [um] from the header's key band_um, as in `# band_um: 3 5`, or None."""
    value, line = table.header.get("band_um", ("", 0))
    if not value:
        return None
    cells = re.split(r"[\s,;-]+", value)
    try:
        lower, upper = line_limits(cells[0]) if len(cells) == 1 else map(float, cells)
    except ValueError:
        lower = upper = np.nan
    if not 0.1 <= lower < upper <= 1000:
        raise InputError(
            f"{table.file}, line {line}: band_um is {shown(value)}; expected two wavelengths such "
            "as 3 5, or that of a laser"
        )
    return lower, upper


def _calibration(table: TextTable) -> float | None:
    """The fraction in the header's key calibration, as in `# calibration: 5 %`, or None."""
    value, line = table.header.get("calibration", (None, 0))
    with errors_of(f"{table.file}, line {line}: calibration"):
        return fraction(value)


def limits(band: str) -> tuple[float, float]:
    """Lower and upper limit [um] of a band by its name or of the wavelength of a laser.

    Raises InputError for a band without limits.
    """
    if NUMBER.fullmatch(band):
        band = "{:.9g}-{:.9g}".format(*line_limits(band))
    limited = band_of(band)
    limited.check_limits("measured BSDF")
    return limited.lower_um, limited.upper_um


def line_limits(wavelength: str) -> tuple[float, float]:
    """Limits [um] of the narrow band around the wavelength of a laser."""
    centre = float(wavelength.replace(",", "."))
    return centre * (1 - LINE), centre * (1 + LINE)


def _half_angle_deg(table: TextTable) -> float:
    """The value of the header's key source_half_angle_deg [degrees]; 0 without the key."""
    value, line = table.header.get("source_half_angle_deg", ("0", 0))
    try:
        half_angle = float(value)
    except ValueError:
        half_angle = np.nan
    if not 0 <= half_angle < 90:
        raise InputError(
            f"{table.file}, line {line}: source_half_angle_deg is {shown(value)}; expected a "
            f"number from 0, below 90"
        )
    return half_angle
