"""What can hang while Mitsuba makes the objects of a scene, in processes that can be ended."""

import subprocess
import sys

import numpy as np

from mi_lcair.rendering.images.exr import write_exr
from tests.rendering.loading.scene_text import PAINT, PATH, SENSOR, THERMAL, shape, write

ONE_THREAD = """
import sys, drjit, mi_lcair, mitsuba
drjit.set_thread_count(1)
mi_lcair.load(sys.argv[1])
print(drjit.thread_count())
"""

COLLECTING = """
import sys, drjit, mi_lcair, mitsuba as mi

class Litter(mi.BSDF):
    def __init__(self, properties):
        super().__init__(properties)
        scene = scenes.pop()
        scene.moved["itself"] = scene  # only a collection of garbage frees it
        del scene
        [[] for _ in range(100_000)]  # begins a collection

mi.register_bsdf("litter", Litter)
scenes = [mi_lcair.load("two_plates") for _ in range(8)]
drjit.set_thread_count(4)
try:
    mi_lcair.load(sys.argv[1])
except mi_lcair.InputError as error:
    print(error)
"""


def run(script, path) -> str:
    return subprocess.check_output([sys.executable, "-c", script, path], text=True)


def test_an_exr_file_with_one_thread(tmp_path):
    """Mitsuba alone would wait for ever."""
    write_exr(tmp_path / "texture.exr", {"Y": np.full((2, 2), 0.5)}, {})
    texture = (
        '<bsdf type="diffuse"> <texture type="bitmap" name="reflectance">'
        '<string name="filename" value="texture.exr"/> </texture> </bsdf>'
    )
    path = write(tmp_path, PATH, SENSOR, shape(PAINT + THERMAL), shape(texture))
    assert run(ONE_THREAD, path) == "1\n"


def test_garbage_of_scenes_while_one_is_loaded(tmp_path):
    """A thread of Mitsuba would wait for the loading thread, and that one for it."""
    littering = [shape('<bsdf type="litter"/>') for _ in range(8)]
    path = write(tmp_path, PATH, SENSOR, shape(PAINT + THERMAL), *littering)
    assert "Litter::sample" in run(COLLECTING, path)  # made, and refused only when it is used
