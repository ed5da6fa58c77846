"""Measure the noise, the correctness and the time of derivatives of an intensity.

    python -m docs.studies.derivatives [PAGE]

The script writes docs/validation/derivatives.md from derivatives.template.md. It takes about five
minutes.
"""

import sys
from statistics import median
from time import perf_counter

import drjit as dr
import mitsuba as mi
import numpy as np
from tqdm import tqdm

import mi_lcair
from docs.studies.differences import differences
from docs.studies.page import label, write_page
from mi_lcair.api.estimates import sensitivities
from mi_lcair.api.scenes import parameters
from mi_lcair.rendering.parameters.values import parameters_named

SCENES = [
    ("cylinder_ir_range", {}),
    ("cylinder_ir_range", {"finish": "gloss_black"}),
    ("furnace", {}),
    ("a340_landing", {"position": 1}),
    ("a340_landing", {"position": 3, "band": "LWIR"}),
    ("open_box", {"reflector": "gloss_black", "band": "MWIR", "emitter_sampling": "false"}),
]
REPLAYED = 3  # scenes, from the first one on, of which the path replay is measured too
PATHS = 2**20
LEAST = 1e-6  # smallest change of the intensity of a parameter at its bound that is listed
STEP = 0.05  # step of the differences, relative to the value
SEEDS, REPLAY_PATHS = 12, 2**17  # independent runs of the path replay, and paths of each
RESOLUTION = 64
ROUNDS = 5


def materials(scene) -> list[str]:
    """Return the parameters of the materials that can change to both sides."""
    found = parameters(scene).values()
    inside = lambda p: p.lower < p.value - STEP * p.value and p.upper > p.value + STEP * p.value
    return [p.name for p in found if p.kind == "material" and p.value > 0 and inside(p)]


class Replay:
    """Derivative of an image's mean by `mi.render` and forward path replay."""

    def __init__(self, name: str, values: dict):
        self.scene = mi_lcair.load(name, resolution=RESOLUTION, sampler="independent", **values)

    def __call__(self, name: str, paths: int, seed: int) -> float:
        """The derivative with respect to a parameter of a material [W/sr]."""
        (entry,) = parameters_named(self.scene, [name])
        own = mi.traverse(entry.stored[0].node)
        key = entry.stored[0].key
        dr.enable_grad(own[key])
        own.update()
        image = mi.render(self.scene.mi, own, spp=paths // RESOLUTION**2, seed=seed)
        dr.set_grad(own[key], 1)
        dr.forward_to(image)
        found = float(np.mean(dr.grad(image).numpy()))
        dr.disable_grad(own[key])
        own.update()
        return found


def agreement(name: str, values: dict) -> list[str]:
    """Return the rows of a scene: each derivative of the target's intensity and the difference."""
    scene = mi_lcair.load(name, resolution=RESOLUTION, **values)
    entries = parameters(scene)
    names = [n for n, p in entries.items() if p.kind == "material" and p.value > 0]
    movable = [n for n in names if n in materials(scene)]
    found = sensitivities(scene, names, paths=PATHS)
    steps = [STEP * entries[n].value for n in movable]
    check = differences(scene, movable, steps, paths=PATHS, seed=1) if movable else None
    rows = []
    for k, parameter in enumerate(names):
        value, error = found.derivative[k], found.error[1 + k]
        cells = [label(name, values), parameter, f"{entries[parameter].value:.4g}"]
        # The change of the intensity for a change of the parameter by all of its value
        share = abs(value * entries[parameter].value / found.value)
        cells += [f"{value:.4g} ± {error:.1g}", f"{share:.2g}", found.method[k]]
        if parameter in movable:
            j = movable.index(parameter)
            both = np.hypot(error, check.error[1 + j])
            cells.append(f"{check.derivative[j]:.4g} ± {check.error[1 + j]:.1g}")
            cells.append(f"{abs(value - check.derivative[j]) / both:.1f}" if both > 0 else "0")
        elif share > LEAST:
            cells += ["-", "-"]
        else:
            continue  # such as the width of a lobe that reflects nothing
        rows.append(f"| {' | '.join(cells)} |")
    return rows


def seconds(function) -> float:
    start = perf_counter()
    function()
    return perf_counter() - start


def against_replay(name: str, values: dict) -> list[str]:
    """Return the rows of a scene: standard errors at PATHS paths, of the replay and of columns."""
    replay = Replay(name, values)
    scene = mi_lcair.load(name, resolution=RESOLUTION, **values)
    names = materials(scene)
    columns = lambda: sensitivities(scene, names, paths=PATHS, part="scene")
    found = columns()
    area = found.value / float(np.mean(mi.render(replay.scene.mi, spp=64)))
    times = {"columns": [], "replay": []}
    for k in range(ROUNDS):
        times["columns"].append(seconds(columns))
        times["replay"].append(seconds(lambda k=k: replay(names[-1], PATHS, k)))
    ratio = median(times["columns"]) / median(times["replay"])
    scatter = np.sqrt(np.sum(found.deviations**2, axis=1))
    rows = []
    for k, parameter in enumerate(names):
        runs = [replay(parameter, REPLAY_PATHS, seed) for seed in range(SEEDS)]
        error = area * np.std(runs, ddof=1) * np.sqrt(REPLAY_PATHS / PATHS)
        gain = (error / scatter[1 + k]) ** 2
        rows.append(
            f"| {label(name, values)} | {parameter} | {found.derivative[k]:.4g} | {error:.2g} | "
            f"{scatter[1 + k]:.2g} | {gain:.2g} | {len(names)} in {ratio:.2f} |"
        )
    return rows


def main(page="docs/validation/derivatives.md") -> None:
    rows = [row for scene in tqdm(SCENES) for row in agreement(*scene)]
    replayed = [row for scene in tqdm(SCENES[:REPLAYED]) for row in against_replay(*scene)]
    write_page(
        page,
        "derivatives",
        rows="\n".join(rows),
        replayed="\n".join(replayed),
        step=f"{STEP:.0%}",
        seeds=SEEDS,
        rounds=ROUNDS,
        threads=dr.thread_count(),
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
