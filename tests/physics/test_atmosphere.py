"""Atmospheres: bundled tables against their stated values, interpolation against closed forms."""

import csv

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.atmosphere import AtmosphereTable, atmosphere, atmosphere_names
from mi_lcair.physics.bands import BUNDLED, band
from mi_lcair.physics.blackbody import in_band_radiance, spectral_radiance
from mi_lcair.physics.sky import spectrum
from mi_lcair.physics.spectral_table import spectral_table
from tests.physics.air.test_tape7 import (
    LWIR,
    MWIR,
    block,
    file,  # noqa: F401
    planck,
    slant,  # noqa: F401
)

BANDS = {"3-5": "MWIR", "8-12": "LWIR"}
AIR = {"midlat_summer": 293.975, "us_standard": 287.875}  # K, on the bundled paths
HEADER = "range_km,wavelength_um,transmittance,path_radiance_W_m2_sr_um\n"


def summary(kind):
    lines = [
        line for line in (BUNDLED / "inband_summary.csv").read_text().splitlines() if line[0] != "#"
    ]
    return [row for row in csv.DictReader(lines) if row["kind"] == kind and row["imult"] == "0"]


def grey(ranges_m=(1000.0, 3000.0), per_m=(1e-3, 2e-4), temperature=290.0):
    """Homogeneous air with two wavelengths and an extinction coefficient for each."""
    wavelengths = np.array([4.0, 4.05])
    transmittance = np.exp(-np.outer(ranges_m, per_m))
    return AtmosphereTable(
        "grey",
        np.array(ranges_m),
        wavelengths,
        transmittance,
        (1 - transmittance) * spectral_radiance(wavelengths, temperature),
    )


def tabulated(name):
    """Clear air as a table of the ranges that LOWTRAN7's tables of horizontal paths have."""
    air, ranges = atmosphere(name), np.array([250.0, 500.0, 1000.0, 2000.0, 5000.0])
    paths = [air.path(length) for length in ranges]
    return AtmosphereTable(
        name,
        ranges,
        air.wavelengths_um,
        np.array([path.transmittance for path in paths]).round(6),
        np.array([path.radiance for path in paths]),
    )


def test_horizontal_paths_have_the_values_of_lowtran7():
    """Transmittance and radiance of every path agree with LOWTRAN7's own within 0.15 %."""
    rows = summary("path")
    assert {row["atmosphere"] for row in rows} | {"vacuum"} == set(atmosphere_names()) and len(
        rows
    ) == 2 * 5 * 2
    for row in rows:
        air, window, length = (
            atmosphere(row["atmosphere"]),
            band(BANDS[row["band_um"]]),
            1000 * float(row["range_km"]),
        )
        assert air.transmittance_mean(window, length) == pytest.approx(
            float(row["transmittance_mean"]), rel=1.5e-3
        ), row
        assert air.band_path_radiance(window, [length])[0] == pytest.approx(
            float(row["radiance_W_m2_sr"]), rel=1.5e-3
        ), row


@pytest.mark.slow
def test_cloudy_skies_have_their_stated_transmittance():
    rows = [row for row in summary("sky") if row["sky"] != "clear"]
    assert len(rows) == 6 * 11 * 2
    for row in rows:
        path = BUNDLED / f"sky_{row['atmosphere']}_{row['sky']}.csv"
        table = spectral_table(path, "sky", (("transmittance", 1.0),), ("elevation_deg",))
        window, line = (
            band(BANDS[row["band_um"]]),
            list(table.keys["elevation_deg"]).index(float(row["elevation_deg"])),
        )
        mean = window.integral(table.wavelengths_um, table.columns[0][line]) / (
            window.upper_um - window.lower_um
        )
        assert mean == pytest.approx(float(row["transmittance_mean"]), abs=6e-5), row


@pytest.mark.parametrize(
    "name, air, sea_level, clear, stratus",
    [
        ("midlat_summer", 293.95, 294.2, (0.9992, 0.9896, 0.9920), (0.9806, 0.9903)),
        ("us_standard", 287.87, 288.2, (0.9992, 0.9860, 0.9736), (0.9730, 0.9818)),
    ],
)
def test_the_checks_of_the_tables_readme(name, air, sea_level, clear, stratus):
    """The sky at 0.5 degrees relative to blackbodies of the air at the observer and at sea level.

    The checks are at 4.301 um and in 8-12 um.
    """

    def ratios(sky, temperatures):
        line = spectrum(f"{name}_{sky}", 0.5)
        return (
            *[line.at(4.30108) / spectral_radiance(4.30108, T) for T in temperatures],
            line.in_band_radiance(band("LWIR")) / in_band_radiance(band("LWIR"), sea_level),
        )

    assert ratios("clear", (air, sea_level)) == pytest.approx(clear, abs=2e-3)
    assert ratios("stratus", (sea_level,)) == pytest.approx(stratus, abs=6e-5)


@pytest.mark.parametrize("name", AIR)
@pytest.mark.parametrize("length", [3, 100, 250, 700, 4000])
def test_bundled_air_is_a_blackbody_where_it_is_opaque(name, length):
    """The path radiance is (1 - transmittance) B(air), to 0.2 % (0.03 K).

    This holds at the tabulated ranges and between them.
    """
    path = atmosphere(name).path(length)
    expected = (1 - path.transmittance) * spectral_radiance(path.wavelengths_um, AIR[name])
    np.testing.assert_allclose(path.radiance, expected, rtol=2e-3)


@pytest.mark.parametrize("length", [1e-3, 10, 999, 1000, 2345, 3000])
def test_homogeneous_air_is_exact_at_every_range(length):
    """Two tabulated ranges reproduce Bouguer's law."""
    transmittance, radiance = grey().path(length).at([4.0, 4.05])
    np.testing.assert_allclose(transmittance, np.exp(-length * np.array([1e-3, 2e-4])), rtol=1e-12)
    np.testing.assert_allclose(
        radiance,
        -np.expm1(-length * np.array([1e-3, 2e-4])) * spectral_radiance([4.0, 4.05], 290),
        rtol=1e-9,
    )


def test_between_ranges_optical_depth_is_a_power_and_source_linear():
    """Between ranges, the optical depth is a power of range and the source function is linear.

    The geometric mean of two ranges has the geometric mean of the optical depths 0.3 and 0.9. The
    source function there lies between 3 and 5, in proportion to range.
    """
    depths = np.array([[0.3] * 2, [0.9] * 2])
    air = AtmosphereTable(
        "slant",
        np.array([1e3, 4e3]),
        np.array([4.0, 4.1]),
        np.exp(-depths),
        -np.expm1(-depths) * [[3], [5]],
    )
    path = air.path(2000)
    np.testing.assert_allclose(path.transmittance, np.exp(-np.sqrt(0.27)), rtol=1e-12)
    np.testing.assert_allclose(path.radiance, -np.expm1(-np.sqrt(0.27)) * (3 + 2 / 3), rtol=1e-12)


@pytest.mark.parametrize("name", AIR)
@pytest.mark.parametrize("left_out", [1, 2, 3])
def test_a_range_that_is_left_out(name, left_out):
    """A tabulated range that is left out is predicted from its neighbours.

    The relative error of the in-band transmittance is below 0.7 %, that of the path radiance below
    1.2 %. In MWIR the transmittance has half the error of an optical depth that is linear in range.
    """
    air = tabulated(name)
    kept = np.arange(len(air.ranges_m)) != left_out
    fewer = AtmosphereTable(
        "fewer",
        air.ranges_m[kept],
        air.wavelengths_um,
        air.transmittance[kept],
        air.path_radiance[kept],
    )
    low, length, high = air.ranges_m[left_out - 1 : left_out + 2]
    for window in (band("MWIR"), band("LWIR")):
        expected = air.transmittance_mean(window, length)
        assert fewer.transmittance_mean(window, length) == pytest.approx(expected, rel=7e-3)
        weights = window.row_weights(air.wavelengths_um)
        predicted, entry = fewer.path(length).radiance, air.path_radiance[left_out]
        assert predicted @ weights == pytest.approx(entry @ weights, rel=1.2e-2)
        depths = -np.log(np.maximum(air.transmittance[[left_out - 1, left_out + 1]], 5e-7))
        linear = np.exp(-(depths[0] + (depths[1] - depths[0]) * (length - low) / (high - low)))
        if window.name == "MWIR":
            straight = window.row_weights(air.wavelengths_um) @ linear / 2
            assert (
                abs(fewer.transmittance_mean(window, length) - expected)
                < abs(straight - expected) / 2
            )


@pytest.mark.parametrize("name", AIR)
def test_short_ranges_of_a_table(name):
    """The path of 0.25 km is predicted from the longer ranges within 1 %.

    The transmittance at range 0 is 1.
    """
    air = tabulated(name)
    fewer = AtmosphereTable(
        "fewer", air.ranges_m[1:], air.wavelengths_um, air.transmittance[1:], air.path_radiance[1:]
    )
    for window in (band("MWIR"), band("LWIR")):
        assert fewer.transmittance_mean(window, 250) == pytest.approx(
            air.transmittance_mean(window, 250), rel=1e-2
        )
        assert air.transmittance_mean(window, 1e-6) == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("name", AIR)
def test_a_tabulated_range_gives_the_table(name):
    air = tabulated(name)
    for k, length in enumerate(air.ranges_m):
        path = air.path(length)
        # The absolute tolerance is for opaque rows, whose transmittance is below the last digit.
        np.testing.assert_allclose(
            path.transmittance, air.transmittance[k], rtol=1e-12, atol=5.1e-7
        )
        np.testing.assert_allclose(path.radiance, air.path_radiance[k], rtol=1e-6)


def test_opaque_rows_are_bounded_by_what_is_printed():
    """A printed 0 is read as less than half the last of six digits.

    It is also less than every transmittance in the table.
    """
    table = np.array([[0.5, 0.0, 1.0], [0.0, 0.0, 1.0]])
    air = AtmosphereTable(
        "opaque", np.array([1.0, 2.0]), np.array([4.0, 4.1, 4.2]), table, 1 - table
    )
    np.testing.assert_allclose(air.path(2).transmittance, [5e-7, 5e-7, 1], rtol=1e-9)
    # Below an opaque first range the depth is proportional to range, below another one by its power
    power = np.clip(np.log2(np.log(5e-7) / np.log(0.5)), 0.5, 1)
    np.testing.assert_allclose(
        air.path(0.5).transmittance, [np.exp(-np.log(2) * 0.5**power), np.sqrt(5e-7), 1], rtol=1e-9
    )
    fine = AtmosphereTable(
        "fine",
        air.ranges_m,
        air.wavelengths_um,
        np.array([[0.5, 1e-8, 1.0], [0.0, 0.0, 1.0]]),
        1 - table,
    )
    np.testing.assert_allclose(fine.path(2).transmittance, [5e-9, 5e-9, 1], rtol=1e-9)
    summer = tabulated("midlat_summer")
    paths = [summer.path(R).transmittance for R in np.linspace(1, 5000, 60)]
    assert np.all(np.diff(paths, axis=0) <= 1e-6)


def test_a_path_too_clear_to_tell_has_the_source_of_the_next_one():
    """A rounding error in 1 - transmittance would make the source function 100 times too large."""
    air = AtmosphereTable(
        "clear",
        np.array([10.0, 1000.0]),
        np.array([4.0, 4.1, 4.2]),
        np.array([[1 - 1e-6, 1.0, 1.0], [0.9, 0.9, 1.0]]),
        np.array([[1e-4, 1e-4, 0.0], [0.1, 0.1, 0.0]]),
    )
    path = air.path(500)
    np.testing.assert_allclose(path.radiance, 1 - path.transmittance, rtol=1e-9)
    assert path.transmittance[2] == 1 and path.radiance[2] == 0


def test_beyond_the_last_range():
    """A range beyond the last one is refused, or is extrapolated with a warning.

    The transmittance does not rise beyond the last range.
    """
    with pytest.raises(InputError, match="range 4000 m is beyond its last one, 3000 m"):
        grey().path(4000)
    with pytest.warns(
        UserWarning, match="range 4000 m is beyond its last one, 3000 m: .* extrapolated"
    ):
        path = grey().path(4000, extrapolate=True)
    np.testing.assert_allclose(
        path.transmittance, np.exp(-4000 * np.array([1e-3, 2e-4])), rtol=1e-12
    )
    np.testing.assert_allclose(
        path.radiance, (1 - path.transmittance) * spectral_radiance([4.0, 4.05], 290), rtol=1e-9
    )
    odd = AtmosphereTable(
        "odd",
        np.array([1.0, 2.0]),
        np.array([4.0, 4.1]),
        np.array([[0.5] * 2, [0.6] * 2]),
        np.zeros((2, 2)),
    )
    with pytest.warns(UserWarning):
        np.testing.assert_allclose(odd.path(100, extrapolate=True).transmittance, 0.6)


@pytest.mark.parametrize("name", ["us_standard", "vacuum"])
@pytest.mark.parametrize(
    "length, message",
    [
        (0, "range = 0 m"),
        (-5, "range = -5 m"),
        (np.nan, "range = nan m"),
        (np.inf, "range = inf m"),
    ],
)
def test_no_range(name, length, message):
    with pytest.raises(InputError, match=message):
        atmosphere(name).path(length)
    with pytest.raises(InputError, match=message):
        atmosphere(name).band_path_radiance(band("MWIR"), [1.0, length])


def test_vacuum_changes_nothing():
    air = atmosphere("vacuum")
    air.check_covers(band("total"))
    transmittance, radiance = air.path(1e9).at([0.5, 4.0])
    assert transmittance.tolist() == [1, 1] and radiance.tolist() == [0, 0]
    assert air.transmittance_mean(band("SWIR"), 5) == 1
    assert air.band_transmittance(band("MWIR"), np.zeros((3, 0)), [1, 2]).tolist() == [[1, 1]] * 3
    assert air.band_path_radiance(band("MWIR"), [1, 2]).tolist() == [0, 0]


def test_bands_at_many_ranges(tmp_path):
    """In-band values at many ranges agree with a fine trapezoidal rule over each path.

    The band has a response, and there are more ranges than are computed together.
    """
    response = tmp_path / "response.csv"
    response.write_text("wavelength_um,response\n3.4,0\n4.1,1\n4.8,0.3\n")
    window, air, ranges = band(response), atmosphere("us_standard"), np.linspace(1, 5000, 2500)
    hot, cold = (spectral_radiance(air.wavelengths_um, T) for T in (800, 250))
    weighted = air.band_transmittance(window, [hot, cold, 0 * hot], ranges)
    radiance = air.band_path_radiance(window, ranges)
    assert weighted.shape == (3, 2500) and radiance.shape == (2500,)
    x = np.linspace(3.4, 4.8, 40001)
    for k in (0, 1100, 2499):
        transmittance, of_path = air.path(ranges[k]).at(x)
        for computed, spectrum_of in zip(
            weighted[:, k], (spectral_radiance(x, 800), spectral_radiance(x, 250), np.ones_like(x))
        ):
            weight = window.response_at(x) * spectrum_of
            assert computed == pytest.approx(
                np.trapezoid(transmittance * weight, x) / np.trapezoid(weight, x), rel=5e-4
            )
        assert radiance[k] == pytest.approx(
            np.trapezoid(of_path * window.response_at(x), x), rel=1e-6
        )
    assert air.transmittance_mean(window, ranges[1100]) == pytest.approx(
        weighted[2, 1100], rel=1e-12
    )
    assert weighted[0, 1100] != pytest.approx(weighted[1, 1100], rel=0.05)


def test_what_a_table_does_not_cover():
    air = atmosphere("us_standard")
    for name in ("SWIR", "4-9", "11-15"):
        with pytest.raises(
            InputError,
            match="'us_standard': does not cover band .*; it has 2.9985-5, 6.99301-14.0845 um",
        ):
            air.transmittance_mean(band(name), 100)
    with pytest.raises(InputError, match="does not cover band total"):
        air.check_covers(band("total"))
    with pytest.raises(InputError, match="wavelengths 2.5-4 um are outside its 2.998-14.08 um"):
        air.path(100).at([2.5, 4])


def test_a_file_of_ones_own(tmp_path):
    """A user's file may have its columns and ranges in any order."""
    path = tmp_path / "air"
    path.write_text(
        "# made by hand\ntransmittance,path_radiance_W_m2_sr_um,wavelength_um,humidity,range_km\n"
        "0.25,6,4,dry,2\n0.25,6,4.1,dry,2\n0.5,4,4,dry,1\n0.5,4,4.1,dry,1\n"
    )
    air = atmosphere(path)
    assert air.ranges_m.tolist() == [1000, 2000] and air.name == str(path)
    np.testing.assert_allclose(air.path(500).transmittance, np.sqrt(0.5))
    np.testing.assert_allclose(air.path(2000).radiance, 6)
    assert atmosphere(air) is air


@pytest.mark.parametrize(
    "rows, message",
    [
        ("1,4,0.5,1\n1,4.1,-0.5,1\n", r"line 3: transmittance = -0.5; must lie in 0..1"),
        ("1,4,1.01,1\n1,4.1,0.5,1\n", "line 2: transmittance = 1.01"),
        ("1,4,0.5,1\n1,4.1,0.5,-1\n", "line 3: path_radiance_W_m2_sr_um = -1; must lie in 0..1e"),
        ("1,4,0.5,1\n1,4.1,nan,1\n", "line 3: 'nan' in column 'transmittance' is not a number"),
        ("1,4,0.5,1\n1,4,0.5,1\n", "line 3: wavelength_um 4 after 4; must be rising"),
        ("1,4.1,0.5,1\n1,4,0.5,1\n", "line 3: wavelength_um 4 after 4.1"),
        (
            "1,4,0.5,1\n1,4.1,0.5,1\n2,4,0.2,1\n",
            "line 4: every range_km must have the same wavelengths",
        ),
        ("1,4,0.5\n", "line 2: 3 cells where the header names 4"),
        ("0,4,0.5,1\n0,4.1,0.5,1\n", "range_km 0"),
        ("1,4,0.5,1\n", "two rows"),
    ],
)
def test_unusable_file(tmp_path, rows, message):
    path = tmp_path / "air.csv"
    path.write_text(HEADER + rows)
    with pytest.raises(InputError, match=message):
        atmosphere(path)


def test_the_first_range_of_a_file(tmp_path):
    path = tmp_path / "air.csv"
    path.write_text(HEADER + "1,4,0.5,1\n1,4.1,0.5,1\n")
    assert atmosphere(path).ranges_m.tolist() == [1000]
    path.write_text(HEADER + "0,4,0.5,1\n0,4.1,0.5,1\n1,4,0.4,1\n1,4.1,0.4,1\n")
    with pytest.raises(InputError, match="range_km 0; ranges must be positive"):
        atmosphere(path)


def test_unusable_choice(tmp_path):
    with pytest.raises(InputError, match="unknown atmosphere 'midlat_sumer'; known: midlat_summer"):
        atmosphere("midlat_sumer")
    with pytest.raises(InputError, match="unknown atmosphere 'xxx"):
        atmosphere("x" * 5000)  # too long to be a path
    with pytest.raises(InputError, match="missing.csv: cannot be read"):
        atmosphere(tmp_path / "missing.csv")
    with pytest.raises(InputError, match="ranges_m is for the blocks of a MODTRAN tape7 only"):
        atmosphere("us_standard", ranges_m=[1000])
    (tmp_path / "sky.csv").write_text("wavelength_um,radiance_W_m2_sr_um\n3,1\n4,1\n")
    with pytest.raises(
        InputError,
        match="must name wavelength_um, range_km, transmittance and path_radiance_W_m2_sr_um",
    ):
        atmosphere(tmp_path / "sky.csv")


# Of a tape7


def test_ranges_and_bands_make_one_atmosphere(file):
    """Blocks of two ranges and two bands, in any order, give one block for each range."""
    parts = [(LWIR, 0.3, 3.0), (MWIR, 0.2, 1.0), (MWIR, 0.1, 3.0), (LWIR, 0.6, 1.0)]
    air = atmosphere(file(*[block(x, tau, range_km=length) for x, tau, length in parts]))
    assert air.ranges_m.tolist() == [1000, 3000] and air.transmittance.shape == (
        2,
        len(MWIR) + len(LWIR),
    )
    assert np.all(np.diff(air.wavelengths_um) > 0)
    depths = np.sqrt(np.log([0.2, 0.6]) * np.log([0.1, 0.3]))
    np.testing.assert_allclose(
        air.path(1000 * np.sqrt(3)).at([4, 10])[0], np.exp(-depths), rtol=1e-6
    )
    np.testing.assert_allclose(
        air.path(3000).at([1e4 / 2500, 1e4 / 1000])[1],
        np.array([0.9, 0.7]) * planck([2500, 1000], 280) * np.array([2500, 1000]) ** 2,
        rtol=1e-4,
    )


def test_blocks_that_share_a_wavelength_join(file):
    air = atmosphere(file(block(MWIR[:30]), block(MWIR[29:], 0.25)))
    assert len(air.wavelengths_um) == len(MWIR)


def test_ranges_that_the_file_does_not_state(file):
    for text in (
        block(MWIR, range_km=0),
        block(MWIR, itype=3),
        block(MWIR).replace("    0        0.00000", ""),
    ):
        with pytest.raises(
            InputError, match="header in line 7 .*give ranges_m of .atmosphere., one for each block"
        ):
            atmosphere(file(text))
        assert atmosphere(file(text), ranges_m=[500]).ranges_m.tolist() == [500]
    assert atmosphere(file(block(MWIR, range_km=7)), [500]).ranges_m.tolist() == [500]
    for wrong in ([1, 2], [0], 5, [np.nan]):
        with pytest.raises(InputError, match="ranges_m = .* for each of its 1 blocks"):
            atmosphere(file(block(MWIR)), wrong)


def test_slant_paths_of_several_elevations(file):
    """The line of sight chooses among them; the optical depth's logarithm is linear in the sine."""
    taus = {-30: (0.9, 0.6), 30: (0.8, 0.5), 90: (0.9, 0.7)}
    path = file(*[slant(e, tau, n + 1) for e, both in taus.items() for n, tau in enumerate(both)])
    for elevation, both in taus.items():
        air = atmosphere(path, elevation_deg=elevation)
        np.testing.assert_allclose(air.ranges_m, [1000, 2000])
        for length, tau in zip(air.ranges_m, both):
            np.testing.assert_allclose(air.path(length).transmittance, tau, rtol=1e-9)
    share = (np.sin(np.radians(50)) - 0.5) / 0.5
    depth = np.exp((1 - share) * np.log(-np.log(0.5)) + share * np.log(-np.log(0.7)))
    between = atmosphere(path, elevation_deg=50).path(2000)
    np.testing.assert_allclose(between.transmittance, np.exp(-depth), rtol=1e-9)
    np.testing.assert_allclose(
        between.radiance,
        (1 - np.exp(-depth)) * (planck(MWIR, 280) * MWIR**2)[::-1],
        rtol=2e-4,
    )
    with pytest.raises(InputError, match="elevation of -45 degrees is outside its -30..90 degrees"):
        atmosphere(path, elevation_deg=-45)
    with pytest.raises(InputError, match="has paths of 3 elevations, -30..90 degrees"):
        atmosphere(path)
    uneven = file(slant(30, 0.8, 1), slant(60, 0.8, 2))
    with pytest.raises(InputError, match="its elevations have different ranges"):
        atmosphere(uneven, elevation_deg=40)
    # Sensors at several heights see one line of sight at slightly different elevations
    near = file(slant(30, 0.8, 1), slant(30.2, 0.7, 2), slant(60, 0.9, 1), slant(60, 0.8, 2))
    assert atmosphere(near, elevation_deg=30.1).transmittance[:, 0] == pytest.approx([0.8, 0.7])
    for elevation in (29.86, 60.24):
        atmosphere(near, elevation_deg=elevation)
    for elevation in (29.84, 60.26):
        with pytest.raises(InputError, match="is outside its 30.1..60 degrees"):
            atmosphere(near, elevation_deg=elevation)
