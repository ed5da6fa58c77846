"""Tests of `show` for a facet, a table of facets, and a material."""

import json

import pytest


def written(folder):
    return sorted(
        file.name for file in folder.iterdir() if file.read_bytes().startswith(b"\x89PNG")
    )


@pytest.mark.slow
def test_facet(run, folder, figures):
    result = run("show", "two_plates", "--facet", 0, "-D", "band=LWIR")
    assert result.exit_code == 0, result.output
    rows = [line.split() for line in result.stdout.splitlines()]
    assert rows[0] == ["picture", "two_plates_facet_0.png"] and written(folder) == [
        "two_plates_facet_0.png"
    ]
    assert rows[1] == [
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
    assert [row["facet"] for row in found["neighbours"]] == [0, None]


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
        "area (m$^2$)",
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
        (["two_plates"], "give --facet N or --facets FILE.csv"),
        (["own.xml"], "give --facet N or --facets"),
        (["nowhere.xml", "--facet", "0"], "no such file"),
        (["two_plates", "--facet", "0", "-D", "bnad=LWIR"], "unknown parameter"),
        (["two_plates", "--facet", "0", "--facets", "t.csv"], "--facets does not go with --facet"),
        (["two_plates", "--facet", "0", "--log"], "--log does not go with --facet"),
        (["two_plates", "--facet", "0", "-s", "0"], "--sensor does not go with --facet"),
        (["two_plates", "--facet", "0", "-o", "a.csv"], ".png"),
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
            "--json does not go with --facets",
        ),
        (["two_plates", "--facets", "none.csv", "-c", "a"], "No such file"),
        (["diffuse"], "give its --band"),
        (["diffuse", "--band", "XWIR"], "XWIR"),
        (["difuse", "--band", "MWIR"], "'difuse' is no image (.exr), no scene"),
        (["none.json", "--band", "MWIR"], "No such file"),
        (["gloss_black", "--band", "SWIR"], "not measured for band SWIR"),
        (["diffuse", "--band", "MWIR", "--theta-deg", "90"], "--theta-deg"),
        (["diffuse", "--band", "MWIR", "-D", "a=b"], "-D does not go with a material"),
        (["image.exr", "--band", "MWIR"], "--band does not go with an image"),
    ],
)
def test_show_refuses(refused, folder, args, reason):
    (folder / "t.csv").write_text("facet,area_m2\n0,1\n")
    assert reason in refused("show", *args)
    assert [file.name for file in folder.iterdir()] == ["t.csv"]
