"""A user's table of slant paths: written from the band model and read back, unusable files."""

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.air.clear_air import clear_air
from mi_lcair.physics.air.clear_paths import ClearPaths
from mi_lcair.physics.air.slant_table import is_slant, slant_table
from mi_lcair.physics.bands import band

HEADER = (
    "elevation_deg,range_km,wavelength_um,transmittance,"
    "path_radiance_up_W_m2_sr_um,path_radiance_down_W_m2_sr_um"
)
AIR = clear_air("us_standard")


def paths(elevation, range_m):
    return [
        ClearPaths("air", AIR, 50.0, float(elevation), looks_up, range_m).path(range_m)
        for looks_up in (True, False)
    ]


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    file = tmp_path_factory.mktemp("air") / "air.csv"
    lines = [HEADER]
    for elevation in (10, 20, 40):
        for range_m in (1000.0, 2000.0, 5000.0):
            up, down = paths(elevation, range_m)
            columns = up.wavelengths_um, up.transmittance, up.radiance, down.radiance
            lines += [
                f"{elevation},{range_m / 1000},{x},{T:.9f},{L},{D}" for x, T, L, D in zip(*columns)
            ]
    file.write_text("\n".join(lines))
    assert is_slant(file) and not is_slant(file.with_name("none.csv"))
    return slant_table(file)


@pytest.mark.parametrize("looks_up", [True, False])
def test_at_an_entry_and_between_elevations(table, looks_up):
    for elevation, tolerance in ((20.0, 1e-4), (28.0, 0.01)):
        air = table.along(elevation, looks_up)
        expected = paths(elevation, 2000.0)[0 if looks_up else 1]
        for name in ("MWIR", "LWIR"):
            rule = band(name)
            for computed, wanted in (
                (air.path(2000.0).transmittance, expected.transmittance),
                (air.path(2000.0).radiance, expected.radiance),
            ):
                assert rule.integral(air.wavelengths_um, computed) == pytest.approx(
                    rule.integral(air.wavelengths_um, wanted), rel=tolerance
                )


def test_one_elevation(tmp_path):
    rows = [f"30,{R},{x},{0.9**R},1,2" for R in (1, 2) for x in (3, 4)]
    (tmp_path / "air.csv").write_text("\n".join([HEADER, *rows]))
    table = slant_table(tmp_path / "air.csv")
    assert table.along(30.0, True).path(2000.0).transmittance == pytest.approx(0.81)
    assert table.along(30.0, False).path(1000.0).radiance == pytest.approx(2)


def test_the_ends_of_the_table(table):
    """Its first and last elevation belong to it, and what rounding leaves beside them."""
    for elevation, entry in ((10.0, 10), (10 - 5e-10, 10), (40.0, 40), (40 + 5e-10, 40)):
        computed = table.along(elevation, True).path(2000.0).transmittance
        np.testing.assert_allclose(computed, paths(entry, 2000.0)[0].transmittance, atol=1e-6)
    for elevation in (10 - 2e-9, 40 + 2e-9):
        with pytest.raises(InputError, match="is outside its 10-40 degrees"):
            table.along(elevation, True)


def test_what_is_no_table_of_slant_paths(tmp_path):
    """A CSV with only one of the two columns, and a text with both."""
    for name, header in (
        ("a.csv", "elevation_deg,radiance"),
        ("b.csv", "range_km,transmittance"),
        ("c.txt", HEADER),
    ):
        (tmp_path / name).write_text(f"# measured\n{header}\n")
        assert not is_slant(tmp_path / name)


def test_outside_the_table(table):
    with pytest.raises(InputError, match="elevation of 5 degrees is outside its 10-40 degrees"):
        table.along(5.0, True)
    with pytest.raises(
        InputError, match="begin 50 m above the ground, and the line of sight at 3000"
    ):
        table.along(20.0, True, 3000.0)
    with pytest.raises(InputError, match="the line of sight at 151 m"):
        table.along(20.0, True, 151.0)
    assert table.along(20.0, True, 150.0).ranges_m.tolist() == [1000, 2000, 5000]


@pytest.mark.parametrize(
    "rows, message",
    [
        (
            "10,1,3,0.5,1,1\n10,1,4,0.5,1,1\n10,2,3,0.4,1,1",
            "line 4: every elevation_deg and range_km must have the same wavelengths",
        ),
        ("0,1,3,0.5,1,1\n0,1,4,0.5,1,1", "elevation_deg 0; must be positive"),
        ("10,0,3,0.5,1,1\n10,0,4,0.5,1,1", "range_km 0; must be positive"),
        ("10,1,3,1.02,1,1\n10,1,4,0.5,1,1", "line 2: transmittance 1.02; must lie in 0..1"),
        ("95,1,3,0.5,1,1\n95,1,4,0.5,1,1", "elevation_deg 95; must lie in 0..90"),
        (
            "10,1,3,0.5,1,1\n10,1,4,0.5,1,1\n10,2,3,0.6,1,1\n10,2,4,0.4,1,1",
            "transmittance rises from 0.5 at 1000 m to 0.6 at 2000 m",
        ),
        (
            "10,1,3,0.5,1,1\n10,1,4,0.5,1,1\n20,1,3,1,0,0\n20,1,4,0.5,1,1\n30,1,3,1,5,5\n"
            "30,1,4,0.5,1,1",
            "air.csv at 30 degrees.*the transmittance is 1 and the path radiance 5",
        ),
    ],
)
def test_unusable_files(tmp_path, rows, message):
    path = tmp_path / "air.csv"
    path.write_text(f"{HEADER}\n{rows}\n")
    assert is_slant(path)
    with pytest.raises(InputError, match=message):
        slant_table(path)
