"""Walks from a user's own file to a first result, by the commands that the commands print.

Each begins with a command of README for the user's file. The next command is the line `next: ...`
of the one before, until a command prints none.
"""

import re
import shlex
import shutil

import numpy as np
import pytest

from mi_lcair import formats
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.rendering.images.files import read_exr
from mi_lcair.scenes import FOLDER

NEXT = re.compile(r"next: mi-lcair (.*)")
MOST = 5  # commands of a walk
STOCK = (FOLDER / "examples" / "stock.xml").read_text()


@pytest.fixture
def walk(run, folder):
    """Function that walks from a command on; returns the names of the commands and all output.

    Options of `smaller`, by command, only make the test faster.
    """

    def walked(line, **smaller):
        names, output = [], ""
        while line and len(names) < MOST:
            words = shlex.split(line)
            names.append(words[0])
            result = run(*words, *smaller.get(words[0], ()))
            assert result.exit_code == 0, result.output
            output += result.output
            line = next(iter(NEXT.findall(result.output)), "")
        return names, output

    return walked


def copied(folder, *names):
    for name in names:
        shutil.copy(FOLDER / "examples" / name, folder)


@pytest.mark.slow
def test_a_model_of_blender(walk, folder):
    copied(folder, "drone.obj", "drone.csv")
    names, output = walk(
        "import drone.obj --names drone.csv --forward -Z --up Y --check",
        signature=("--spp", 4, "-D", "resolution=16"),
        render=("--spp", 2),
    )
    assert names == ["import", "import", "signature", "render", "show"] and "W/sr" in output
    assert (folder / "drone" / "model.png").is_file()


@pytest.mark.slow
def test_the_csv_of_a_scatterometer(walk, folder):
    """A spreadsheet's: semicolons, decimal commas, and an angle at which nothing was measured."""
    rows = (FOLDER / "examples" / "paint.csv").read_text().splitlines()
    rows = [row if row[0] == "#" else row.replace(",", ";").replace(".", ",") for row in rows]
    (folder / "paint.csv").write_text("\r\n".join([*rows, "1;0;", "30;-30;n/a", ""]))
    names, output = walk(
        "fit paint.csv --model sandford_robertson --starts 2 -o paint.json",
        render=("--spp", 2, "-D", "resolution=8"),
    )
    assert names == ["fit", "render", "show", "report"] and "emissivity  standard error" in output
    assert "2 without a value" in output
    assert (folder / "paint_furnace.png").is_file()


@pytest.mark.slow
def test_a_scene_of_mitsuba(walk, refused, folder):
    copied(folder, "plate.ply", "stock.xml")
    assert "mi-lcair import makes a thermal scene" in refused("render", "stock.xml", "-o", "a.exr")
    names, output = walk("import stock.xml --temperature 300 -o thermal")
    assert names == ["import", "render", "show", "report"] and "left out: constant" in output
    channels, header = read_exr("thermal.exr")
    # The plate emits 1 - 0.25 of a blackbody, and little of what it reflects is the sphere
    radiance = 0.75 * in_band_radiance(band("LWIR"), 300.0)
    assert np.median(channels["Y"][channels["range.Y"] > 0]) == pytest.approx(radiance, rel=1e-3)
    assert str(header["max_bounces"]) == "2"  # Mitsuba's max_depth counts the emitter too
    assert (folder / "thermal.png").is_file()


def test_the_image_of_a_thermograph(walk, refused, folder):
    counts = np.array([[30000, 31000], [32000, 33000]], np.uint16)  # of 0.01 K
    formats.write_tiff(folder / "seen.tif", counts)
    command = "temperature seen.tif --band LWIR --emissivity .92+-.02 --reflected 293+-2"
    assert "--scale 0.01 for counts of 0.01 K" in refused(*shlex.split(command))
    names, output = walk(f"{command} --scale .01")
    assert names == ["temperature"] * 3 and "emissivity" in output
    assert (folder / "seen_object.png").is_file()


@pytest.mark.parametrize(
    "change, message",
    [
        (("<scene", "<stage"), "is not XML"),
        (("plate.ply", "no.ply"), "file not found"),
        (('<ref id="white"/>', '<bsdf type="dielectric"/>'), "give --emissivity NUMBER"),
    ],
)
def test_scenes_that_cannot_become_thermal(refused, folder, change, message):
    copied(folder, "plate.ply")
    (folder / "a.xml").write_text(STOCK.replace(*change))
    assert message in refused("import", "a.xml", "-o", "a", "--temperature", 300)
    assert "needs -o FOLDER and --temperature" in refused("import", "a.xml", "-o", "a")
    assert "--nose cannot be combined with a scene" in refused("import", "a.xml", "--nose", "X")
    assert not (folder / "a").exists()
    (folder / "scene.xml").write_text(STOCK)
    given = ("import", "scene.xml", "--temperature")
    assert "scene.xml: exists; name another folder" in refused(*given, 300, "-o", ".")
    assert "scene.xml: exists" in refused(*given, 300, "-o", ".", "--overwrite")
    assert "-5" in refused(*given, -5, "-o", "a") and not (folder / "a").exists()
