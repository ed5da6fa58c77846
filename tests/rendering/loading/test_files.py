"""Files that a scene names: only regular ones of bearable size are opened."""

import os
import subprocess
import sys
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.files import LARGEST_MESH
from mi_lcair.rendering.loading.parsing import extent, searching
from mi_lcair.rendering.views import depth
from tests.rendering.loading.scene_text import PAINT, PATH, SENSOR, THERMAL, mesh, shape, write

SCENE = (PATH, SENSOR, shape(PAINT + THERMAL))


def refused(path, message, **parameters):
    with pytest.raises(InputError, match=message) as caught:
        mi_lcair.load(path, **parameters)
    assert str(caught.value).isprintable()


NAMED = {
    "include": '<include filename="{}"/>',
    "mesh": mesh(PAINT, "{}"),
    "spectrum": shape('<bsdf type="diffuse"> <spectrum name="reflectance" filename="{}"/> </bsdf>'),
    "materials": shape(PAINT.replace("</bsdf>", '<string name="materials" value="{}"/> </bsdf>')),
    "emissivity": shape(PAINT.replace("</bsdf>", '<string name="emissivity" value="{}"/> </bsdf>')),
    "texture": shape(
        '<bsdf type="diffuse"> <texture type="bitmap" name="reflectance">'
        '<string name="filename" value="{}"/> </texture> </bsdf>'
    ),
}


@pytest.mark.parametrize("use", NAMED)
def test_pipes_and_devices(tmp_path, use):
    """Opening a pipe waits for ever; a device may never end."""
    os.mkfifo(tmp_path / "pipe.csv")
    for name in ("pipe.csv", "/dev/zero"):
        refused(write(tmp_path, *SCENE, NAMED[use].format(name)), f"{name}: is no regular file")


def test_pictures_on_one_core(tmp_path):
    """Where Dr.Jit would take one thread, Mitsuba's own functions would wait for ever.

    The thread that Dr.Jit gets for it gives way to all others.
    """
    code = f"""
import os
os.sched_setaffinity(0, {{0}})
import mi_lcair, mitsuba as mi
mi.Bitmap(mi.TensorXf([0.5] * 16, (4, 4, 1))).write({str(tmp_path / "picture.exr")!r})
print(mi.Bitmap({str(tmp_path / "picture.exr")!r}).size())
threads = map(int, os.listdir("/proc/self/task"))
print(max(os.getpriority(os.PRIO_PROCESS, thread) for thread in threads))
"""
    command = [sys.executable, "-c", code]
    assert subprocess.check_output(command, text=True) == "[4, 4]\n19\n"


def test_pipe_named_by_a_parameter(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    path = write(tmp_path, '<default name="band" value="LWIR"/>', PATH, SENSOR, shape(THERMAL))
    path.write_text(path.read_text().replace("LWIR", "$band").replace('"$band"', '"LWIR"', 1))
    assert mi_lcair.load(path)
    refused(path, "pipe.csv: is no regular file", band="pipe.csv")


def test_a_scene_that_is_a_pipe(tmp_path):
    os.mkfifo(tmp_path / "scene.xml")
    refused(tmp_path / "scene.xml", "no such file")


def test_enormous_files(tmp_path):
    """A sparse file of 20 GiB takes no room on disk, and would fill the memory."""
    with open(tmp_path / "plate.ply", "wb") as file:
        file.truncate(LARGEST_MESH + 1)
    refused(write(tmp_path, *SCENE, NAMED["mesh"].format("plate.ply")), "has 16384 MiB; at most")


def test_includes(tmp_path):
    """A file that includes itself, by itself or through another; one that includes a third."""
    refused(write(tmp_path, *SCENE, '<include filename="scene.xml"/>'), "includes itself")
    write(tmp_path, '<include filename="scene.xml"/>', name="part.xml")
    refused(write(tmp_path, *SCENE, '<include filename="part.xml"/>'), "includes itself")
    write(tmp_path, shape(PAINT), name="part.xml")
    path = write(tmp_path, *SCENE, '<include filename="part.xml"/>')
    assert len(mi_lcair.load(path).mi.shapes()) == 2


def test_includes_in_folders_of_the_scene(tmp_path):
    """Also through <path>, and the parameters of what is found there are known."""
    (tmp_path / "parts").mkdir()
    write(
        tmp_path / "parts",
        '<default name="T" value="300"/>',
        shape(PAINT + THERMAL.replace("300", "$T")),
        name="part.xml",
    )
    path = write(tmp_path, PATH, SENSOR, '<path value="parts"/>', '<include filename="part.xml"/>')
    assert mi_lcair.load(path, T=310).parameters == {"T": "310"}


@pytest.mark.parametrize(
    "content", [b"", b"\xff\xfe", b'<?xml version="1.0" encoding="nope"?><scene/>', b"<a><b></a>"]
)
def test_not_xml(tmp_path, content):
    (tmp_path / "scene.xml").write_bytes(content)
    refused(tmp_path / "scene.xml", "scene.xml: is not XML")


def test_the_present_working_folder_comes_before_that_of_the_start(tmp_path, monkeypatch):
    """Mitsuba's resolver keeps the folder in which the process started, also after a change."""
    for name in ("start", "present", "scene"):
        (tmp_path / name).mkdir()
        (tmp_path / name / f"{name}.csv").write_text(name)
    for name in ("start", "present"):
        (tmp_path / name / "paint.csv").write_text(name)
    started, resolver = mi.file_resolver(), mi.FileResolver(mi.file_resolver())
    resolver.prepend(str(tmp_path / "start"))
    mi.set_file_resolver(resolver)
    monkeypatch.chdir(tmp_path / "present")
    try:
        with searching(tmp_path / "scene"):
            found = [
                Path(str(mi.file_resolver().resolve(f"{name}.csv"))).read_text()
                for name in ("paint", "start", "scene")
            ]
    finally:
        mi.set_file_resolver(started)
    assert found == ["present", "start", "scene"]


# Shapes that Mitsuba has merged
# ------------------------------


def test_passive_rectangles_of_one_bsdf_have_an_extent():
    """`mi.load_dict` merges them into a mesh whose box is invalid, and left out of the scene's."""
    T = mi.ScalarTransform4f()
    film = {"type": "hdrfilm", "width": 4, "height": 4, "pixel_format": "luminance"}
    floor, wall = (
        {
            "type": "rectangle",
            "to_world": T.translate([0, 0, height]),
            "bsdf": {"type": "ref", "id": "grey"},
        }
        for height in (0, 2)
    )
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "bounce_path"},
            "sensor": {"type": "perspective", "film": film},
            "grey": {"type": "grey", "emissivity": 0.3},
            "floor": floor,
            "wall": wall,
            "lamp": {
                "type": "rectangle",
                "to_world": T.translate([0, 0, 1]),
                "emitter": {"type": "thermal", "temperature": 300.0, "band": "LWIR"},
            },
        }
    )
    assert len(scene.shapes()) == 2
    loaded = mi_lcair.load(scene)
    np.testing.assert_allclose(extent(loaded.mi), [[-1, -1, 0], [1, 1, 2]])
    assert depth(loaded) == pytest.approx(2 * np.sqrt(12), rel=1e-12)
