"""Write the page docs/validation/light_tree.md: draws of an emitter by a tree and by resampling.

    python -m docs.studies.light_tree [PAGE]

At RECEIVERS places that a scene's sensor sees, one of the emitting panels is drawn. The variance of
what it sends is a sum over all panels. The times are those of DRAWS draws at each place, with a ray
to the middle of the panel. The script takes a minute.
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np
from tqdm import tqdm

import mi_lcair
from benchmarks.chart import digits
from docs.studies.page import label, write_page
from mi_lcair.plugins.emission.panels import LightTree
from mi_lcair.plugins.emission.spherical_polygons import Receiver
from mi_lcair.plugins.emission.triangles import Choice, random_integer
from mi_lcair.rendering.scene import changed
from mi_lcair.rendering.views import meets_model

SCENES = [
    ("open_box", {}),
    ("furnace", {}),
    ("cavity", {}),
    ("cylinder_ir_range", {}),
    ("a340_landing", {"position": 3, "band": "LWIR"}),
]
RECEIVERS, DRAWS, ROUNDS = 256, 1024, 5
CANDIDATES = (1, 4, 16, 64)  # of resampling; one is a draw by power


def receivers(scene, repeats: int) -> Receiver:
    """Places that the sensor sees, each for a number of lanes."""
    side = int(4 * np.sqrt(RECEIVERS))
    ray, on_model = meets_model(scene, side)
    hit = scene.mi.ray_intersect(ray)
    places = np.flatnonzero(on_model.numpy())
    places = np.random.default_rng(0).choice(places, RECEIVERS)
    n = dr.select(dr.dot(hit.n, ray.d) < 0, hit.n, -hit.n)
    lanes = mi.UInt32(np.repeat(places, repeats))
    p, n = dr.gather(mi.Point3f, hit.p, lanes), dr.gather(mi.Normal3f, n, lanes)
    dr.eval(p, n)
    return Receiver(p, n)


def sent(tree: LightTree, panel: mi.UInt32, at: Receiver) -> mi.Float:
    """What panels send to receivers."""
    return tree.sent_by_panel(dr.gather(mi.UInt32, tree.leaf_of, panel), at)


@dr.syntax
def resampled(tree, by_power, at, sampler, candidates):
    """The candidate that is kept, and the mean of what candidates send over their probability."""
    probability = mi.Float(by_power.probability)
    total, kept, k = mi.Float(0), mi.UInt32(0), mi.UInt32(0)
    count = dr.opaque(mi.UInt32, candidates)
    while k < count:
        panel = by_power.pick(random_integer(sampler.next_2d()))
        weight = sent(tree, panel, at) / dr.gather(mi.Float, probability, panel)
        total += weight
        kept = dr.select(sampler.next_1d() * total < weight, panel, kept)
        k += 1
    return kept, total / count


def is_visible(scene: mi.Scene, panels, panel: mi.UInt32, at: Receiver) -> mi.Bool:
    """Whether the middles of panels are visible from receivers."""
    corners = panels.corners
    middles = np.where(
        panels.is_rectangle[:, None], corners.mean(axis=1), corners[:, :3].mean(axis=1)
    )
    middle = dr.gather(mi.Point3f, mi.Point3f(middles.T.astype(np.float32)), panel)
    return ~scene.ray_test(mi.Interaction3f(0.0, 0, [], at.p, at.n).spawn_ray_to(middle))


def draws(scene: mi.Scene, tree: LightTree, candidates: int | None) -> Callable:
    """Function of a seed: what drawn panels send, divided by their probability.

    candidates: number of panels that are drawn by power, of which one is kept; None for the tree.
    """
    at, by_power = receivers(scene, DRAWS), Choice(tree.panels.radiance * tree.panels.area)

    def run(seed: int) -> np.ndarray:
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(seed, dr.width(at.p))
        if candidates is None:
            number = mi.Float64(random_integer(sampler.next_2d())) * 2.0**-32
            panel, q = tree.draw(number, at, mi.Bool(True))
            value = dr.select(q > 0, sent(tree, panel, at) / q, 0)
        else:
            panel, value = resampled(tree, by_power, at, sampler, candidates)
        return dr.select(is_visible(scene.mi, tree.panels, panel, at), value, 0).numpy()

    return run


def variances(scene, tree: LightTree) -> np.ndarray:
    """Variance of a draw by the tree and by resampling, as multiples of the squared mean.

    With p the probability by power, f what a panel sends, V = 1 where it is visible, F = sum f and
    G = sum f V: the mean over M candidates of f / p, and the V of the kept one, are multiplied. The
    mean square is sum(f^2 V / p) / M + (1 - 1 / M) F G.
    """
    panels = tree.panels
    count = len(panels.first)
    at = receivers(scene, count)
    panel = mi.UInt32(np.tile(np.arange(count, dtype=np.uint32), RECEIVERS))
    f, q = sent(tree, panel, at), tree.probability(panel, at, mi.Bool(True))
    V = mi.Float(is_visible(scene.mi, panels, panel, at))
    f, q, V = (value.numpy().astype(float).reshape(RECEIVERS, count) for value in (f, q, V))
    power = panels.radiance * panels.area
    F, G = f.sum(axis=1), (f * V).sum(axis=1)
    square = (f**2 * V / np.where(f > 0, q, 1)).sum(axis=1)
    by_power = (f**2 * V / np.where(f > 0, power / power.sum(), 1)).sum(axis=1)
    squares = [square, *(by_power / M + (1 - 1 / M) * F * G for M in CANDIDATES)]
    return np.array([np.mean(square - G**2) for square in squares]) / G.mean() ** 2


def tree_of(scene) -> LightTree:
    """The tree of a scene's emitting meshes, by their radiances."""
    with changed(scene, emitter_sampling=True), scene.prepared() as tracer:
        choices = [table.panel_choice for table in tracer.emitters.tables]
        return LightTree(next(choice.panels for choice in choices if choice is not None))


def row(name: str, parameters: dict) -> str:
    """A scene's row: variance of a draw, and variance times time against that of the tree."""
    scene = mi_lcair.load(name, **parameters)
    tree = tree_of(scene)
    times = np.empty((1 + len(CANDIDATES), ROUNDS + 1))
    ways = [draws(scene, tree, candidates) for candidates in (None, *CANDIDATES)]
    for turn in range(ROUNDS + 1):  # the first one compiles
        for k, run in enumerate(ways):
            start = time.process_time()
            run(turn)
            times[k, turn] = time.process_time() - start
    variance = np.maximum(variances(scene, tree), 0)
    costs = variance * np.median(times[:, 1:], axis=1)
    cells = [label(name, parameters), f"{len(tree.panels.first):,}"]
    cells += [digits(value) for value in variance]
    cells += [digits(cost / costs[0]) for cost in costs[1:]]
    return f"| {' | '.join(cells)} |"


def main(page):
    """Write the page."""
    rows = [row(*case) for case in tqdm(SCENES)]
    first, *others = map(str, CANDIDATES)
    ways = [f"{first} candidate", *others]
    write_page(
        page,
        "light_tree",
        receivers=RECEIVERS,
        draws=DRAWS,
        rounds=ROUNDS,
        names=" | ".join(["variance: tree", *ways, f"variance x time: {ways[0]}", *others]),
        lines="|".join(["---"] * (1 + 2 * len(CANDIDATES))),
        rows="\n".join(rows),
    )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/validation/light_tree.md"))
