"""Layouts of scatterometer files, each of which becomes one table of angles and values.

| layout | known by |
|---|---|
| CSV, a row for each point | its line of names |
| CSV, a column for each incidence | names of columns that are numbers |
| ASTM E1392/E2387 | its line VARS |
| Zemax BSDF | ScatterRadial and AngleOfIncidence |
| LightTools BSDF | ScatterRadial and AOI |
| MERL | its size; points in the plane of incidence, of the green channel |

Sources: ASTM E1392; R. Rykowski, BSDF Data Interchange File Format Specification, Zemax 2008
(angles from the specular direction; azimuth 0 points to the normal); LightTools' BSDF text (angles
from the normal; the source is at azimuth 90); W. Matusik et al., A Data-Driven Reflectance Model,
2003.
"""

import re
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError, shown
from mi_lcair.files import read_bytes, read_text
from mi_lcair.table import NUMBER, SEPARATORS, TextTable, lines_of, parse_csv, set_key, split

VARS = re.compile(r"^VARS\b", re.MULTILINE)
INCIDENT = ("inc", "incidence", "incident", "angle_of_incidence", "theta_source")
SCATTERED = ("scat", "scatter", "scattering", "view", "viewing", "observation", "theta_detector")
# The angles and their names in files, without the unit. The first name is that of this project.
ANGLES = {
    "theta_i": ("theta_i", "theta_in", "theta_inc", "theta_incident", "aoi", *INCIDENT),
    "theta_r": (
        "theta_r",
        "theta_s",
        "theta_o",
        "theta_v",
        "theta_out",
        "theta_scatter",
        *SCATTERED,
    ),
    "phi_i": ("phi_i", "phi_in", "phi_inc", "azimuth_i"),
    "phi_r": ("phi_r", "phi_s", "phi_o", "phi_v", "phi_out", "azimuth_r", "azimuth_s"),
    "phi": ("phi", "azimuth", "relative_azimuth", "rel_azimuth", "raa", "delta_phi", "dphi"),
}
# The values and their names in files, without the unit.
VALUES = {
    "brdf": ("brdf", "bsdf", "f_r"),
    "brdf_cos": ("brdf_cos", "brdf_x_cos", "brdfcos", "ccbrdf", "ccbsdf"),
    "brf": ("brf", "reflectance_factor"),
    "sigma": ("sigma", "brdf_std", "std"),
}
NAMED = 2  # smallest number of known quantities in the line that names the columns


def meaning(column: str) -> tuple[str | None, str]:
    """Role and unit of a column, such as ("theta_i", "deg") for the name "Theta_i (deg)".

    The role of an unknown column is None.
    """
    name = re.sub(r"[^a-z0-9]+", "_", column.lower()).strip("_")
    unit = re.search(r"_(deg|rad)(rees?|ians?)?$", name)
    angle = name[: unit.start()] if unit else name
    value = re.sub(r"_(per_sr|1_sr|sr_1|sr)$", "", name)
    for names, meant in ((ANGLES, angle), (VALUES, value)):
        for role, synonyms in names.items():
            if meant in synonyms:
                return role, unit[1] if unit else ""
    return None, ""


def is_astm(text: str) -> bool:
    """Whether a text is in this format, which is recognised by its line VARS."""
    return VARS.search(text) is not None


def parse_astm(file: str, text: str) -> TextTable:
    """The table in the text of an ASTM file; the header's keys are in lower case.

    Raises InputError if NUM_POINTS is not the number of rows, or a column's name appears twice.
    """
    header, rows, columns = {}, [], None
    for number, line in lines_of(text):
        if line.startswith("#"):
            continue
        if columns is not None:
            rows.append((number, split(file, number, line, ",")))
        elif VARS.match(line):
            columns = split(file, number, line.removeprefix("VARS").strip().strip('"'), ",")
        else:
            key, _, value = line.strip().partition(" ")
            set_key(file, header, key, value.strip().strip('"'), number)
    if twice := {column for column in columns if columns.count(column) > 1}:
        raise InputError(f"{file}: VARS names {shown(min(twice))} twice; which one is meant?")
    points, number = header.get("num_points", (str(len(rows)), 0))
    if points != str(len(rows)):
        raise InputError(
            f"{file}, line {number}: NUM_POINTS is {shown(points)}, but {len(rows)} rows follow "
            "VARS; is the file complete?"
        )
    return TextTable(file, columns, rows, header, is_astm=True)


def check_first_line(file: str, text: str) -> None:
    """Raise InputError if the first line that is no comment does not name the columns.

    Instruments put lines before the table. Without # in front, the first of them would be taken for
    the names of the columns.
    """
    lines = [(number, line) for number, line in lines_of(text) if not line.lstrip().startswith("#")]
    named = [(number, line) for number, line in lines if len(roles(line)) >= NAMED]
    if not lines or lines[0] in named:
        return
    number, line = lines[0]
    if named:
        raise InputError(
            f"{file}, line {number}: {shown(line)} comes before the names of the columns in line "
            f"{named[0][0]}; put # in front of each line before these"
        )


def roles(line: str) -> set[str]:
    """The quantities that the cells of a line name, if it is the line with the columns' names."""
    separator = next((mark for mark in SEPARATORS if mark in line), ",")
    roles = {meaning(cell.strip().strip('"'))[0] for cell in line.split(separator)}
    return roles - {None}


def table_of(path: Path) -> tuple[TextTable, str]:
    """The table of angles and values in a file, and the name of its layout.

    Raises InputError for one that is not read.
    """
    file, content = str(path), read_bytes(path)
    if content.startswith(b"tensor_file"):
        raise InputError(
            f"{file}: an RGL measurement (tensor_file), which is not read; evaluate it in the "
            "plane of incidence with Mitsuba's BSDF `measured`, and give a CSV "
            "theta_i_deg,theta_r_deg,brdf_per_sr"
        )
    if content.startswith(np.array(MERL, "<i4").tobytes()):
        return parse_merl(file, content), "MERL, green, in the plane of incidence"
    text = read_text(path)
    if not text.strip():
        raise InputError(f"{file}: the file is empty")
    if is_astm(text):
        return parse_astm(file, text), "ASTM"
    if OPTICS.search(text):
        return parse_optics(file, text), f"{'Zemax' if ZEMAX.search(text) else 'LightTools'} BSDF"
    if (wide := parse_wide(file, text)) is not None:
        return wide, f"CSV, {SEPARATORS[wide.separator]}, a column for each incidence"
    check_first_line(file, text)
    table = parse_csv(file, text)
    return table, f"CSV, {SEPARATORS[table.separator]}"


# A column for each incidence
# ---------------------------

ONE_NUMBER = re.compile(r"[^-+.\d]*([-+]?\d+(?:\.\d+)?)[^\d]*")  # such as "20", "inc = 20 deg"


def parse_wide(file: str, text: str) -> TextTable | None:
    """The table with a column of observer's angles and one of BRDFs for each incidence; or None."""
    lines = re.split(r"(\r\n|\r|\n)", text)
    place = next((k for k, line in enumerate(lines) if line.strip() and line.lstrip()[0] != "#"), 0)
    separator = next((mark for mark in SEPARATORS if mark in lines[place]), ",")
    first, *others = split(file, place // 2 + 1, lines[place], separator) or [""]
    angles = [ONE_NUMBER.fullmatch(cell) for cell in others]
    if meaning(first)[0] != "theta_r" or not angles or None in angles:
        return None
    unit = meaning(first)[1] or "deg"
    lines[place] = separator.join([first, *(f"value {k}" for k in range(len(others)))])
    table = parse_csv(file, "".join(lines))
    rows = [
        (number, [angle[1], cells[0], cell])
        for number, cells in table.rows
        for angle, cell in zip(angles, cells[1:])
    ]
    names = [f"theta_i_{unit}", first, "brdf_per_sr"]
    return TextTable(file, names, rows, table.header, table.separator)


# Zemax and LightTools
# --------------------

OPTICS = re.compile(r"^\s*ScatterRadial\b", re.MULTILINE)
ZEMAX = re.compile(r"^\s*AngleOfIncidence\b", re.MULTILINE)
LISTS = ("SampleRotation", "AngleOfIncidence", "ScatterAzimuth", "ScatterRadial")
NUMBERS = ("AOI", "POI", "Wavelength", "TIS")
COLUMNS = ("theta_i_deg", "theta_r_deg", "phi_i_deg", "phi_r_deg", "brdf_per_sr")
SOURCE_DEG = 90.0  # azimuth of the source in LightTools' files


class OpticsWords:
    """The words of a file one after the other, with the line of the last one."""

    def __init__(self, file: str, text: str):
        self.file, self.line = file, 0
        self.words = iter(
            (number, word)
            for number, line in lines_of(text)
            if not line.lstrip().startswith("#")
            for word in line.split()
        )

    def next(self) -> str:
        self.line, word = next(self.words, (self.line, ""))
        if not word:
            raise InputError(f"{self.file}: ends after line {self.line}, before DataEnd")
        return word

    def number(self, word: str | None = None) -> float:
        word = self.next() if word is None else word
        if not NUMBER.fullmatch(word):
            raise InputError(f"{self.file}, line {self.line}: {shown(word)} is not a number")
        return float(word)

    def numbers(self, count: float) -> list[float]:
        return [self.number() for _ in range(int(count))]


def parse_optics(file: str, text: str) -> TextTable:
    """The table in the text of a Zemax or LightTools file."""
    words, lists, state, blocks = OpticsWords(file, text), {}, {}, []
    while (word := words.next()) != "DataBegin":
        if word in LISTS:
            lists[word] = words.numbers(words.number())
        elif word not in ("Monochrome", "TristimulusX", "TristimulusY", "TristimulusZ"):
            state[word] = words.next()
    if missing := {"ScatterAzimuth", "ScatterRadial"} - set(lists):
        raise InputError(f"{file}: lacks {min(missing)} before DataBegin")
    radial = lists["ScatterRadial"]
    while (word := words.next()) != "DataEnd":
        if NUMBER.fullmatch(word):
            count = len(lists["ScatterAzimuth"]) * len(radial)
            line, values = words.line, [float(word), *words.numbers(count - 1)]
            blocks.append((line, dict(state), np.reshape(values, (-1, len(radial)))))
        elif word != "DataBegin":
            state[word] = words.number() if word in NUMBERS else words.next()
    is_zemax, given = LISTS[1] in lists, lists.get(LISTS[1], [])
    if is_zemax and len(blocks) != len(given) * len(lists.get(LISTS[0], [0])):
        raise InputError(
            f"{file}: {len(blocks)} blocks of data for {len(given)} angles of incidence"
        )
    rows, header = [], {}
    for k, (line, of_block, values) in enumerate(blocks):
        if of_block.get("Side", "Front") != "Front" or of_block.get("ScatterType") != "BRDF":
            continue
        if of_block.get("SpectralContent", "Monochrome") != "Monochrome":
            raise InputError(f"{file}: has colours (SpectralContent); only Monochrome is read")
        if of_block.get("POI", 0):
            raise InputError(f"{file}, line {line}: POI = {of_block['POI']:g}; only 0 is read")
        if not is_zemax and "AOI" not in of_block:
            raise InputError(
                f"{file}, line {line}: no AOI, the angle of incidence, before the data"
            )
        if wavelength := of_block.get("Wavelength", 0):
            set_key(file, header, "band_um", f"{wavelength / 1000:.9g}", line)
        incidence = given[k % len(given)] if is_zemax else of_block["AOI"]
        for azimuth, of_azimuth in zip(lists["ScatterAzimuth"], values):
            for angle, value in zip(radial, of_azimuth):
                rows += row_of(is_zemax, line, incidence, azimuth, angle, value)
    if not rows:
        raise InputError(f"{file}: no BRDF of the front side; BTDFs are not read")
    return TextTable(file, list(COLUMNS), rows, header)


def row_of(is_zemax: bool, line: int, incidence, azimuth, angle, value) -> list:
    """The row of a value, or none below the horizon. The angles of Zemax are from the specular
    direction; in the plane of incidence, they add to it.
    """
    cosine = np.cos(np.radians(azimuth))
    off_plane = is_zemax and abs(abs(cosine) - 1) > 1e-9
    source, observer = (0.0, 90.0 if off_plane else 180.0) if is_zemax else (SOURCE_DEG, azimuth)
    theta = incidence - angle * cosine if is_zemax and not off_plane else angle
    if abs(theta) > 90 or (angle == 0 and azimuth and is_zemax):  # the centre is stated once
        return []
    return [(line, [repr(float(x)) for x in (incidence, theta, source, observer, value)])]


# MERL
# ----

MERL = (90, 90, 180)  # steps in the angles of half-vector and difference, and in its azimuth
GREEN, SCALE = 1, 1.15 / 1500
EVERY_DEG = 5  # difference angles that are taken


def parse_merl(file: str, content: bytes) -> TextTable:
    """Points in the plane of incidence of a MERL file, at the centres of its bins."""
    size = int(np.prod(MERL))
    if len(content) != 12 + 3 * 8 * size:
        raise InputError(f"{file}: begins as a MERL file, but has not {12 + 24 * size} bytes")
    table = np.frombuffer(content, "<f8", size, 12 + 8 * size * GREEN).reshape(MERL)[..., 0]
    half, difference = np.meshgrid(
        90 * ((np.arange(MERL[0]) + 0.5) / MERL[0]) ** 2,
        np.arange(MERL[1])[::EVERY_DEG] + 0.5,
        indexing="ij",
    )
    incidence, observer = difference + half, difference - half
    value = SCALE * table[:, ::EVERY_DEG]
    kept = (incidence < 90) & (abs(observer) < 90) & (value > 0)
    points = np.stack([incidence, observer, value], -1)[kept]
    names = ["theta_i_deg", "theta_r_deg", "brdf_per_sr"]
    return TextTable(file, names, [(0, [repr(float(x)) for x in point]) for point in points])
