"""Threads that render wait for each other: Dr.Jit cannot record in two of them."""

import subprocess
import sys

import pytest

from mi_lcair.tasks import is_traced, tracing

THREADS = """
import sys
from concurrent.futures import ThreadPoolExecutor
import mi_lcair

def loaded(): return mi_lcair.load("two_plates", resolution=8)

shared, expected = loaded(), mi_lcair.render(loaded(), spp=16).mean

def work(number):
    scene = shared if sys.argv[1] == "shared" else loaded()
    return [mi_lcair.render(scene, spp=16).mean == expected for _ in range(8)]

with ThreadPoolExecutor(3) as threads:
    print(sum(threads.map(work, range(3)), []).count(True))
"""


@pytest.mark.slow
@pytest.mark.parametrize("scenes", ["shared", "own"])
def test_three_threads(scenes):
    """One scene for all three, or one for each: every result is that of one thread."""
    done = subprocess.run(
        [sys.executable, "-c", THREADS, scenes],
        capture_output=True,
        text=True,
    )
    assert done.stdout == "24\n", done.stderr


def test_traced_plugins():
    """None outside, and the plugins of the innermost context inside."""
    assert is_traced("a") is None
    with tracing(["a"]):
        assert is_traced("a") is True and is_traced("b") is False
        with tracing(["b"]):
            assert is_traced("a") is False
        assert is_traced("a") is True
    assert is_traced("a") is None
