"""MODTRAN's output file tape7 in its thermal-radiance modes: blocks of fixed-width columns, turned
into our units.

A block: the cards of its run (card 1 first, the path in card 3), a header of names that end where
their numbers end, rows over rising wavenumber with blanks for what the mode does not compute, and
-9999. at its end.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError, shown
from mi_lcair.files import read_text

END = "-9999."
FREQUENCY, TRANSMITTANCE, THERMAL, SOLAR, TOTAL = (
    "FREQ",
    "TOT_TRANS",
    "PTH_THRML",
    "SOL_SCAT",
    "TOTAL_RAD",
)
# Names of MODTRAN 6, and those of two words that older versions write, each with ours.
ALIASES = {
    "THRML_EM": THERMAL,
    "MULT_SCAT": SOLAR,
    **{name.replace("_", " "): name for name in (TRANSMITTANCE, THERMAL, SOLAR, TOTAL)},
    **{name.replace("_", " "): name for name in ("THRML_SCT", "SING_SCAT", "GRND_RFLT")},
    "SURF EMIS": "SURF_EMIS",
}
PARTS = ("THRML_SCT", "SING_SCAT", "SURF_EMIS", "GRND_RFLT")  # may be absent or blank
LARGEST = 1e12  # of any number in the file
FIRST_WORD = re.compile(rf"^[ \t]*{FREQUENCY}(?=\s|$)", re.MULTILINE)
NEEDED = (FREQUENCY, TRANSMITTANCE, THERMAL, TOTAL)
TO_SPACE = 3  # of ITYPE
RADIANCE_MODES = (1, 2)  # of IEMSCT: thermal radiance, without and with scattered sunlight
MODES = {0: "transmittance", 3: "solar irradiance"}

CARD_1 = re.compile(
    r"\s*(?:[A-Z]\s*)*-?\d+[A-Z]?\s+(?P<type>\d+)\s+(?P<mode>\d+)\s", re.IGNORECASE
)  # letters, MODEL, ITYPE, IEMSCT
CARD_3 = re.compile(
    r".{30}(?P<range>.{10})\s*-?\d+\.\d*\s+-?\d+\.\d*\s+\d+(\s+-?\d+\.\d*)*\s*"
)  # H1 H2 ANGLE RANGE BETA RO LEN


@dataclass(frozen=True, eq=False)
class Block:
    """The spectra of one line of sight, over rising wavelengths [um]; radiances [W m^-2 sr^-1
    um^-1].

    path_radiance: what the path emits and scatters to the sensor; total_radiance: with what the
    surface at its end emits and reflects. range_m: of card 3, None where that says 0 or is absent.
    to_space: ITYPE 3, a path to space or the ground.
    """

    line: int
    to_space: bool
    range_m: float | None
    wavelengths_um: np.ndarray
    transmittance: np.ndarray
    path_radiance: np.ndarray
    total_radiance: np.ndarray


def is_tape7(path: Path) -> bool:
    """Whether the file has a line that begins with the name FREQ, as the header of tape7's columns
    does.
    """
    try:
        text = read_text(path)
    except InputError:
        return False  # whoever reads the file says what is wrong
    return FIRST_WORD.search(text) is not None


def blocks(path: Path) -> list[Block]:
    """All blocks of a file, in its order. Raises InputError, with the line, for what holds no
    radiance or is incomplete.
    """
    lines = read_text(path, f"tape7 {path}").splitlines()
    found, start = [], 0
    for n, line in enumerate(lines):
        if line.split() == [END]:
            found.append(_block(path, lines, start, n))
            start = n + 1
    if any(line.strip() for line in lines[start:]):
        raise InputError(
            f"tape7 {path}: the block from line {start + 1} on has no end ({END}); the run was cut short, run it again"
        )
    return found


def joined(path: Path, parts: list[Block]) -> Block:
    """Blocks of one line of sight and different wavelengths as one. Raises InputError where they
    overlap.
    """
    parts = sorted(parts, key=lambda block: block.wavelengths_um[0])
    for one, other in zip(parts, parts[1:]):
        if other.wavelengths_um[0] < one.wavelengths_um[-1]:
            raise InputError(
                f"tape7 {path}: the blocks with headers in lines {one.line} and {other.line} cannot be joined: "
                "same range, overlapping wavelengths; give each range once, in one block or in blocks of different bands"
            )
    wavelengths, first = np.unique(
        np.concatenate([block.wavelengths_um for block in parts]), return_index=True
    )
    columns = [
        np.concatenate([getattr(block, name) for block in parts])[first]
        for name in ("transmittance", "path_radiance", "total_radiance")
    ]
    return Block(parts[0].line, parts[0].to_space, parts[0].range_m, wavelengths, *columns)


def _block(path, lines, start, end) -> Block:
    header = next(
        (n for n in range(start, end) if lines[n].split(maxsplit=1)[:1] == [FREQUENCY]), None
    )
    card_1 = CARD_1.match(lines[start])
    if header is None or card_1 is None:
        raise InputError(
            f"tape7 {path}, line {start + 1}: a block must begin with card 1 (MODEL, ITYPE, IEMSCT, ...) and "
            f"have a line of column names ({FREQUENCY} ...)"
        )
    mode = int(card_1["mode"])
    if mode not in RADIANCE_MODES:
        raise InputError(
            f"tape7 {path}, line {start + 1}: IEMSCT = {mode} ({MODES.get(mode, 'no thermal radiance')}); run MODTRAN with "
            "IEMSCT = 1 (thermal radiance) or 2 (with scattered sunlight) on card 1"
        )
    table = _columns(path, lines, header, end)
    frequency = table[FREQUENCY]
    per_um = (
        frequency[::-1] ** 2
    )  # W cm^-2 sr^-1/cm^-1 to W m^-2 sr^-1 um^-1: 1e4 cm^2/m^2 times nu^2/1e4 cm^-1/um
    cards_3 = [card for line in lines[start:header] if (card := CARD_3.fullmatch(line))]
    length = float(cards_3[-1]["range"]) if cards_3 else 0.0
    return Block(
        header + 1,
        int(card_1["type"]) == TO_SPACE,
        1000 * length if length > 0 else None,
        1e4 / frequency[::-1],
        table[TRANSMITTANCE][::-1],
        _path_radiance(table)[::-1] * per_um,
        table[TOTAL][::-1] * per_um,
    )


def _path_radiance(table) -> np.ndarray:
    """What the path emits and scatters: thermal radiance and sunlight, each with its scattered part.

    The first versions print the two with these parts included, so that TOTAL_RAD is the sum of the
    two and what the surface sends. Where it is nearer to a sum that adds the parts, they are added.
    """
    column = {name: np.nan_to_num(table.get(name, 0.0)) for name in (SOLAR, *PARTS)}  # 0 for blanks
    path = table[THERMAL] + column[SOLAR]
    scattered = column["THRML_SCT"] + column["SING_SCAT"]
    missing = table[TOTAL] - path - column["SURF_EMIS"] - column["GRND_RFLT"]
    return path + scattered if abs(missing - scattered).sum() < abs(missing).sum() else path


def _columns(path, lines, header, end) -> dict[str, np.ndarray]:
    """The columns by name, over rising wavenumber, in the file's units; NaN for blanks."""
    words = re.finditer("|".join([*ALIASES, r"\S+"]), lines[header])
    names = [(ALIASES.get(word[0], word[0]), word.end()) for word in words]
    absent = [name for name in NEEDED if name not in dict(names)]
    if absent:
        raise InputError(
            f"tape7 {path}, line {header + 1}: has no column {absent[0]}; MODTRAN's columns in thermal-radiance mode are needed"
        )
    wanted, start = {}, 0
    for name, stop in names:
        if name in (*NEEDED, SOLAR, *PARTS):
            wanted[name] = slice(start, stop)
        start = stop
    rows = [(n, line) for n, line in enumerate(lines[header + 1 : end], header + 2) if line.strip()]
    table = {
        name: np.array([_number(path, n, name, line[place]) for n, line in rows])
        for name, place in wanted.items()
    }

    frequency = table[FREQUENCY]
    if len(rows) < 2:
        raise InputError(f"tape7 {path}, line {header + 1}: needs two rows or more below it")
    for allowed, must in (
        (
            np.append(frequency[0] > 0, np.diff(frequency) > 0),
            f"{FREQUENCY} must be positive and rising",
        ),
        (
            (table[TRANSMITTANCE] >= 0) & (table[TRANSMITTANCE] <= 1),
            f"{TRANSMITTANCE} must lie in 0..1",
        ),
        ((table[THERMAL] >= 0) & (table[TOTAL] >= 0), f"{THERMAL} and {TOTAL} must be 0 or more"),
        (~(table.get(SOLAR, frequency) < 0), f"{SOLAR} must be 0 or more"),
        *((~(abs(values) > LARGEST), f"{name} must be finite") for name, values in table.items()),
    ):
        if not allowed.all():
            raise InputError(f"tape7 {path}, line {rows[int(np.argmin(allowed))][0]}: {must}")
    return table


def _number(path, line, name, text) -> float:
    """NaN for a blank. Fortran drops the E of an exponent of three digits."""
    if not text.strip():
        return np.nan
    try:
        if (
            text[-1] == " "
        ):  # then the number goes on in the next column, or this one holds a part of the one before
            raise ValueError
        return float(re.sub(r"(?<=\d)([+-]\d{3})$", r"E\1", text))
    except ValueError:
        raise InputError(
            f"tape7 {path}, line {line}: {shown(text.strip())} below {name}; each number must end where its column's name ends"
        ) from None
