"""Tests of mi-lcair image: files, tables, and errors before anything is written."""

import json
import re

import numpy as np
import pytest

import mi_lcair
from mi_lcair import formats
from mi_lcair.errors import InputError
from mi_lcair.rendering.images.files import read_exr
from tests.detection.disc_scenario import AREA, write_disc

CAMERA = """
[camera]
focal_length_mm = 100
f_number = 4
pitch_um = 15
width = 48
height = 40
integration_time_ms = 1.5
well_Me = 4.98
quantum_efficiency = 0.75
read_noise_e = 500
"""
SHORT = ("image", "disc.toml", "-o", "seen.exr", "--spp", 18)


@pytest.fixture(autouse=True)
def scenario(folder):
    file = write_disc(folder)
    file.write_text(file.read_text() + CAMERA)


@pytest.mark.slow
def test_files_and_tables(run, folder, figures):
    from PIL import Image

    result = run(*SHORT, "--frames", 3, "--seed", 5, "-o", "seen.png")
    assert result.exit_code == 0, result.output
    for text in (
        "NETD                    predicted ",
        "MTF at Nyquist          predicted 0.183, measured 0.18",
        "the same in all frames; 18 paths through a pixel",
        "with a signal-to-noise ratio of 10 and 1 pixels on the target",
    ):
        assert text in result.stdout
    ends = re.findall(r"(?:filter|pixel) up to (\d+) m, ", result.stdout)
    # A pixel of 150 urad then holds the whole disc
    assert [*map(float, ends)] == pytest.approx([AREA**0.5 / 1.5e-4] * 2, rel=1e-3)
    rows = [line.split() for line in result.stdout.splitlines()]
    heads = "range m pixels electrons snr peak snr detected lacks peak detected"
    assert heads.split() in rows
    assert any(row[-3:] == ["no", "pixels", "no"] for row in rows)
    assert "the detector is saturated in 28 % of the pixels" in result.stderr
    assert "wrote seen.tif" in result.stderr
    channels, header = read_exr(folder / "seen.exr")
    assert header["wavelengths_um"] == "3 5"  # for the title of a picture
    assert header["frames"] == 3 and header["camera_pitch_um"] == 15
    with Image.open(folder / "seen.tif") as pages:
        assert pages.n_frames == 3
        assert np.array_equal(np.array(pages), channels["counts.Y"])
        pages.seek(2)
        assert np.array(pages).dtype == np.uint16
        assert not np.array_equal(np.array(pages), channels["counts.Y"])
    with pytest.raises(InputError, match="contains a camera's counts; use the EXR"):
        mi_lcair.temperature(folder / "seen.tif", "MWIR", emissivity=1)
    assert (folder / "seen.png").stat().st_size > 10_000
    titles = [axes.get_title() for axes in figures[0].axes]
    assert "(b) MTF up to Nyquist" in titles
    assert f"(c) over range, by matched filter: detected up to {ends[0]} m" in titles


@pytest.mark.slow
def test_json_and_seed(run, folder):
    quick = (*SHORT, "--json", "-D", "camera.integration_time_ms=0.2", "-D", "camera.nuc=true")
    first = json.loads(run(*quick).stdout)
    counts = read_exr(folder / "seen.exr")[0]["counts.Y"]
    assert first["measures"]["saturated"] == 0
    assert first["scenario"]["camera"]["nuc"] is True
    rows = first["ranges"]
    for row in rows:
        lacks = [
            *(["signal to noise"] if row["snr"] < 10 else []),
            *(["pixels"] if row["pixels"] < 1 else []),
        ]
        assert row["lacks"] == " and ".join(lacks) and row["detected"] is (not lacks)
    assert {row["lacks"] for row in rows} > {"", "signal to noise and pixels"}
    again = json.loads(run(*quick).stdout)
    assert np.array_equal(read_exr(folder / "seen.exr")[0]["counts.Y"], counts)
    assert again["measures"] == first["measures"]
    run(*quick, "--seed", 1)
    assert not np.array_equal(read_exr(folder / "seen.exr")[0]["counts.Y"], counts)


@pytest.mark.parametrize(
    "arguments, text",
    [
        (("-D", "camera.focal_length_mm=0"), "focal_length_mm = 0; must be positive"),
        (("-D", "camera.pitch_um=0"), "pitch_um = 0; must be positive"),
        (("-D", "camera.well_Me=-1"), "well_Me = -1; must be positive"),
        (("-D", "camera.integration_time_ms=0"), "integration_time_ms = 0; must be positive"),
        (("-D", "camera.pitch=3"), "unknown key of [camera] 'pitch'"),
        (("-D", "observer.range_m=1.5"), "is inside the target"),
        (("--tolerance", "1%"), "--spp sets a fixed number of samples"),
        (("-o", "seen.jpg"), "output 'seen.jpg' does not end in .exr, .png, .svg or .pdf"),
    ],
)
def test_refused(refused, folder, arguments, text):
    assert text in refused(*SHORT, *arguments)
    assert not list(folder.glob("seen.*"))


def test_needs_a_camera(refused, folder):
    write_disc(folder)
    assert "has no table [camera]; give focal_length_mm" in refused(*SHORT)


def test_output_is_an_exr(refused):
    assert "does not end in .exr" in refused("image", "disc.toml", "-o", "seen.tif")


def test_tiff_that_cannot_be_written(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        formats.write_tiff(tmp_path / "no" / "frames.tif", np.zeros((1, 2, 2), dtype=np.uint16))


def test_a_solution_sets_the_target(run, folder):
    """The frame with a solution of 330 K is that of a scene of 330 K."""
    entry = {"name": "one", "scene": "disc", "parameters": {}, "band": "MWIR", "state": ""}
    entry |= {"values": {"self.temperature": 330.0}, "facets": {}}
    entry["kinds"] = {"self.temperature": "temperature"}
    content = {"kind": "mi_lcair solution", "data": [entry]}
    (folder / "solution.json").write_text(json.dumps(content))
    frames = {}
    for name, option in {
        "solved": ("--solution", "solution.json"),
        "stated": ("-D", "target.parameters.temperature=330"),
        "before": (),
    }.items():
        result = run("image", "disc.toml", "-o", f"{name}.exr", "--spp", 2, *option)
        assert result.exit_code == 0, result.output
        frames[name] = read_exr(folder / f"{name}.exr")[0]["temperature.Y"]
    np.testing.assert_array_equal(frames["solved"], frames["stated"])
    assert frames["before"].max() > frames["solved"].max() + 5


TRUTH = ("facet.png", "group.png", "material.png", "instance.png", "truth.exr", "coco.json")


@pytest.mark.slow
def test_truth(run, folder):
    """Its files are beside the image, or nothing is written."""
    result = run(*SHORT, "--truth")
    assert result.exit_code == 0, result.output
    written = {path.name for path in folder.iterdir()}
    assert {f"seen.{end}" for end in (*TRUTH, "exr", "tif", "legend.json")} <= written
    layers, header = read_exr(folder / "seen.truth.exr")
    assert layers["IndexOB.X"].max() == 1 and header["band_of_apparent"] == "MWIR 3-5 um"
    coco = json.loads((folder / "seen.coco.json").read_text())
    assert coco["images"][0]["file_name"] == "seen.truth.exr" and len(coco["annotations"]) == 3
    assert "wrote seen.coco.json" in result.stderr
    assert run("render", "open_box", "--spp", 4, "--truth", "-o", "box.exr").exit_code == 0
    assert {f"box.{end}" for end in TRUTH} <= {path.name for path in folder.iterdir()}


@pytest.mark.parametrize(
    "outputs, words",
    [
        (("a.png",), "--truth writes files next to an image; give -o FILE.exr too"),
        (("a.exr", "a.facet.png"), "output 'a.facet.png' is a file of --truth"),
        (("a.exr", "../{folder}/a.facet.png"), "a.facet.png' is a file of --truth"),
        (("a.exr", "none/b.png"), "output folder 'none' does not exist"),
    ],
)
@pytest.mark.parametrize("command", [("image", "disc.toml"), ("render", "open_box")])
def test_truth_without_a_place(run, folder, command, outputs, words):
    before, outputs = set(folder.iterdir()), [name.format(folder=folder.name) for name in outputs]
    result = run(*command, "--truth", *(word for name in outputs for word in ("-o", name)))
    assert result.exit_code == 2 and words in result.stderr and set(folder.iterdir()) == before
