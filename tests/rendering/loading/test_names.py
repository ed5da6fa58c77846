"""Names of parameters: readable, and the same in every process."""

import re
import subprocess
import sys

import mitsuba as mi
import pytest

import mi_lcair
from mi_lcair import scenes
from tests.rendering.loading.scene_text import PATH, SENSOR, THERMAL, shape, write

LIST = """
import sys, mi_lcair, mitsuba as mi
from mi_lcair import scenes
spare = [mi.load_dict({"type": "sphere"}) for _ in range(int(sys.argv[1]))]  # other addresses
for file in [*map(scenes.path, scenes.names()), *sorted(scenes.FOLDER.glob("models/*/scene.xml"))]:
    print(*mi.traverse(mi_lcair.load(file).mi).keys(), sep="\\n")
"""


@pytest.mark.slow
def test_names_of_bundled_and_imported_scenes():
    lists = [
        subprocess.run(
            [sys.executable, "-c", LIST, spare],
            capture_output=True,
            text=True,
            check=True,
            cwd=scenes.FOLDER.parent,
        ).stdout
        for spare in ("0", "7")
    ]
    assert lists[0] == lists[1]
    names = lists[0].split()
    assert {"walls.emitter.temperature", "slab_left.faces", "a340.skin.face_temperature"} <= {
        *names
    }
    unreadable = [name for name in names if re.search(r"object_|__|[A-Z]|^\d|_\d{5}", name)]
    assert unreadable == []


def test_names_of_a_scene_without_ids(tmp_path):
    named = shape(THERMAL).replace("<shape ", '<shape id="rectangle_2" ')
    scene = mi_lcair.load(
        write(tmp_path, PATH, SENSOR, SENSOR, shape(THERMAL), named, shape(THERMAL))
    )
    names = {name.partition(".")[0] for name, _ in mi.traverse(scene.mi)}
    assert names >= {"sensor", "sensor_2", "rectangle", "rectangle_2", "rectangle_3"}
    assert not [name for name in names if "object" in name]
