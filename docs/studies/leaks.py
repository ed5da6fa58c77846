"""Count the rays that closed scenes lose.

    python -m docs.studies.leaks [RAYS]

RAYS is their total number, 1e8 by default. Every ray starts on a wall or a body. Its direction is
drawn by the BSDF of the surface, and it starts off the surface as in `bounce_path`. It is lost if
it hits nothing or the back of a surface. In a closed scene of closed bodies neither should happen.
"""

import sys
from time import perf_counter

import drjit as dr
import mitsuba as mi
import numpy as np

import mi_lcair  # it chooses the LLVM and must precede the use of Dr.Jit
from mi_lcair.plugins.emission.emitter_table import EmitterTable
from mi_lcair.plugins.emission.triangles import set_triangles
from mi_lcair.scenes import build_meshes

REFLECTIONS = 10  # number of reflections that each path is followed
WAVEFRONT = 1_000_000  # number of paths that are traced at the same time

CUBE = """<scene version="3.0.0">
    <integrator type="bounce_path">
        <integer name="max_bounces" value="{max_bounces}"/>
        <string name="closure" value="{closure}"/>
    </integrator>
    <sensor type="orthographic">
        <float name="near_clip" value="{near}"/> <float name="far_clip" value="{far}"/>
        <transform name="to_world">
            <scale x="{window}" y="{window}"/>
            <lookat origin="{eye}" target="0, 0, 0" up="0, 0, 1"/>
        </transform>
        <film type="hdrfilm">
            <integer name="width" value="16"/> <integer name="height" value="16"/>
            <string name="pixel_format" value="luminance"/>
            <rfilter type="box"/>
        </film>
    </sensor>
    {walls} {lid}
</scene>"""
WALL = """<shape type="ply">
        <string name="filename" value="{name}.ply"/> <boolean name="face_normals" value="true"/>
        <bsdf type="diffuse"> <spectrum name="reflectance" value="{reflectance}"/> </bsdf> {emitter}
    </shape>"""
WARM = """<emitter type="thermal">
        <string name="band" value="LWIR"/> <float name="temperature" value="300"/>
    </emitter>"""
LAMP = """<emitter type="thermal">
        <string name="band" value="LWIR"/> <float name="radiance" value="1"/>
    </emitter>"""


def cube(folder, half=1.0, reflectance=0.999, max_bounces=4, closure="none", walls=WARM, lid=WARM):
    """Load a closed diffuse cube with the sensor inside.

    Parameters
    ----------
    folder
        Folder for the files of the scene.
    half
        Half the edge of the cube [m].
    reflectance
        Reflectance of all faces.
    max_bounces, closure
        Properties of `bounce_path`.
    walls, lid
        XML of the emitter of five faces and of the sixth face, or "".
    """
    vertices, facets = build_meshes.box((2 * half,) * 3, inward=True)
    shapes = {}
    for name, chosen, emitter in (("walls", facets[1:], walls), ("lid", facets[:1], lid)):
        write_ply(folder / f"{name}.ply", vertices, chosen)
        shapes[name] = WALL.format(name=name, reflectance=reflectance, emitter=emitter)
    file = folder / "cube.xml"
    file.write_text(
        CUBE.format(
            near=1e-3 * half,
            far=10 * half,
            window=0.3 * half,
            eye=", ".join([str(0.4 * half)] * 3),
            max_bounces=max_bounces,
            closure=closure,
            **shapes,
        )
    )
    return mi_lcair.load(file)


def write_ply(path, vertices, facets):
    """Write a mesh whose facets are divided into triangles."""
    triangles, _ = build_meshes.triangles(facets)
    mesh = mi.Mesh(path.stem, len(vertices), len(triangles))
    set_triangles(mesh, np.asarray(vertices), np.asarray(triangles))
    mesh.write_ply(str(path))


def lost(scene, rays: int, seed: int = 0) -> tuple[int, int, int]:
    """Trace paths and count their rays, those that hit nothing, and those that hit a back.

    The first ray of a path is not counted. rays: number of paths; each has REFLECTIONS counted rays
    unless a BSDF absorbs it.
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
        bs, weight = si.bsdf(ray).sample(
            mi.BSDFContext(), si, sampler.next_1d(), sampler.next_2d(), active & hit & front
        )
        numbers = [dr.count(mask) for mask in (active, active & ~hit, active & hit & ~front)]
        active &= hit & front & (weight[0] > 0)
        ray = table.spawn_ray(si, si.to_world(bs.wo))
        dr.eval(ray, active, numbers, sampler)
        if reflection > 0:  # the first ray may start inside a body
            counts += [int(number[0]) for number in numbers]
    return tuple(counts.tolist())


def closed_scenes(folder):
    """Return the scenes that are tested: name -> scene."""
    return {
        "furnace": mi_lcair.load("furnace"),
        "cube": cube(folder),
        "cylinder_ir_range": mi_lcair.load("cylinder_ir_range"),
    }


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
            print(
                f"{name}: {sums[0]:.3e} rays, {sums[1]} escaped, {sums[2]} hit a back, "
                f"{perf_counter() - start:.0f} s",
                flush=True,
            )


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 1e8)
