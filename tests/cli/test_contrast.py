"""Tests of mi-lcair contrast: output, plots, and errors before anything is written."""

import json

import pytest

from tests.detection.disc_scenario import write_disc


@pytest.fixture(autouse=True)
def scenario(folder):
    write_disc(folder)


@pytest.mark.slow
def test_table(run, folder):
    result = run(
        "contrast",
        "disc.toml",
        "-D",
        "render.max_bounces=[0, 1]",
        "-D",
        "render.resolution=32",
        "-D",
        "sensor.nei=1e-7",
        "-D",
        "sensor.field_of_view_deg=2",
        "--range",
        "-o",
        "disc.png",
    )
    assert result.exit_code == 0, result.output
    lines = result.stdout.splitlines()
    assert (
        lines[0].split() == ["scenario", "disc:", "A", "disc."]
        and "blackbody at 294 K: 1.4947 W" in result.stdout
        and "mean transmittance 1.0000" in result.stdout
    )
    head = next(
        k for k, line in enumerate(lines) if line.startswith("reflections up to  intensity W/sr")
    )
    assert (
        "total W/m^2 (95 %)" in lines[head]
        and lines[head].split()[-5:] == ["max", "W/m^2", "observed", "W/m^2", "detected"]
        and lines[head + 2].startswith("1 ")
        and lines[head + 1].endswith("yes")
    )
    assert (
        lines[head + 4].endswith("for a nei of 1e-07 W/m^2 and a signal-to-noise ratio of 10")
        and " m +- " in lines[head + 6]
    )
    assert (folder / "disc.png").stat().st_size > 10_000 and "wrote disc.png" in result.stderr


def test_json(run):
    plain = [
        "contrast",
        "disc.toml",
        "-D",
        "render.resolution=8",
        "-D",
        "target.parameters.temperature=250",
        "--json",
    ]
    found = json.loads(run(*plain, "-D", "sensor.nei=1e-9", "--range").stdout)
    (row,) = found["rows"]
    assert (
        row["total_W_m2"]["value"] < 0 < row["total_W_m2"]["standard_error"]
        and row["detected"]
        and row["max_bounces"] == 1
    )
    assert (
        row["detection_range"]["intervals_m"]
        == [[pytest.approx(2.0), row["detection_range"]["largest_m"]]]
        and found["scenario"]["sensor"]["nei"] == 1e-9
    )
    assert found["tolerance"] is found["reached"] is row["reached"] is None
    assert row["half_width_W_m2"] > 2 * row["total_W_m2"]["standard_error"]
    without = json.loads(run(*plain).stdout)["rows"][0]
    assert without["detected"] is None and "detection_range" not in without


@pytest.mark.slow
def test_ranges_that_are_none_or_cut_short(run):
    common = [
        "contrast",
        "disc.toml",
        "-D",
        "render.resolution=8",
        "-D",
        "atmosphere.table=midlat_summer",
        "--range",
    ]
    assert (
        "at least: the atmosphere's table ends there"
        in run(*common, "-D", "sensor.nei=1e-15").stdout
    )
    assert run(*common, "-D", "sensor.nei=100").stdout.splitlines()[-1].split() == [
        "1",
        "no",
        "range",
    ]


def told(run, *options):
    """Line of the table that states the error of a contrast."""
    result = run("contrast", "disc.toml", "-D", "render.resolution=32", *options)
    assert result.exit_code == 0, result.output
    return next(line for line in result.stdout.splitlines() if line[:5] in ("error", "toler"))


@pytest.mark.slow
@pytest.mark.parametrize(
    "options, start, end",
    [
        (["--spp", 4], "error          the 95 % interval is +- ", " % of the contrast"),
        (
            ["--tolerance", "2%"],
            "tolerance      2 % reached: the 95 % interval is +- ",
            " % of the contrast",
        ),
        (
            ["--tolerance-W-m2", 1e-5, "-D", "render.max_bounces=[0, 1]"],
            "tolerance      1e-05 W/m^2 reached in 2 of 2 rows: the 95 % interval is +- ",
            "reflections",
        ),
        (
            ["--tolerance", "0.1%", "--max-spp", 4],
            "tolerance      0.1 % NOT reached: the 95 % interval is +- ",
            " % of the contrast; raise --max-spp",
        ),
        (
            ["--tolerance", "1%", "--max-spp", 4, "-D", "background.temperature=400"],
            "tolerance      1 % NOT reached: the 95 % interval is +- ",
            "and the contrast may be zero; give --tolerance-W-m2, because a fraction of zero "
            "cannot be reached",
        ),
        (
            ["--tolerance", "1%", "--tolerance-W-m2", 1e-6, "-D", "background.temperature=400"],
            "tolerance      1 % or 1e-06 W/m^2 reached: the 95 % interval is +- ",
            "and the contrast may be zero",
        ),
    ],
)
def test_each_contrast_says_what_it_reached(run, options, start, end):
    line = told(run, *options)
    assert line.startswith(start) and line.endswith(end), line


@pytest.mark.slow
def test_the_options_override_the_scenario(run, folder):
    """Each option replaces its entry of [render], and spp the tolerances or they it."""
    text = (folder / "disc.toml").read_text()
    (folder / "disc.toml").write_text(text + "tolerance = 0.5\n")  # in [render], the last table
    asked = lambda *options: json.loads(
        run("contrast", "disc.toml", "-D", "render.resolution=8", "--json", *options).stdout
    )["scenario"]["render"]
    entries = lambda render: tuple(
        render[name] for name in ("spp", "tolerance", "tolerance_W_m2", "max_spp")
    )
    assert entries(asked()) == (None, 0.5, None, None)
    assert entries(asked("--tolerance", "20%", "--max-spp", 9)) == (None, 0.2, None, 9)
    assert entries(asked("--tolerance-W-m2", 1)) == (None, 0.5, 1, None)
    assert entries(asked("--spp", 4)) == (4, None, None, None)
    (folder / "disc.toml").write_text(text + "spp = 4\n")
    assert entries(asked("--tolerance", "50%")) == (None, 0.5, None, None)


def test_notes_on_stderr(run):
    result = run(
        "contrast",
        "disc.toml",
        "-D",
        "render.resolution=8",
        "-D",
        "atmosphere.table=midlat_summer",
        "-D",
        "atmosphere.extrapolate=true",
        "-D",
        "observer.range_m=300000",
        "-D",
        "sensor.field_of_view_deg=0.0005",
    )
    notes = [line for line in result.stderr.splitlines() if line.startswith("mi-lcair: warning: ")]
    assert len(notes) == 2 and "300000 m is beyond" in notes[0] and "field of view" in notes[1]


@pytest.mark.parametrize(
    "options, message",
    [
        (["-D", "sensor.bnad=LWIR"], "unknown key of [sensor] 'bnad'"),
        (["-D", "observer.range_m=0"], "range_m = 0; must be positive"),
        (["-D", "observer.range_m=1"], "inside the target"),
        (["-D", "sensor.band=total"], "band total"),
        (
            ["-D", "background.sky=us_standard_clear", "-D", "sensor.band=SWIR"],
            "does not cover band SWIR",
        ),
        (
            ["-D", "atmosphere.table=midlat_summer", "-D", "sensor.band=SWIR"],
            "does not cover band SWIR",
        ),
        (
            ["-D", "atmosphere.table=midlat_summer", "-D", "observer.range_m=200001"],
            "range 200001 m is beyond",
        ),
        (["-D", "atmosphere.table=negative.csv"], "transmittance = -0.1"),
        (["-D", "sensor.response=row.csv"], "needs two rows"),
        (["--range"], "--range needs nei"),
        (["-o", "x.jpg"], "does not end in .json, .csv, .html, .png, .svg or .pdf"),
        (["-o", "none/x.png"], "does not exist"),
        (["-D", "sensor"], "key=value"),
        (["--spp", "4", "--tolerance", "1%"], "cannot be combined with it"),
        (["--spp", "4", "--max-spp", "8"], "cannot be combined with it"),
        (["--max-spp", "8"], "max_spp needs tolerance, tolerance_W_m2 or to_noise"),
        (["--tolerance", "0"], "not a fraction"),
        (["--tolerance-W-m2", "-1"], "--tolerance-W-m2"),
    ],
)
def test_refused(refused, folder, options, message):
    (folder / "row.csv").write_text("wavelength_um,response\n4,1\n")
    (folder / "negative.csv").write_text(
        "range_km,wavelength_um,transmittance,path_radiance_W_m2_sr_um\n1,2.9,0.5,0\n1,5.1,-0.1,0\n"
    )
    before = set(folder.iterdir())
    plot = [] if "-o" in options else ["-o", "out.png"]
    assert (
        message in refused("contrast", "disc.toml", *options, *plot)
        and set(folder.iterdir()) == before
    )


def test_unknown_scenario(refused):
    assert "unknown scenario 'disc'" in refused("contrast", "disc")
