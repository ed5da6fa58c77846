"""Limits of a render that are known before it starts."""

import subprocess
import sys

import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.rendering import limits
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.views import View
from tests.signatures.rendered_views import render_views

GIB = 2**30


@pytest.mark.parametrize("count", ["spp", "max_spp"])
def test_samples(count):
    scene = mi_lcair.load("two_plates", resolution=2)
    tolerance = {"tolerance": 0.1} if count == "max_spp" else {}
    for render in (mi_lcair.render, lambda s, **k: render_views(s, [View(0)], 2, Sampling(**k))):
        with pytest.raises(InputError, match=f"{count} = 4294967296 must be at most 4294967295"):
            render(scene, **{count: 2**32}, **tolerance)


def test_paths():
    """A count that a pixel may have, but not each of an image's."""
    scene = mi_lcair.load("two_plates", resolution=1024)
    with pytest.raises(
        InputError, match="spp = 2147483648 through 1048576 pixels are 2.3e\\+15 paths"
    ):
        mi_lcair.render(scene, spp=2**31)
    with pytest.raises(InputError, match="through 1048576 pixels"):
        mi_lcair.render(mi_lcair.load("two_plates", resolution=1024, spp=2**31 - 1))


def test_an_image_that_needs_too_much(monkeypatch):
    """It is refused before anything is rendered, and says how much it needs."""
    monkeypatch.setattr(limits, "available_memory", lambda: 2 * GIB)
    scene = mi_lcair.load("two_plates", resolution=20_000)
    with pytest.raises(
        InputError, match=r"400000000 pixels needs 175.1 GiB of memory, and 2.0 GiB"
    ):
        mi_lcair.render(scene, spp=1)
    assert mi_lcair.render(mi_lcair.load("two_plates", resolution=8), spp=1).mean >= 0
    with pytest.raises(InputError, match=r"1048576 pixels needs 2.3 GiB"):
        limits.check_memory(2**20, sources=400)


def test_what_is_available(tmp_path):
    """At least what a process may use, at most what the machine has."""
    available = limits.available_memory()
    assert available is None or 2**20 < available < 2**50


# VmHWM counts from the start of the program; ru_maxrss contains the memory of the process that
# started it.
CODE = """
import re
from pathlib import Path
import mi_lcair
used = []
for resolution in (724, 1024):
    scene = mi_lcair.load("two_plates", resolution=resolution)
    mi_lcair.render(scene, spp=4)
    status = Path("/proc/self/status").read_text()
    used.append(1024 * int(re.search(r"VmHWM:\\s*(\\d+) kB", status)[1]))
with scene.prepared() as tracer:
    from mi_lcair.rendering import limits
    channels = limits.channel_count(tracer, "image")
stated = limits.BYTES_PER_PIXEL + limits.BYTES_PER_CHANNEL * channels
print((used[1] - used[0]) / (1024**2 - 724**2) / stated)
"""


@pytest.mark.slow
def test_stated_memory():
    """What an image of a million pixels really takes: no more than stated, and most of it."""
    result = subprocess.run(
        [sys.executable, "-c", CODE], capture_output=True, text=True, check=True
    )
    assert 0.5 < float(result.stdout.split()[-1]) < 1.1
