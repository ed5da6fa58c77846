"""Processor time of an intensity after a change of the scene, relative to that without a change.

Run from the root of the repository: python -m benchmarks.loop [SCENE ...]

Each call takes 1024 paths. Before it, `mi.traverse` and `update` set a parameter to a new number.
Calls with and without changes follow each other in turn, and a ratio is that of medians. The
time is that of the calling thread, with the update.
"""

import sys
import time

import mi_lcair

import drjit as dr  # isort: skip
import mitsuba as mi
import numpy as np

SCENES = {"open_box": {}, "cavity": {}, "a340_landing": {"band": "LWIR"}}
ENDINGS = (
    "temperature",
    "epsilon",
    "emissivity",
    "reflectance.value",
    "sensor.to_world",
    "vertex_positions",
)
RESOLUTION, ROUNDS, WARM_UP = 32, 40, 5


def changes(scene) -> dict:
    """Functions of the number of a call that change a parameter, by the end of its name."""
    parameters = mi.traverse(scene)
    names = {end: [name for name, _ in parameters if name.endswith(end)] for end in ENDINGS}
    found = {"nothing": lambda number: None}
    for ending, (key, *_) in ((end, named) for end, named in names.items() if named):
        first = type(parameters[key])(parameters[key])

        def change(number, key=key, first=first):
            if isinstance(first, mi.Transform4f):
                parameters[key] = first @ mi.Transform4f().translate([1e-4 * number, 0, 0])
            else:
                parameters[key] = first * dr.opaque(mi.Float, 1 - 1e-4 * number)
            parameters.update()

        found[ending] = change
    return found


def milliseconds(name: str, rounds: int = ROUNDS) -> dict[str, float]:
    """Median time of a call in a bundled scene, by what changes before it."""
    scene = mi_lcair.load(name, resolution=RESOLUTION, **SCENES[name])
    times, steps = {}, changes(scene)
    for number in range(1, WARM_UP + rounds + 1):
        for what, change in steps.items():
            start = time.thread_time()
            change(number)
            mi_lcair.signature(scene, spp=1, seed=number)
            times.setdefault(what, []).append(1e3 * (time.thread_time() - start))
    return {what: float(np.median(of_calls[WARM_UP:])) for what, of_calls in times.items()}


def main(names: list[str]) -> None:
    """Print the times of scenes, of all in SCENES if none is named."""
    for name in names or SCENES:
        found = milliseconds(name)
        for what, median in found.items():
            print(f"{name:14} {what:18} {median:6.2f} ms, {median / found['nothing']:.2f} times")


if __name__ == "__main__":
    main(sys.argv[1:])
