import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.spectra.files import spectrum_of


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
    write("e.txt").write_text(ecostress(x, y, "Emissivity (fraction)"))
    assert np.allclose(spectrum_of(write("e.txt"), "reflectance")[1], 1 - y, atol=1e-12)


BAD = {
    "nanometres: divide by 1000": "wavelength_um,reflectance\n3000,.1\n5000,.2\n",
    "wavelengths 0.01..5; must lie in": "wavelength_um,reflectance\n.01,.1\n5,.2\n",
    "per cent: divide by 100": "wavelength_um,reflectance\n3,10\n5,20\n",
    "reflectance 1.02 at 4 um; must lie in 0..1": "wavelength_um,reflectance\n3,.9\n4,1.02\n",
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
    with pytest.raises(InputError, match="reflectance 1.02 at 2 um"):
        spectrum_of(tmp_path / "values", "reflectance", tmp_path / "waves")
    (tmp_path / "waves").write_text("title\n1\n2\nthree\n")
    with pytest.raises(InputError, match="one number a line"):
        spectrum_of(tmp_path / "values", "reflectance", tmp_path / "waves")
