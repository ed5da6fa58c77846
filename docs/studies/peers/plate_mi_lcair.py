"""Radiance of a plate below a hot sphere, in mi_lcair."""

import mitsuba as mi

import mi_lcair

T = mi.ScalarTransform4f()
film = {"type": "hdrfilm", "width": 1, "height": 1, "pixel_format": "luminance"}
film |= {"rfilter": {"type": "box"}}
view = T.look_at([2, 0, 2], [0, 0, 0], [0, 1, 0]).scale([1e-4, 1e-4, 1])
thermal = {"type": "thermal", "band": "MWIR"}
scene = {
    "type": "scene",
    "integrator": {"type": "bounce_path", "max_bounces": 1},
    "sensor": {
        "type": "orthographic",
        "to_world": view,
        "film": film,
        "sampler": {"type": "lattice"},
    },
    "plate": {
        "type": "rectangle",
        "to_world": T.scale(5),
        "bsdf": {"type": "grey", "emissivity": 0.4},
        "emitter": thermal | {"temperature": 300.0},
    },
    "ball": {
        "type": "sphere",
        "center": [0, 0, 1.5],
        "radius": 0.5,
        "bsdf": {"type": "grey", "emissivity": 1.0},
        "emitter": thermal | {"temperature": 800.0},
    },
}
loaded = mi_lcair.load(mi.load_dict(scene, optimize=False))


def run(case, effort, seed):
    image = mi_lcair.render(loaded, spp=effort, seed=seed)
    return {"radiance": (image.mean, image.mean_error)}
