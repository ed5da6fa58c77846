"""View factors between the groups of an OBJ of quadrilaterals, in raystrack."""

from functools import cache
from pathlib import Path

import numpy as np
from raystrack import Accuracy, Channel, Mesh, Query, Sampling, Scene, SolveOptions, Solver


@cache
def solver_of(path):
    points, groups = [], {}
    for word, *words in map(str.split, Path(path).read_text().splitlines()):
        if word == "v":
            points.append([float(number) for number in words])
        elif word == "o":
            faces = groups.setdefault(words[0].partition("group=")[2], [])
        elif word == "f":
            a, b, c, d = (int(number) - 1 for number in words)
            faces += [(a, b, c), (a, c, d)]
    points = np.array(points)
    scene = Scene.from_meshes({name: Mesh(points, np.array(f)) for name, f in groups.items()})
    return Solver(scene, device="cpu", auto_tune=False), list(groups)


def run(case, effort, seed):
    solver, groups = solver_of(case)
    sampling = Sampling(density=1, rays_per_cell=effort, seed=seed)
    accuracy = Accuracy(max_replicates=8, min_replicates=8, tolerance=0)
    result = solver.solve(Query.matrix(), SolveOptions(sampling, accuracy, batch_size=2**22))
    factors = {}
    for a in groups:
        for b in groups:
            sides = [Channel("surface", b, side) for side in ("front", "back")]
            errors = [result.error(a, side) or 0.0 for side in sides]
            value = sum(result.value(a, side) or 0.0 for side in sides)
            factors[f"{a} {b}"] = value, float(np.hypot(*errors))
    return factors
