"""Tests of mi-lcair trend: angles, output and errors."""

import json

import pytest
import xarray

from mi_lcair.cli.radiometry import Angles, Azimuths

FEW = ("--azimuth", "0:270:90", "--resolution", 8, "--spp", 2)


@pytest.mark.parametrize(
    "text, angles",
    [
        ("30", [30]),
        ("0,45,90", [0, 45, 90]),
        ("-10:30:10", [-10, 0, 10, 20, 30]),
        ("0:1:0.1", [k / 10 for k in range(11)]),
        ("0:50:20,90", [0, 20, 40, 90]),
        ("5:5:1", [5]),
    ],
)
def test_angles(text, angles):
    assert Angles().convert(text, None, None) == pytest.approx(angles, abs=1e-9)


@pytest.mark.parametrize(
    "text, count, last",
    [("0:360:2", 180, 358), ("-180:180:90", 4, 90), ("0,360,720", 1, 0), ("350:370:10", 3, 370)],
)
def test_a_whole_turn_is_no_other_azimuth(text, count, last):
    angles = Azimuths().convert(text, None, None)
    assert len(angles) == count and angles[-1] == last


@pytest.mark.slow
def test_trend(run, folder):
    result = run(
        "trend",
        "cylinder_ir_range",
        *FEW,
        "--elevation",
        "0:20:20",
        "-o",
        "t.csv",
        "-o",
        "t.png",
    )
    assert result.exit_code == 0, result.output
    *table, blank, of_band, error, followed = result.stdout.splitlines()
    assert of_band.split() == ["band", "LWIR", "8-12", "um"]
    assert [line.split()[:2] for line in table] == [["elevation", "views"], ["0", "4"], ["20", "4"]]
    assert not blank and error.startswith("error     the widest 95 % interval is +- ")
    assert followed.startswith("followed  ")
    assert sorted(file.name for file in folder.iterdir()) == ["t.csv", "t.csv.json", "t.png"]
    rows = [line for line in (folder / "t.csv").read_text().splitlines() if line[0] in "0123456789"]
    assert [tuple(map(float, row.split(",")[:2])) for row in rows] == [
        (a, e) for e in (0, 20) for a in (0, 90, 180, 270)
    ]


@pytest.mark.slow
def test_json(run):
    result = json.loads(run("trend", "cylinder_ir_range", *FEW, "-o", "t.csv", "--json").stdout)
    columns = result["columns"]
    assert (result["kind"], result["scene_name"]) == ("trend", "cylinder_ir_range")
    assert columns["azimuth_deg"] == [0, 90, 180, 270] and len(columns["intensity_W_sr"]) == 4
    assert result["tolerance"] is result["reached"] is None and columns["reached"] == [1] * 4
    assert all(
        half > error > 0
        for half, error in zip(columns["half_width_W_sr"], columns["standard_error_W_sr"])
    )


@pytest.mark.slow
def test_a_tolerance_that_was_reached_is_told(run):
    args = ("--azimuth", "0,90", "--resolution", 8, "--tolerance", "5%", "-o", "t.csv")
    error, _ = run("trend", "cylinder_ir_range", *args).stdout.splitlines()[-2:]
    start = "tolerance  5 % reached in 2 of 2 views: the widest 95 % interval is +- "
    assert error.startswith(start) and error.endswith(" % of the intensity")
    assert 0 < float(error.removeprefix(start).split()[0]) <= 5


@pytest.mark.slow
def test_a_tolerance_that_was_missed_is_told(run):
    result = run(
        "trend",
        "cylinder_ir_range",
        "--azimuth",
        "0",
        "--resolution",
        8,
        "--tolerance",
        "0.1%",
        "--max-spp",
        4,
        "-o",
        "t.csv",
    )
    error, _ = result.stdout.splitlines()[-2:]
    assert result.exit_code == 0 and error.endswith(" % of the intensity; raise --max-spp")
    assert error.startswith("tolerance  0.1 % NOT reached in 1 of 1 views: the widest")


@pytest.mark.parametrize(
    "args, message",
    [
        (("--azimuth", "0:360", "-o", "t.csv"), "no START:STOP:STEP such as 0:360:2"),
        (("--azimuth", "0:10:-1", "-o", "t.csv"), "0:10:-1"),
        (("--azimuth", "nan", "-o", "t.csv"), "'nan' is no angle"),
        (
            (
                "--azimuth",
                "0",
            ),
            "Missing option '-o'",
        ),
        (("-o", "t.csv"), "Missing option '--azimuth'"),
        (("--azimuth", "0", "-o", "t.txt"), "does not end in .csv, .nc, .png, .svg or .pdf"),
        (("--azimuth", "0", "-o", "t.csv", "--dask", "x", "--workers", 2), "give one of them"),
        (("--azimuth", "0", "-o", "no/t.csv"), "output folder 'no' does not exist"),
        (("--azimuth", "0", "-o", "t.csv", "--spp", 0), "--spp"),
        (("--azimuth", "0", "--elevation", "95", "-o", "t.csv"), "-90..90"),
        (
            ("--azimuth", "0", "--spp", 2, "--tolerance", "1%", "-o", "t.csv"),
            "cannot be combined with it",
        ),
    ],
)
def test_refused(refused, folder, args, message):
    assert message in refused("trend", "cylinder_ir_range", *args)
    assert not list(folder.iterdir())


@pytest.mark.slow
def test_netcdf(run, refused, folder):
    args = ("trend", "cylinder_ir_range", *FEW, "--elevation", "0,20", "-o", "t.nc")
    assert run(*args).exit_code == 0
    with xarray.open_dataset(folder / "t.nc") as data:
        assert data.intensity_W_sr.dims == ("elevation_deg", "azimuth_deg")
        assert data.intensity_W_sr.shape == (2, 4) and data.intensity_W_sr.units == "W sr-1"
        assert float(data.intensity_W_sr.min()) > 0
    before = (folder / "t.nc").read_bytes()
    assert "output 't.nc' exists; give --overwrite" in refused(*args)
    assert (folder / "t.nc").read_bytes() == before
    assert run(*args, "--overwrite").exit_code == 0


def test_parameters_and_sensitivities(run, refused):
    """The table of parameters, and the derivative with respect to one of a blackbody plate."""
    scene = "two_plates", "-D", "resolution=8"
    known = json.loads(run("parameters", *scene, "--json").stdout)
    assert known["plate.temperature"]["unit"] == "K"
    lines = run("parameters", *scene).stdout.splitlines()
    assert lines[0].split() == ["name", "kind", "value", "unit", "lower", "upper", "sigma"]
    assert [line.split()[0] for line in lines[1:]] == list(known)
    of_plate = json.loads(run("sensitivities", *scene, "plate.temperature", "--json").stdout)
    # All radiance is of plates at one temperature T in the band "total": dI/dT = 4 I / T
    kelvin, row = known["plate.temperature"]["value"], of_plate["derivatives"][0]
    assert row["derivative"] == pytest.approx(4 * of_plate["intensity_W_sr"] / kelvin, rel=1e-4)
    assert "plate.temperature" in run("sensitivities", *scene, "plate.temperature").stdout
    assert "unknown parameter" in refused("sensitivities", *scene, "plate.kelvin")
