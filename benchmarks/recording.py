"""Milliseconds of a launch of 2^12 and of 2^6 paths, traced anew and recorded, in turn.

Run from the root of the repository: python -m benchmarks.recording [SCENE ...]

The time of this thread is the processor time of Python, of Dr.Jit, and of the share of the kernels
that the calling thread runs. A launch of 2^6 paths has next to no kernels: it takes the overhead of
Python and Dr.Jit, which does not depend on the number of paths. The last line of each scene is a
whole signature of 2^12 paths or a path for each pixel, repeated with nothing changed between.
"""

import sys
import time

import mi_lcair  # noqa: F401  before drjit, so that it finds the right LLVM

import drjit as dr  # isort: skip
import numpy as np

from mi_lcair.api.intensities import signature
from mi_lcair.plugins.paths.launch import Aim, Launch
from mi_lcair.plugins.recorders.channels import Channels
from mi_lcair.rendering.scene import load

SCENES = {
    "two_plates": {},
    "open_box": {},
    "cavity": {},
    "cylinder_ir_range": {},
    "a340_landing": {"position": 3},
}
REPETITIONS, WARM_UP = 40, 4
PATHS, RANDOMISATIONS = (2**12, 2**6), 8


def timed(run) -> list[float]:
    """Milliseconds that a function takes: of this thread, and in all."""
    dr.sync_thread()
    thread, wall = time.thread_time(), time.perf_counter()
    run()
    dr.sync_thread()
    return [1e3 * (time.thread_time() - thread), 1e3 * (time.perf_counter() - wall)]


def traced(tracer, run):
    """Run a function while launches of a tracer are not recorded."""
    reason, tracer.recorded.reason = tracer.recorded.reason, "for comparison"
    run()
    tracer.recorded.reason = reason


def main(names: list[str]) -> None:
    """Print the times of scenes, of all in SCENES if none is named."""
    for name in names or SCENES:
        scene, times = load(name, **SCENES.get(name, {})), {}
        pixels = int(np.prod(scene.sensor(0).film().crop_size()))
        with scene.prepared() as tracer:
            for seed, paths in ((seed, paths) for paths in PATHS for seed in range(REPETITIONS)):
                points = paths // RANDOMISATIONS
                launch = Launch(1, 1, seed, RANDOMISATIONS, points, aim=Aim.anywhere())
                run = lambda: tracer.trace(scene.sensor(0), launch, Channels("target"))
                anew = times.setdefault(f"{paths} paths, traced", [])
                anew.append(timed(lambda: traced(tracer, run)))
                times.setdefault(f"{paths} paths, recorded", []).append(timed(run))
        for seed in range(REPETITIONS):
            spp = max(1, PATHS[0] // pixels)
            run = lambda: signature(scene, spp=spp, seed=seed)
            times.setdefault(f"signature, {spp * pixels} paths", []).append(timed(run))
        for what, found in times.items():
            (least, _), (thread, wall) = np.min(found, axis=0), np.median(found[WARM_UP:], axis=0)
            print(
                f"{name:18} {what:24} thread {thread:6.2f} ms ({least:5.2f}), in all {wall:6.2f} ms"
            )


if __name__ == "__main__":
    main(sys.argv[1:])
