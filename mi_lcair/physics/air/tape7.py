"""Reader of MODTRAN's output file tape7 in the thermal-radiance and transmittance modes.

The file consists of blocks. A block has the cards of its run (card 1 first, the path in card 3), a
header of column names, rows over rising wavenumber, and -9999. at its end. The columns have fixed
widths: each number ends where its column's name ends. Columns that the mode does not compute are
blank. The reader converts the columns to this project's units.

Files of the transmittance mode (IEMSCT 0) have no radiance. With a temperature of the air, its path
radiance is (1 - transmittance) times the spectral radiance of a blackbody.
"""

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError, shown
from mi_lcair.files import read_text
from mi_lcair.physics.air.levels import length_between
from mi_lcair.physics.blackbody import spectral_radiance

END = "-9999."
FREQUENCY, TRANSMITTANCE = "FREQ", "TOT_TRANS"
THERMAL, SOLAR, TOTAL = "PTH_THRML", "SOL_SCAT", "TOTAL_RAD"
# The column names of MODTRAN 6, and the names in two words of older versions, with the names that
# this module uses.
ALIASES = {
    "THRML_EM": THERMAL,
    "MULT_SCAT": SOLAR,
    **{name.replace("_", " "): name for name in (TRANSMITTANCE, THERMAL, SOLAR, TOTAL)},
    **{name.replace("_", " "): name for name in ("THRML_SCT", "SING_SCAT", "GRND_RFLT")},
    "SURF EMIS": "SURF_EMIS",
    "COMBIN": TRANSMITTANCE,  # of the transmittance mode, with a line of units below
}
UNITS = "CM-1"
PARTS = ("THRML_SCT", "SING_SCAT", "SURF_EMIS", "GRND_RFLT")  # columns that may be absent or blank
LARGEST = 1e12  # largest number that the file may hold
FIRST_WORD = re.compile(rf"^[ \t]*{FREQUENCY}(?=\s|$)", re.MULTILINE)
NEEDED = (FREQUENCY, TRANSMITTANCE, THERMAL, TOTAL)
TO_SPACE, SLANT = 3, 2  # ITYPE of a path to space or to the ground, and of one between two heights
RADIANCE_MODES = (1, 2)  # IEMSCT of thermal radiance without and with scattered sunlight
TRANSMITTANCE_MODE = 0
MODES = {0: "transmittance", 3: "solar irradiance"}  # meaning of the other values of IEMSCT

# Letters, MODEL, ITYPE, IEMSCT.
CARD_1 = re.compile(r"\s*(?:[A-Z]\s*)*-?\d+[A-Z]?\s+(?P<type>\d+)\s+(?P<mode>\d+)\s", re.IGNORECASE)
# H1, H2, ANGLE, RANGE, BETA, RO, LEN.
CARD_3 = re.compile(
    r"(?P<h1>.{10})(?P<h2>.{10})(?P<angle>.{10})(?P<range>.{10})\s*-?\d+\.\d*\s+-?\d+\.\d*\s+\d+(\s+-?\d+\.\d*)*\s*"
)


@dataclass(frozen=True, eq=False)
class Block:
    """The spectra of one line of sight.

    Attributes
    ----------
    line
        Number of the header's line in the file.
    to_space
        Whether the path goes to space or to the ground (ITYPE 3).
    range_m
        Range on card 3 [m]. If it says 0, the range of a slant path (ITYPE 2) follows from H1, H2
        and ANGLE. None if the card is absent or says too little.
    elevation_deg
        Elevation of the line of sight at the sensor (H1), 90 - ANGLE [degrees]; 0 for a horizontal
        path.
    wavelengths_um
        Rising wavelengths [um], (n,).
    transmittance
        Transmittance of the path, 0..1, (n,).
    path_radiance
        Radiance that the path emits and scatters to the sensor [W m^-2 sr^-1 um^-1], (n,).
    total_radiance
        Path radiance plus the radiance of the surface at the end of the path, (n,).
    """

    line: int
    to_space: bool
    range_m: float | None
    elevation_deg: float
    wavelengths_um: np.ndarray
    transmittance: np.ndarray
    path_radiance: np.ndarray
    total_radiance: np.ndarray


def is_tape7(path: Path) -> bool:
    """Whether the file has a line that begins with FREQ, the first column name of a tape7."""
    try:
        text = read_text(path)
    except InputError:
        return False  # the reader that the caller then chooses reports the error
    return FIRST_WORD.search(text) is not None


def blocks(path: Path, air_K: float | None = None) -> list[Block]:
    """All blocks of a file, in its order.

    air_K: temperature of the air [K] for blocks of transmittances. Raises InputError, with the
    line, for a block that holds no radiance or is incomplete.
    """
    lines = read_text(path, f"tape7 {path}").splitlines()
    parsed, start = [], 0
    for n, line in enumerate(lines):
        if line.split() == [END]:
            parsed.append(_block(path, lines, start, n, air_K))
            start = n + 1
    if any(line.strip() for line in lines[start:]):
        raise InputError(
            f"tape7 {path}: the block from line {start + 1} on has no end ({END}); the run was cut "
            "short, run it again"
        )
    return parsed


def joined(path: Path, parts: list[Block]) -> Block:
    """Join blocks of one line of sight with different wavelengths into one block.

    Raises InputError if their wavelengths overlap.
    """
    parts = sorted(parts, key=lambda block: block.wavelengths_um[0])
    for left, right in zip(parts, parts[1:]):
        if right.wavelengths_um[0] < left.wavelengths_um[-1]:
            raise InputError(
                f"tape7 {path}: the blocks with headers in lines {left.line} and {right.line} "
                "cannot be joined: same range, overlapping wavelengths; give each range once, in "
                "one block or in blocks of different bands"
            )
    wavelengths, places = np.unique(
        np.concatenate([block.wavelengths_um for block in parts]), return_index=True
    )
    columns = {
        name: np.concatenate([getattr(block, name) for block in parts])[places]
        for name in ("transmittance", "path_radiance", "total_radiance")
    }
    return replace(parts[0], wavelengths_um=wavelengths, **columns)


def _block(path, lines, start, end, air_K) -> Block:
    """The block in the lines from index `start` to the line before `end`."""
    header = next(
        (n for n in range(start, end) if lines[n].split(maxsplit=1)[:1] == [FREQUENCY]), None
    )
    card_1 = CARD_1.match(lines[start])
    if header is None or card_1 is None:
        raise InputError(
            f"tape7 {path}, line {start + 1}: a block must begin with card 1 (MODEL, ITYPE, "
            f"IEMSCT, ...) and have a line of column names ({FREQUENCY} ...)"
        )
    mode = int(card_1["mode"])
    is_transmittance = mode == TRANSMITTANCE_MODE
    if mode not in RADIANCE_MODES and not (is_transmittance and air_K):
        way = ", or give air_temperature of [atmosphere]" * is_transmittance
        raise InputError(
            f"tape7 {path}, line {start + 1}: IEMSCT = {mode} "
            f"({MODES.get(mode, 'no thermal radiance')}); run MODTRAN with "
            f"IEMSCT = 1 (thermal radiance) or 2 (with scattered sunlight) on card 1{way}"
        )
    if air_K and not is_transmittance:
        raise InputError(
            f"tape7 {path}, line {start + 1}: air_temperature is for transmittances (IEMSCT = 0); "
            "this block has its own path radiance"
        )
    table = _columns(path, lines, header, end, is_transmittance)
    frequency = table[FREQUENCY]
    # From W cm^-2 sr^-1 / cm^-1 to W m^-2 sr^-1 um^-1: 1e4 cm^2 per m^2, times nu^2 / 1e4 cm^-1
    # per um.
    per_um = frequency[::-1] ** 2
    cards_3 = [card for line in lines[start:header] if (card := CARD_3.fullmatch(line))]
    kind = int(card_1["type"])
    length, elevation = _path(cards_3[-1], kind == SLANT) if cards_3 else (0.0, 0.0)
    wavelengths, transmittance = 1e4 / frequency[::-1], table[TRANSMITTANCE][::-1]
    if is_transmittance:
        radiance = (1 - transmittance) * spectral_radiance(wavelengths, air_K)
    else:
        radiance = _path_radiance(table)[::-1] * per_um
    return Block(
        header + 1,
        kind == TO_SPACE,
        length if length > 0 else None,
        elevation,
        wavelengths,
        transmittance,
        radiance,
        radiance if is_transmittance else table[TOTAL][::-1] * per_um,
    )


def _path(card_3, is_slant) -> tuple[float, float]:
    """Range [m], 0 if the card does not state it, and elevation at H1 [degrees] of a path."""
    h1, h2, angle, length = (
        float(card_3[name]) if card_3[name].strip() else 0.0
        for name in ("h1", "h2", "angle", "range")
    )
    if not is_slant:
        return 1000 * length, 0.0
    elevation = 90 - angle
    if length > 0 or h1 == h2:
        return 1000 * length, elevation
    rises = h2 > h1
    if rises != (elevation > 0):
        return 0.0, elevation
    return length_between(1000 * h1, 1000 * h2, elevation), elevation


def _path_radiance(table) -> np.ndarray:
    """Radiance that the path emits and scatters: thermal radiance plus scattered sunlight.

    Early versions of MODTRAN include the scattered parts THRML_SCT and SING_SCAT in PTH_THRML and
    SOL_SCAT. TOTAL_RAD is then the sum of these two and of the surface's radiance. The scattered
    parts are added here only if that brings the sum nearer to TOTAL_RAD.
    """
    # Blanks count as 0.
    column = {name: np.nan_to_num(table.get(name, 0.0)) for name in (SOLAR, *PARTS)}
    path = table[THERMAL] + column[SOLAR]
    scattered = column["THRML_SCT"] + column["SING_SCAT"]
    missing = table[TOTAL] - path - column["SURF_EMIS"] - column["GRND_RFLT"]
    return path + scattered if abs(missing - scattered).sum() < abs(missing).sum() else path


def _columns(path, lines, header, end, is_transmittance) -> dict[str, np.ndarray]:
    """The columns by name, over rising wavenumber, in the file's units; NaN for blanks."""
    words = re.finditer("|".join([*ALIASES, r"\S+"]), lines[header])
    names = [(ALIASES.get(word[0], word[0]), word.end()) for word in words]
    needed = NEEDED[:2] if is_transmittance else NEEDED
    absent = [name for name in needed if name not in dict(names)]
    if absent:
        raise InputError(
            f"tape7 {path}, line {header + 1}: has no column {absent[0]}; MODTRAN's columns in "
            "thermal-radiance mode are needed"
        )
    wanted, start = {}, 0
    for name, stop in names:
        if name in needed or (name in (SOLAR, *PARTS) and not is_transmittance):
            wanted[name] = slice(start, stop)
        start = stop
    first = header + 1 + (lines[header + 1].split()[:1] == [UNITS])
    rows = [(n, line) for n, line in enumerate(lines[first:end], first + 1) if line.strip()]
    table = {
        name: np.array([_number(path, n, name, line[place]) for n, line in rows])
        for name, place in wanted.items()
    }

    frequency = table[FREQUENCY]
    if len(rows) < 2:
        raise InputError(f"tape7 {path}, line {header + 1}: needs two rows or more below it")
    # Each condition is an array over the rows. The first row that fails is reported.
    for allowed, must in (
        (
            np.append(frequency[0] > 0, np.diff(frequency) > 0),
            f"{FREQUENCY} must be positive and rising",
        ),
        (
            (table[TRANSMITTANCE] >= 0) & (table[TRANSMITTANCE] <= 1),
            f"{TRANSMITTANCE} must lie in 0..1",
        ),
        *(
            (table[name] >= 0, f"{THERMAL} and {TOTAL} must be 0 or more")
            for name in (THERMAL, TOTAL)
            if name in table
        ),
        (~(table.get(SOLAR, frequency) < 0), f"{SOLAR} must be 0 or more"),
        *((~(abs(values) > LARGEST), f"{name} must be finite") for name, values in table.items()),
    ):
        if not allowed.all():
            raise InputError(f"tape7 {path}, line {rows[int(np.argmin(allowed))][0]}: {must}")
    return table


def _number(path, line, name, text) -> float:
    """The number in a cell; NaN for a blank cell.

    Fortran omits the E before an exponent of three digits.
    """
    if not text.strip():
        return np.nan
    try:
        # A number that does not end at the column's end belongs in part to a neighbouring column.
        if text[-1] == " ":
            raise ValueError
        return float(re.sub(r"(?<=\d)([+-]\d{3})$", r"E\1", text))
    except ValueError:
        raise InputError(
            f"tape7 {path}, line {line}: {shown(text.strip())} below {name}; each number must end "
            "where its column's name ends"
        ) from None
