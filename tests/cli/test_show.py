"""Tests of `show` for a facet, a table of facets, and a material."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from mi_lcair.rendering.images.files import write_exr


def written(folder):
    return sorted(
        file.name for file in folder.iterdir() if file.read_bytes().startswith(b"\x89PNG")
    )


@pytest.mark.slow
def test_facet(run, folder, figures):
    result = run("show", "two_plates", "--facet", 0, "-D", "band=LWIR")
    assert result.exit_code == 0, result.output
    rows = [line.split() for line in result.stdout.splitlines()]
    assert rows[1] == ["picture", "two_plates_facet_0.png"] and written(folder) == [
        "two_plates_facet_0.png"
    ]
    assert rows[0] == [
        "facet",
        "0",
        "of",
        "two_plates:",
        "model,",
        "group",
        "other,",
        "diffuse,",
        "0.02",
        "m^2",
    ]
    assert rows[4][:3] == ["1", "plate", "blackbody"] and float(rows[4][4]) == pytest.approx(
        0.1493, abs=1e-3
    )
    assert rows[5][0] == "nothing" and rows[6] == ["all", "6.283185", "1.000000"]
    assert figures[0].axes[0].get_title() == "two_plates: what facet 0 sees (group other, diffuse)"


@pytest.mark.slow
def test_facet_among_many_lists_the_largest(run):
    lines = run("show", "cavity", "--facet", 20, "-o", "v.png").stdout.splitlines()
    table = [line.split() for line in lines[4:]]
    shares = [float(row[-1]) for row in table[:20]]
    assert len(table) == 23 and shares == sorted(shares, reverse=True) and table[20][1] == "more"
    assert sum(float(row[-1]) for row in table[:22]) == pytest.approx(1, abs=1e-4)


@pytest.mark.slow
def test_facet_json(run, folder):
    found = json.loads(run("show", "open_box", "--facet", 1, "--json", "-o", "view.png").stdout)
    assert (found["file"], found["facet"], found["group"]) == ("view.png", 1, "wall") and written(
        folder
    ) == ["view.png"]
    assert found["columns"]["facet"] == [0, -1]


@pytest.mark.slow
def test_facets(run, folder, figures):
    (folder / "t.csv").write_text("facet,area_m2,mean_cosine,material\n0,0.02,1,a\n1,0.02,0.5,b\n")
    result = run(
        "show",
        "two_plates",
        "--facets",
        "t.csv",
        "-c",
        "area*",
        "-c",
        "mean_cosine",
        "-D",
        "resolution=8",
        "-s",
        0,
    )
    assert (result.exit_code, result.stdout) == (0, "t.png\n"), result.output
    panel, bar, second, second_bar = figures[0].axes
    assert (panel.get_title(), bar.get_ylabel(), second_bar.get_ylabel()) == (
        "area_m2",
        "area (m²)",
        "mean cosine",
    )
    assert panel.images[0].get_array().shape == (8, 8) and written(folder) == ["t.png"]


@pytest.mark.slow
def test_material(run, folder, figures):
    result = run("show", "bare_aluminum", "--band", "mwir", "--theta-deg", 45)
    assert (result.exit_code, result.stdout) == (0, "bare_aluminum_MWIR_45deg.png\n"), result.output
    assert written(folder) == ["bare_aluminum_MWIR_45deg.png"]
    assert (
        figures[0].get_suptitle().startswith("bare_aluminum, MWIR 3-5 um, incidence 45°: DHR 0.8")
    )


@pytest.mark.parametrize(
    "args, reason",
    [
        (
            ["two_plates", "--facet", "2"],
            "facet 2 does not exist; the facets of two_plates are numbered from 0 to 1",
        ),
        (["two_plates", "--facet", "-1"], "--facet"),
        (["two_plates", "--facet", "one"], "--facet"),
        (["two_plates", "--vmin", "1"], "--vmin cannot be combined with a scene"),
        (["own.xml"], "no such file"),
        (["nowhere.xml", "--facet", "0"], "no such file"),
        (["two_plates", "--facet", "0", "-D", "bnad=LWIR"], "unknown parameter"),
        (
            ["two_plates", "--facet", "0", "--facets", "t.csv"],
            "--facets cannot be combined with --facet",
        ),
        (["two_plates", "--facet", "0", "--log"], "--log cannot be combined with --facet"),
        (["two_plates", "--facet", "0", "-s", "0"], "--sensor cannot be combined with --facet"),
        (["two_plates", "--facet", "0", "-o", "a.csv"], "does not end in .png, .svg or .pdf"),
        (["two_plates", "--facet", "0", "-o", "nowhere/a.png"], "does not exist"),
        (["two_plates", "--facets", "t.csv"], "say which column with -c; it has facet, area_m2"),
        (
            ["two_plates", "--facets", "t.csv", "-c", "Area"],
            "unknown column of t.csv 'Area'; known: area_m2",
        ),
        (
            ["two_plates", "--facets", "t.csv", "-c", "area_m2", "-s", "1"],
            "sensor 1 does not exist",
        ),
        (
            ["two_plates", "--facets", "t.csv", "-c", "area_m2", "--json"],
            "--json cannot be combined with --facets",
        ),
        (["two_plates", "--facets", "none.csv", "-c", "a"], "No such file"),
        (["diffuse"], "give its --band"),
        (["diffuse", "--band", "XWIR"], "XWIR"),
        (["difuse", "--band", "MWIR"], "'difuse' is no image (.exr), no trend"),
        (["t.csv"], "'t.csv' is a table of facets; name its scene"),
        (["none.csv"], "No such file"),
        (["none.nc"], "cannot be read as netCDF-3"),
        (["none.obj"], "No such file"),
        (["none.toml"], "No such file"),
        (["picture.png"], "'picture.png' is no image (.exr)"),
        (["two_plates", "--facets", "t.csv", "-c", "area_m2", "--cmap", "nope"], "'nope'"),
        (["two_plates", "--facets", "t.csv", "-c", "area_m2", "--scene", "a"], "--scene cannot be"),
        (["image.exr", "--scene", "two_plates"], "--scene names the scene whose facets"),
        (["none.json", "--band", "MWIR"], "No such file"),
        (["gloss_black", "--band", "SWIR"], "not measured for band SWIR"),
        (["diffuse", "--band", "MWIR", "--theta-deg", "90"], "--theta-deg"),
        (["diffuse", "--band", "MWIR", "-D", "a=b"], "-D cannot be combined with a material"),
        (["image.exr", "--band", "MWIR"], "--band cannot be combined with an image"),
    ],
)
def test_show_refuses(refused, folder, args, reason):
    (folder / "t.csv").write_text("facet,area_m2\n0,1\n")
    assert reason in refused("show", *args)
    assert [file.name for file in folder.iterdir()] == ["t.csv"]


TREND = "azimuth_deg,elevation_deg,intensity_W_sr,group.a_W_sr\n0,0,1,1\n90,0,2,2\n180,0,3,1\n"
SPECTRUM = "wavelength_um,response,target_W_sr_um,scene_W_sr_um\n3,1,1,2\n5,1,3,4\n"
BOX = Path(__file__).parents[2] / "scenes" / "examples" / "box.obj"


@pytest.mark.slow
@pytest.mark.parametrize("text, title", [(TREND, "by elevation"), (SPECTRUM, "target: 4 W/sr")])
def test_tables(run, folder, figures, text, title):
    (folder / "t.csv").write_text(text)
    result = run("show", "t.csv", "-o", "t.svg")
    assert (result.exit_code, result.stdout) == (0, "t.svg\n"), result.output
    assert figures[0].axes[0].get_title().startswith(title)
    # The same from netCDF
    assert run("convert", "t.csv", "t.nc").exit_code == 0
    assert run("show", "t.nc", "-o", "n.svg").exit_code == 0
    assert figures[1].axes[0].get_title() == figures[0].axes[0].get_title()
    assert (folder / "n.svg").read_text().count("</text>") > 10


def test_each_kind_of_file_has_its_default_picture(run, folder, figures):
    """Files of one name and different suffixes have pictures of different names."""
    (folder / "box.csv").write_text(TREND)
    (folder / "a_spectrum.csv").write_text(SPECTRUM)
    shutil.copy(BOX, folder / "box.obj")
    write_exr("box.exr", {"temperature.Y": np.full((2, 2), 300.0), "a.Y": np.ones((2, 2))}, {})
    for name, picture in (
        ("box.csv", "box_trend.png"),
        ("a_spectrum.csv", "a_spectrum.png"),
        ("box.obj", "box_model.png"),
        ("box.exr", "box.png"),
    ):
        assert run("show", name).stdout == f"{picture}\n"
    assert figures[-1].axes[0].get_title() == "box, temperature.Y"


@pytest.mark.parametrize(
    "band, limits, title",
    [
        ("MWIR", "3 5", "plate, MWIR 3-5 um, Y"),
        ("2-5.7", "2 5.7", "plate, 2-5.7 um, Y"),
        ("total", "0.1 1000", "plate, total, Y"),
    ],
)
def test_the_title_of_an_image_has_the_unit_of_its_band(run, folder, figures, band, limits, title):
    header = {"scene": "plate", "band": band, "wavelengths_um": limits}
    write_exr("plate.exr", {"Y": np.ones((2, 2))}, header)
    run("show", "plate.exr")
    assert figures[-1].axes[0].get_title() == title


def test_two_images(run, refused, folder, figures):
    """Their difference is drawn for the channels that are named, or that both have."""
    write_exr("a.exr", {"Y": np.ones((2, 2)), "range.Y": np.ones((2, 2))}, {"scene": "box"})
    write_exr("b.exr", {"Y": np.full((2, 2), 3.0)}, {"scene": "box"})
    assert run("show", "a.exr", "b.exr").stdout == "a_b.png\n"
    assert figures[0].axes[4].get_title() == "difference.Y: mean 2, rms 2"
    assert "unknown channel of both images" in refused("show", "a.exr", "b.exr", "-c", "range.Y")
    for what in (("a.exr", "b.exr", "a.exr"), ("a.exr", "two_plates")):
        assert "show takes one WHAT, or two images" in refused("show", *what)
    assert "--outlines cannot be combined with two images" in refused(
        "show", "a.exr", "b.exr", "--outlines"
    )


@pytest.mark.slow
def test_models_and_scenes(run, folder, figures):
    """An OBJ, what import made of it, and a bundled scene."""
    assert run("show", str(BOX), "-o", "box.png").exit_code == 0
    assert run("import", str(BOX), "-o", "made").exit_code == 0
    assert run("show", "made").stdout == "made_model.png\n"
    assert run("show", "two_plates", "-o", "plates.pdf").exit_code == 0
    assert len(figures[0].axes) >= 3 and figures[0].get_suptitle() == "box.obj: 7 facets"
    assert "2 facets" in figures[-1].get_suptitle()
    assert (folder / "plates.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.slow
def test_scenario(run, folder, figures):
    slant = BOX.parent / "slant.toml"
    result = run("show", str(slant), "-D", "observer.range_m=4000")
    assert result.exit_code == 0 and "range_m = 4000" in result.stdout
    assert (
        "4000 m, azimuth 180" in figures[-1].get_suptitle()
        and (folder / "slant_scenario.png").exists()
    )


def test_a_signature_is_shown_by_report(refused, folder):
    (folder / "signature.json").write_text('{"kind": "signature"}')
    assert "'signature.json' is a signature; report shows it" in refused("show", "signature.json")


@pytest.mark.slow
def test_outlines_of_an_image(run, refused, folder, figures):
    assert (
        run("render", "two_plates", "-D", "resolution=8", "--spp", 2, "-o", "a.exr").exit_code == 0
    )
    assert run("show", "a.exr", "--outlines").exit_code == 0
    assert figures[-1].axes[0].collections and figures[-1].axes[0].get_xlabel() == "x (m)"
    assert "sensor of two_plates 9 x 9" in refused(
        "show", "a.exr", "--outlines", "-D", "resolution=9"
    )


def test_a_fit_of_one_band_needs_no_band(run, folder, figures):
    fit = {
        "band": "3-5",
        "form": "thesis",
        "model": "sandford_robertson",
        "parameters": {"epsilon": 0.3, "rho_d": 0.2, "b": 0.4, "e": 0.1},
    }
    (folder / "fit.json").write_text(json.dumps(fit))
    result = run("show", "fit.json")
    assert (result.exit_code, result.stdout) == (0, "fit_3-5_30deg.png\n"), result.output
