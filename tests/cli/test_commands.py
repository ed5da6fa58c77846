"""Tests of the commands signature, scenes and show."""

import json
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import mi_lcair
from mi_lcair.rendering.images.files import write_exr

# ---- signature, scenes


def test_signature_table(run, renderer):
    result = run("signature", "two_plates", "--spp", 4)
    assert renderer.sampling["spp"] == 4
    lines = result.stdout.splitlines()
    rows = [line.split() for line in lines]
    assert "scene   22.0755 W/sr +- 0.005 (95 %), standard error 0.0021" in lines
    assert "target  11.5 W/sr +- 0.005 (95 %), standard error 0.0021" in lines
    assert "error   the 95 % interval is +- 0.043 % of the target's intensity" in lines
    assert rows[7][:6] == ["reflections", "target", "W/sr", "up", "to", "these"]
    assert ["0", "10", "+-", "0", "10", "20", "+-", "0", "20"] in rows
    assert ["1", "1.5", "+-", "0.0021", "11.5", "2.0755", "+-", "0.0021", "22.0755"] in rows
    assert ["hot", "21", "+-", "0.002", "21", "+-", "0.002"] in rows
    assert ["self", "1.0755", "+-", "0", "1.0755", "+-", "0"] in rows
    assert ["plate", "22.0755", "+-", "0.0021", "22.0755", "+-", "0.0021"] in rows


@pytest.mark.parametrize(
    "results, row",
    [
        (
            {"reached": True},
            "tolerance  1 % reached: the 95 % interval is +- 0.043 % of the target's intensity",
        ),
        (
            {"reached": False},
            "tolerance  1 % NOT reached: the 95 % interval is +- 0.043 % of the target's "
            "intensity; raise --max-spp",
        ),
        (
            {"reached": False, "half_width": 12.0},
            "tolerance  1 % NOT reached: the 95 % interval is +- 12 W/sr, and the target's "
            "intensity may be zero; raise --max-spp",
        ),
    ],
)
def test_signature_says_what_it_reached(run, renderer, results, row):
    renderer.results = results
    result = run("signature", "two_plates", "--tolerance", "1%", "--max-spp", 64)
    assert row in result.stdout.splitlines()


def test_signature_json(run, renderer):
    result = run("signature", "two_plates", "--json")
    assert (
        json.loads(result.stdout)
        == renderer.signature(
            renderer.load("two_plates"),
            False,
            False,
            progress=lambda *_: None,
            tolerance=None,
        ).as_dict()
    )


@pytest.mark.parametrize(
    "options, message",
    [
        (["--spectrum", "s.txt"], "does not end in .csv"),
        (["--facets", "f.exr"], "does not end in .csv"),
        (
            ["--spectrum", "s.csv", "--spectrum", "s.jpg"],
            "does not end in .csv, .nc, .png, .svg or .pdf",
        ),
        (["--facets", "missing/f.csv"], "does not exist"),
        (["--facets", "s.csv", "--spectrum", "s.csv"], "both name 's.csv'"),
    ],
)
def test_signature_outputs_that_cannot_be(refused, renderer, options, message):
    assert message in refused("signature", "two_plates", *options)


@pytest.mark.slow
def test_reflections_by_the_tolerance(run):
    """The box needs one; `truncation` is left as it was."""
    options = ("-D", "resolution=8", "-D", "max_bounces=3", "--tolerance", "5%", "--json")
    result = run("signature", "open_box", *options, "--max-bounces", "auto")
    assert len(json.loads(result.stdout)["target"]["by_bounce_W_sr"]) == 2
    result = run("signature", "open_box", *options, "--max-bounces", "2")
    assert len(json.loads(result.stdout)["target"]["by_bounce_W_sr"]) == 3


def test_a_number_of_reflections_that_is_none(refused):
    assert "known: auto, a whole number" in refused("signature", "cavity", "--max-bounces", "otto")


def test_a_number_of_paths_that_is_none(refused):
    assert "--spp': 'many' is not a whole number; see" in refused(
        "signature", "cavity", "--spp", "many"
    )


def test_a_limit_needs_a_tolerance(refused, renderer):
    assert "--max-spp needs --tolerance" in refused("signature", "cavity", "--max-spp", 4)


@pytest.mark.slow
def test_signature_files(run, folder):
    """A real render writes the spectrum's CSV and plot and the facets' CSV.

    Their sums are the printed intensities.
    """
    result = run(
        "signature",
        "open_box",
        "-D",
        "band=MWIR",
        "-D",
        "resolution=8",
        "--spp",
        16,
        "--spectrum",
        "s.csv",
        "--spectrum",
        "s.png",
        "--facets",
        "f.csv",
        "--json",
    )
    target = json.loads(result.stdout)["target"]["intensity_W_sr"]
    spectrum = np.loadtxt(folder / "s.csv", delimiter=",", skiprows=1)
    assert np.trapezoid(spectrum[:, 2], spectrum[:, 0]) == pytest.approx(target, rel=1e-5)
    assert len((folder / "f.csv").read_text().splitlines()) == 3 and (folder / "s.png").exists()
    assert [entry["group"] for entry in json.loads(result.stdout)["effective_areas"]] == [
        "floor",
        "wall",
    ]


@pytest.mark.slow
def test_the_files_of_one_run_appear_together(run, folder, monkeypatch):
    """None appears if the last one cannot be written."""
    from mi_lcair.signatures.facets import FacetResults

    def full(self, path):
        raise OSError(28, "No space left on device", str(path))

    monkeypatch.setattr(FacetResults, "save", full)
    files = "--spectrum", "s.csv", "--spectrum", "s.png", "--facets", "f.csv"
    result = run("signature", "open_box", "-D", "resolution=8", "-D", "band=MWIR", *files)
    assert result.exit_code == 1 and "No space left on device: 'f.csv'" in result.stderr
    assert list(folder.iterdir()) == []


@pytest.fixture
def bundled(monkeypatch):
    from mi_lcair.scenes import USD, XMLParameter

    module = ModuleType("mi_lcair.scenes")
    module.USD = USD
    module.names = lambda: ["cavity", "two_plates"]
    module.title = lambda name: f"a {name}"
    module.path = lambda name: Path("/scenes") / f"{name}.xml"
    module.parameters = lambda name: (
        {"opening": XMLParameter("8", "facets removed"), "band": XMLParameter("total", "or MWIR")}
        if name == "cavity"
        else {}
    )
    module.scenarios = lambda name: ["cavity/far"] if name == "cavity" else []
    module.scenario_title = lambda name: "a cavity, far away"
    monkeypatch.setitem(sys.modules, "mi_lcair.scenes", module)
    monkeypatch.setitem(vars(mi_lcair), "scenes", module)


def test_scenes(run, bundled):
    assert run("scenes").stdout.splitlines() == [
        "cavity: a cavity",
        "    opening=8   facets removed",
        "    band=total  or MWIR",
        "    scenario cavity/far: a cavity, far away",
        "",
        "two_plates: a two_plates",
    ]


def test_scenes_json(run, bundled):
    assert json.loads(run("scenes", "--json").stdout) == {
        "cavity": {
            "title": "a cavity",
            "path": "/scenes/cavity.xml",
            "parameters": {
                "opening": {"default": "8", "description": "facets removed"},
                "band": {"default": "total", "description": "or MWIR"},
            },
            "scenarios": {"cavity/far": "a cavity, far away"},
        },
        "two_plates": {
            "title": "a two_plates",
            "path": "/scenes/two_plates.xml",
            "parameters": {},
            "scenarios": {},
        },
    }


# ---- show


@pytest.fixture
def image():
    pixels = np.arange(12, dtype=np.float32).reshape(3, 4)
    channels = {"Y": pixels, "bounce00.Y": pixels, "bounce01.Y": pixels, "temperature.Y": pixels}
    write_exr("image.exr", channels, {"scene": "cavity", "band": "MWIR"})
    return channels


@pytest.fixture
def pictures(monkeypatch):
    """List of the pictures that show draws."""
    drawn = []
    monkeypatch.setattr(
        "mi_lcair.show.pictures.image_channels.figure",
        lambda channels, title, log, **_: (list(channels), title, log),
    )
    monkeypatch.setattr(
        "mi_lcair.cli.pictures.write_figure",
        lambda figure, path: drawn.append((str(path), *figure)),
    )
    return drawn


@pytest.mark.parametrize(
    "args, expected",
    [
        ([], ("image.png", ["Y"], "cavity, MWIR", False)),
        (
            ["-c", "temperature.Y", "-o", "t.PNG", "--log"],
            ("t.PNG", ["temperature.Y"], "cavity, MWIR", True),
        ),
        (
            ["-c", "bounce*", "-c", "*"],
            (
                "image.png",
                ["bounce00.Y", "bounce01.Y", "Y", "temperature.Y"],
                "cavity, MWIR",
                False,
            ),
        ),
    ],
)
def test_show(run, image, pictures, args, expected):
    result = run("show", "image.exr", *args)
    assert (result.exit_code, result.stdout, pictures) == (0, expected[0] + "\n", [expected])


def test_show_says_what_records_parts(run, folder):
    """Without them their channels are missing; another name is compared with the known ones."""
    write_exr("lean.exr", {"Y": np.ones((3, 4)), "range.Y": np.ones((3, 4))}, {"band": "MWIR"})
    for words in (("show", "lean.exr", "-c"), ("convert", "lean.exr", "lean.tif", "-c")):
        for name in ("bounce00.Y", "group.hot.Y", "seen.hot.Y", "closure.Y"):
            result = run(*words, name)
            assert result.exit_code == 2 and not (folder / "lean.tif").exists()
            line = f"unknown channel '{name}'; --parts of render makes it"
            assert result.stderr.strip().endswith(line)
        assert "unknown channel 'rang.Y'; known: range.Y, Y" in run(*words, "rang.Y").stderr
    assert "'bounce0[0-2].Y'; --parts" in run("show", "lean.exr", "-c", "bounce0[0-2].Y").stderr


def test_show_writes_a_picture(run, image, folder):
    assert run("show", "image.exr", "-c", "temperature.Y").exit_code == 0
    assert (folder / "image.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("channel", [(), ("-c", "R")])
def test_show_images_of_other_programs(run, refused, pictures, channel):
    """An image without a header of mi_lcair gets its file's name as the title."""
    write_exr("photo.exr", {"R": np.ones((2, 2))}, {})
    assert "unknown channel 'Y'; known: R" in refused("show", "photo.exr", "-c", "Y")
    assert run("show", "photo.exr", *channel).exit_code == 0
    assert pictures == [("photo.png", ["R"], "photo", False)]


@pytest.mark.parametrize(
    "args, reason",
    [
        (["missing.exr"], "No such file"),
        ([], "Missing argument 'WHAT'"),
        (["text.exr"], "not an OpenEXR image"),
        (
            ["image.exr", "-c", "tmperature.Y"],
            "unknown channel 'tmperature.Y'; known: temperature.Y,",
        ),
        (["image.exr", "-o", "nowhere/a.png"], "does not exist"),
        (["image.exr", "-o", "a.jpg"], ".png"),
    ],
)
def test_show_refuses(refused, image, folder, args, reason):
    (folder / "text.exr").write_text("no image")
    before = sorted(folder.iterdir())
    assert reason in refused("show", *args)
    assert sorted(folder.iterdir()) == before
