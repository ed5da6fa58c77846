"""Rays that closed scenes lose: python -m tests.stability.leaks [rays in total, 1e8]

Every ray starts on a wall or a body, is reflected by the surface's own BSDF and leaves it as in `bounce_path`. It is lost
where it hits nothing, or the back of a surface: in a closed scene of closed bodies both are impossible.
"""
import sys
from time import perf_counter

import mi_lcair  # before Dr.Jit: it chooses the LLVM
import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.emitter_table import EmitterTable

REFLECTIONS = 10
WAVEFRONT = 1_000_000

CUBE = """<scene version="3.0.0">
    <integrator type="bounce_path"/> <sensor type="orthographic"/>
    <shape type="cube">
        <boolean name="flip_normals" value="true"/> <transform name="to_world"> <scale value="{half}"/> </transform>
        <bsdf type="diffuse"> <spectrum name="reflectance" value="0.999"/> </bsdf>
        <emitter type="thermal"> <string name="band" value="LWIR"/> <float name="temperature" value="300"/> </emitter>
    </shape>
</scene>"""


def cube(folder, half=1.0):
    """A closed cube of 2 x half m, of reflectance 0.999."""
    file = folder / "cube.xml"
    file.write_text(CUBE.format(half=half))
    return mi_lcair.load(file)


def lost(scene, rays: int, seed: int = 0) -> tuple[int, int, int]:
    """Rays traced after the first hit, and how many of them hit nothing and the back of a surface.

    rays: how many paths start; each makes REFLECTIONS rays unless its BSDF absorbs it.
    """
    bounds = scene.mi.bbox()
    table = EmitterTable(scene.mi, False)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, rays)
    low, size = mi.Point3f(bounds.min), mi.Vector3f(bounds.max - bounds.min)
    start = low + size * mi.Vector3f(sampler.next_1d(), sampler.next_1d(), sampler.next_1d())
    ray = mi.Ray3f(start, mi.warp.square_to_uniform_sphere(sampler.next_2d()))
    active, counts = mi.Bool(True), np.zeros(3, dtype=np.int64)
    for reflection in range(REFLECTIONS + 1):
        si = scene.mi.ray_intersect(ray, active)
        hit, front = si.is_valid(), si.wi.z > 0
        bs, weight = si.bsdf(ray).sample(mi.BSDFContext(), si, sampler.next_1d(), sampler.next_2d(), active & hit & front)
        found = [dr.count(mask) for mask in (active, active & ~hit, active & hit & ~front)]
        active &= hit & front & (weight[0] > 0)
        ray = table.spawn_ray(si, si.to_world(bs.wo))
        dr.eval(ray, active, found, sampler)
        if reflection > 0:                      # the start may lie inside a body
            counts += [int(number[0]) for number in found]
    return tuple(counts.tolist())


def closed_scenes(folder):
    """Name -> scene."""
    return {"furnace": mi_lcair.load("furnace"), "cube": cube(folder), "cylinder_ir_range": mi_lcair.load("cylinder_ir_range")}


def main(total):
    import tempfile
    from pathlib import Path

    with tempfile.TemporaryDirectory() as folder:
        scenes = closed_scenes(Path(folder))
        for name, scene in scenes.items():
            sums, seed, start = np.zeros(3, dtype=np.int64), 1000, perf_counter()
            while sums[0] < total / len(scenes):
                sums += lost(scene, WAVEFRONT, seed)
                seed += 1
            print(f"{name}: {sums[0]:.3e} rays, {sums[1]} escaped, {sums[2]} hit a back, {perf_counter() - start:.0f} s", flush=True)


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 1e8)
