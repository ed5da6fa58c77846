"""tape7: synthetic files in MODTRAN's layout, and three real ones against their own columns."""

from pathlib import Path

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.air import tape7
from mi_lcair.physics.atmosphere import atmosphere
from mi_lcair.physics.sky import spectrum

REAL = Path(__file__).parents[4] / "shared" / "data" / "modtran"
REAL_FILES = ("tape7-02", "tape7.LWIRSun", "tape7.MWIRSun")
COLUMNS = {
    "FREQ": "8.2f",
    "TOT_TRANS": "11.8f",
    "PTH_THRML": "11.4E",
    "THRML_SCT": "11.4E",
    "SURF_EMIS": "11.4E",
    "SOL_SCAT": "11.4E",
    "SING_SCAT": "11.4E",
    "GRND_RFLT": "11.4E",
    "DRCT_RFLT": "11.4E",
    "TOTAL_RAD": "11.4E",
    "REF_SOL": "9.2E",
    "SOL@OBS": "9.2E",
    "DEPTH": "8.3f",
    "DIR_EM": "7.4f",
    "TOA_SUN": "11.4E",
    "BBODY_T[K]": "11.3f",
}
H, C, K = 6.62607015e-34, 299792458.0, 1.380649e-23


def planck(wavenumber, kelvin):
    """Planck's law over wavenumber [cm^-1], in W cm^-2 sr^-1 / cm^-1."""
    per_m = 100 * np.asarray(wavenumber, dtype=float)
    return 2 * H * C**2 * per_m**3 / np.expm1(H * C * per_m / (K * kelvin)) * 100 * 1e-4


def block(
    wavenumbers,
    transmittance=0.5,
    kelvin=280.0,
    range_km=2.0,
    itype=1,
    mode=1,
    header=None,
    heights_and_angle=(0.5, 10, 30),
    **columns,
) -> str:
    """A block of a tape7 for homogeneous air at a temperature.

    Other columns are given by one number for all rows, by a number for each row, or by None for
    blanks.
    """
    width = {name: int(form.split(".")[0]) for name, form in COLUMNS.items()}
    air = (1 - transmittance) * planck(wavenumbers, kelvin)
    values = (
        dict.fromkeys(COLUMNS)
        | {"FREQ": wavenumbers, "TOT_TRANS": transmittance, "PTH_THRML": air, "TOTAL_RAD": air}
        | columns
    )
    values = {
        name: None if value is None else np.broadcast_to(value, len(wavenumbers))
        for name, value in values.items()
    }
    rows = [
        "".join(
            " " * width[name] if value is None else f"{value[k]:{COLUMNS[name]}}"
            for name, value in values.items()
        )
        for k in range(len(wavenumbers))
    ]
    card_3 = (*heights_and_angle, range_km, 0, 0)
    return (
        "\n".join(
            [
                f"T F 6{itype:5d}{mode:5d}    0    6    6    6    6    6    6    1    0    0"
                "   0.000   0.00",
                "    1    1    1    0    0    0  23.00000   0.00000   0.00000   0.00000   0.00000",
                " -99.00000 -99.00000 -99.00000  1.400000  0.000700 ! H2O & O3 COLUMNS [GM/CM2]",
                "".join(f"{value:10.5f}" for value in card_3) + "    0        0.00000",
                " -99.00000" * 4 + "  12.00000" + "   0.00000" * 3,
                f"{wavenumbers[0]:10.1f}{wavenumbers[-1]:10.1f}       1.0       1.0NW",
                header or "".join(f"{name:>{width[name]}}" for name in COLUMNS),
                *rows,
                " -9999.",
            ]
        )
        + "\n"
    )


MWIR, LWIR = np.arange(2000, 3340, 20.0), np.arange(830, 1255, 5.0)


@pytest.fixture
def file(tmp_path):
    """Write blocks to a file without a suffix and return its path."""

    def write(*blocks):
        path = tmp_path / "tape7"
        path.write_text("".join(blocks))
        return path

    return write


def test_units(file):
    """Wavenumbers become rising wavelengths, and radiances are those per wavelength.

    The radiance of the air is (1 - tau) B(280 K), with Planck's law over wavelength.
    """
    path = file(block(MWIR))
    (computed,) = tape7.blocks(path)
    x = computed.wavelengths_um * 1e-6
    expected = 2 * H * C**2 / x**5 / np.expm1(H * C / (x * K * 280)) * 1e-6
    assert computed.range_m == 2000 and not computed.to_space and x[0] == pytest.approx(1e-2 / 3320)
    np.testing.assert_allclose(computed.path_radiance, 0.5 * expected, rtol=6e-5)
    np.testing.assert_allclose(computed.total_radiance, 0.5 * expected, rtol=6e-5)
    np.testing.assert_allclose(atmosphere(path).path(1000).transmittance, np.sqrt(0.5), rtol=1e-7)


def test_path_radiance_holds_sunlight_but_neither_the_scattered_part_twice_nor_the_surface(file):
    part = planck(MWIR, 280)
    (computed,) = tape7.blocks(
        file(
            block(
                MWIR,
                mode=2,
                PTH_THRML=part,
                THRML_SCT=0.1 * part,
                SURF_EMIS=part,
                SOL_SCAT=0.5 * part,
                SING_SCAT=0.4 * part,
                GRND_RFLT=0.2 * part,
                TOTAL_RAD=2.7 * part,
            )
        )
    )
    np.testing.assert_allclose(
        computed.total_radiance, computed.path_radiance * 2.7 / 1.5, rtol=1e-4
    )
    assert computed.total_radiance[-1] == pytest.approx(2.7 * planck(2000, 280) * 2000**2, rel=1e-4)


@pytest.mark.parametrize("apart", [False, True])
def test_names_of_modtran_6(file, apart):
    """THRML_EM and MULT_SCAT are read. TOTAL_RAD shows whether they hold the scattered parts."""
    part = planck(MWIR, 280)
    path = file(
        block(
            MWIR,
            mode=2,
            PTH_THRML=part,
            THRML_SCT=0.1 * part,
            SURF_EMIS=part,
            SOL_SCAT=0.5 * part,
            SING_SCAT=0.4 * part,
            GRND_RFLT=0.2 * part,
            TOTAL_RAD=(3.2 if apart else 2.7) * part,
        )
        .replace("PTH_THRML", " THRML_EM")
        .replace(" SOL_SCAT", "MULT_SCAT")
    )
    (computed,) = tape7.blocks(path)
    share = 2.0 / 3.2 if apart else 1.5 / 2.7
    np.testing.assert_allclose(computed.path_radiance, computed.total_radiance * share, rtol=1e-4)


def test_a_file_in_latin_1(file):
    """A card holds the name of a place in Latin-1."""
    path = file(block(MWIR))
    expected = tape7.blocks(path)[0].path_radiance
    path.write_bytes(path.read_bytes().replace(b"COLUMNS", b"Orl\xe9ans"))
    np.testing.assert_array_equal(tape7.blocks(path)[0].path_radiance, expected)
    assert atmosphere(path).ranges_m.tolist() == [2000]


@pytest.mark.parametrize("name", ["TOT_TRANS", "PTH_THRML", "TOTAL_RAD", "SOL_SCAT", "SURF_EMIS"])
def test_numbers_without_bound_are_refused(file, name):
    text = block(MWIR, mode=2, **{name: np.inf})
    with pytest.raises(InputError, match=f"line 8: .*{name} must "):
        tape7.blocks(file(text))


def test_columns_that_touch_and_exponents_of_three_digits(file):
    """Five digits before the point fill the width of FREQ, and Fortran omits the E of E-103."""
    lines = block([12000.0, 12001.0], range_km=1296.0874).splitlines()
    assert lines[3][30:40] == "1296.08740" and lines[7].startswith("12000.00")
    lines[7] = lines[7].replace(lines[7][19:30], " 1.2345-103")
    (computed,) = tape7.blocks(file("\n".join(lines) + "\n"))
    assert computed.range_m == 1296087.4
    assert computed.path_radiance[-1] == pytest.approx(1.2345e-103 * 12000**2)


def test_names_of_two_words(file):
    text = block(MWIR)
    for name in ("TOT_TRANS", "PTH_THRML", "THRML_SCT", "SOL_SCAT", "TOTAL_RAD"):
        text = text.replace(name, name.replace("_", " "))
    np.testing.assert_array_equal(
        tape7.blocks(file(text))[0].path_radiance, tape7.blocks(file(block(MWIR)))[0].path_radiance
    )


def slant(elevation, transmittance, range_km, h1=0.0, h2=0.0, **columns):
    geometry = (h1, h2, 90 - elevation)
    return block(
        MWIR, transmittance, range_km=range_km, itype=2, heights_and_angle=geometry, **columns
    )


def test_the_range_on_card_3(file):
    """In km; 0 means that the card does not state it. An elevation is 90 degrees less ANGLE."""
    for text, elevation in ((block(MWIR, range_km=0.0005), 0.0), (slant(-30, 0.5, 0.0005), -30.0)):
        (computed,) = tape7.blocks(file(text))
        assert computed.range_m == pytest.approx(0.5) and computed.elevation_deg == elevation
        assert not computed.to_space and computed.line == 7
    for text in (block(MWIR, range_km=0), slant(30, 0.5, 0.0, 1, 1)):
        assert tape7.blocks(file(text))[0].range_m is None
    assert tape7.blocks(file(block(MWIR, itype=3)))[0].to_space


def test_the_range_of_a_slant_path_from_its_heights(file):
    for elevation, h1, h2, length in ((30, 0, 2, 4.0), (-30, 2, 0, 4.0), (90, 1, 3, 2.0)):
        (computed,) = tape7.blocks(file(slant(elevation, 0.5, 0.0, h1, h2)))
        assert computed.elevation_deg == elevation
        assert computed.range_m == pytest.approx(1000 * length, rel=1e-3)
    for elevation, h1, h2 in ((-30, 0, 2), (30, 2, 0), (-1, 20, 19), (30, 1, 1)):
        (computed,) = tape7.blocks(file(slant(elevation, 0.5, 0.0, h1, h2)))
        assert (computed.range_m is None) == (elevation != -1)


def test_a_sky(file):
    """TOTAL_RAD is read as a spectrum, with bands joined, for a single line of sight."""
    path = file(block(MWIR, itype=3), block(LWIR, itype=3, TOTAL_RAD=planck(LWIR, 250)))
    sky = spectrum(path)
    assert sky.at(10) == pytest.approx(planck(1000, 250) * 1e6, rel=1e-4) and sky.name == str(path)
    with pytest.raises(InputError, match="elevation cannot be chosen"):
        spectrum(path, 5)
    with pytest.raises(InputError, match="lines of sight of different ranges"):
        spectrum(file(block(MWIR), block(LWIR, range_km=3)))
    with pytest.raises(InputError, match="overlapping wavelengths"):
        spectrum(file(block(MWIR), block(MWIR)))


@pytest.mark.parametrize(
    "mode, name", [(0, "transmittance"), (3, "solar irradiance"), (4, "no thermal radiance")]
)
def test_modes_without_thermal_radiance(file, mode, name):
    for read in (atmosphere, spectrum):
        with pytest.raises(
            InputError, match=f"line 1: IEMSCT = {mode} .{name}.; run MODTRAN with IEMSCT = 1"
        ):
            read(file(block(MWIR, mode=mode, header="    FREQ COMBIN    H2O")))


def transmittances(wavenumbers, values, range_km=2.0) -> str:
    """A block of the transmittance mode: two lines of names, and the other columns of absorbers."""
    cards = block(wavenumbers, mode=0, range_km=range_km).split("    FREQ")[0]
    names = "    FREQ COMBIN    H2O   UMIX     O3    -LOG\n"
    names += "    CM-1  TRANS  TRANS  TRANS  TRANS  COMBIN\n"
    rows = [
        f"{nu:8.2f}{t:7.4f} 1.0000 0.9900 1.0000{-np.log(t):8.4f}"
        for nu, t in zip(wavenumbers, values)
    ]
    return cards + names + "\n".join([*rows, " -9999."]) + "\n"


def test_transmittances_with_the_temperature_of_the_air(file):
    """The path radiance is that of a blackbody at this temperature, times 1 - transmittance."""
    tau = np.round(0.5 + 0.3 * np.sin(np.asarray(MWIR) / 40), 4)
    path = file(transmittances(MWIR, tau))
    air = atmosphere(path, air_temperature=290.0)
    assert air.ranges_m == [2000]
    nu = 1e4 / air.wavelengths_um
    expected = (1 - tau[::-1]) * planck(nu, 290) * 1e4 * nu**2 / 1e4
    np.testing.assert_allclose(air.transmittance[0], tau[::-1], rtol=1e-12)
    np.testing.assert_allclose(air.path_radiance[0], expected, rtol=1e-6)
    with pytest.raises(InputError, match="or give air_temperature of .atmosphere."):
        atmosphere(path)
    with pytest.raises(InputError, match="air_temperature is for transmittances .IEMSCT = 0."):
        atmosphere(file(block(MWIR)), air_temperature=290.0)
    with pytest.raises(InputError, match="air_temperature is for the blocks of a MODTRAN tape7"):
        atmosphere("us_standard", air_temperature=290.0)
    with pytest.raises(InputError, match="TOT_TRANS must lie in 0..1"):
        atmosphere(file(transmittances(MWIR, tau + 1)), air_temperature=290.0)


def swapped(text, line, start, new):
    lines = text.splitlines(keepends=True)
    lines[line - 1] = lines[line - 1][:start] + new + lines[line - 1][start + len(new) :]
    return "".join(lines)


@pytest.mark.parametrize(
    "text, message",
    [
        (block(MWIR).replace(" -9999.", ""), "from line 1 on has no end"),
        (block(MWIR) + block(LWIR)[:900], "line 76 on has no end"),
        (block(MWIR, -0.5, TOTAL_RAD=0), "line 8: TOT_TRANS must lie in 0..1"),
        (block(MWIR, 1.5, PTH_THRML=0, TOTAL_RAD=0), "line 8: TOT_TRANS"),
        (block(MWIR, SOL_SCAT=-1e-9), "line 8: SOL_SCAT must be 0 or more"),
        (block(MWIR, TOTAL_RAD=None), "line 8: PTH_THRML and TOTAL_RAD"),
        (block(MWIR[::-1]), "line 9: FREQ must be positive and rising"),
        (block(MWIR - 2010, PTH_THRML=0, TOTAL_RAD=0), "line 8: FREQ must be positive"),
        (block(MWIR[:1]), "two rows"),
        (
            swapped(block(MWIR), 10, 17, "  "),
            "line 10: '0.500000' below TOT_TRANS; each number must end where",
        ),
        (swapped(block(MWIR), 10, 25, "xx"), "line 10: .* below PTH_THRML"),
        (block(MWIR, header="    FREQ   TRANS"), "line 7: has no column TOT_TRANS"),
        ("FREQ TOT_TRANS\n -9999.\n", "must begin with card 1"),
        (block(MWIR) + block(MWIR), "lines 7 and 82 cannot be joined"),
        (block(MWIR) + block(MWIR[10:], range_km=3), "lines 7 and 82 have different wavelengths"),
    ],
)
def test_unusable_file(file, text, message):
    with pytest.raises(InputError, match=message):
        atmosphere(file(text))


def test_neither_csv_nor_tape7(tmp_path):
    (tmp_path / "air.tp7").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not a text file"):
        atmosphere(tmp_path / "air.tp7")


@pytest.mark.skipif(not REAL.is_dir(), reason="the real MODTRAN files are not part of the project")
@pytest.mark.parametrize("name", REAL_FILES)
def test_real_file_has_its_own_brightness_temperatures(name):
    """Brightness temperatures of the converted TOTAL_RAD agree with BBODY_T within 0.05 K.

    TOTAL_RAD is the sum of path radiance, SURF_EMIS and GRND_RFLT. In these files PTH_THRML
    includes THRML_SCT, and SOL_SCAT includes SING_SCAT.
    """
    path = REAL / name
    (computed,) = tape7.blocks(path)
    rows = path.read_text().splitlines()[computed.line : -1][::-1]
    assert len(rows) == len(computed.wavelengths_um) > 50
    x = computed.wavelengths_um * 1e-6
    kelvin = H * C / (K * x * np.log1p(2 * H * C**2 / (x**5 * computed.total_radiance * 1e6)))
    np.testing.assert_allclose(kelvin, [float(row[151:162]) for row in rows], rtol=0, atol=0.01)
    surface = (
        np.array([float(row[41:52]) + float(row[74:85]) for row in rows])
        * (1e4 / computed.wavelengths_um) ** 2
    )
    np.testing.assert_allclose(computed.path_radiance + surface, computed.total_radiance, rtol=1e-4)


@pytest.mark.skipif(not REAL.is_dir(), reason="the real MODTRAN files are not part of the project")
def test_real_ranges():
    assert atmosphere(REAL / "tape7-02").ranges_m.tolist() == [2000]
    with pytest.raises(InputError, match="path to space"):
        atmosphere(REAL / "tape7.LWIRSun")
    assert spectrum(REAL / "tape7.LWIRSun").at(10) == pytest.approx(3.85, abs=0.01)
