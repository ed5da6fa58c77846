"""Milliseconds of a launch of 2^12 paths, traced anew and recorded, in turn in one process.

Run from the root of the repository: python -m benchmarks.recording [SCENE ...]
"""

import sys
import time

import mi_lcair  # noqa: F401  before drjit, so that it finds the right LLVM
import drjit as dr  # isort: skip
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.paths.recording import Recorded
from mi_lcair.rendering.scene import load
from tests.plugins.paths.test_recording import sums

SCENES = {
    "two_plates": {},
    "open_box": {},
    "cavity": {},
    "cylinder_ir_range": {},
    "a340_landing": {"position": 3},
}


def launch(launcher, scene, tracer, seed):
    """Time until the call returns and until its kernels are done [ms]."""
    start = time.perf_counter()
    index = dr.arange(mi.UInt32, 2**12)
    at = mi.Point2f(index % 64 + 0.5, index // 64 + 0.5) / 64
    ray, _ = scene.sensor(0).sample_ray(0, 0, at, mi.Point2f(0.5))
    arrays = ray, dr.opaque(mi.UInt32, seed), index
    trace = sums(tracer, "target", 512)
    launcher(trace, *arrays)
    called = time.perf_counter()
    dr.sync_thread()
    return [1e3 * (end - start) for end in (called, time.perf_counter())]


for name in sys.argv[1:] or SCENES:
    scene, recorded = load(name, **SCENES[name]), Recorded()
    with scene.prepared() as tracer:
        recorded.update(tracer.scene, tracer.emitters)
        ways = {
            "traced": lambda trace, *arrays: trace(*arrays),
            "recorded": lambda trace, *arrays: recorded(trace, tracer.scene, (), *arrays),
        }
        times = {way: [] for way in ways}
        for seed in range(24):
            for way, launcher in ways.items():
                times[way].append(launch(launcher, scene, tracer, seed))
    for way, found in times.items():
        call, done = np.median(found[4:], axis=0)
        print(f"{name:18} {way:9} call {call:6.2f} ms, with its kernels {done:6.2f} ms")
