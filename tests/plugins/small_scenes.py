"""Integrators, surfaces, a camera and bundled scenes that several tests share."""

import mitsuba as mi
import numpy as np

from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from tests.plugins.conftest import FILM

SQUARE = [[-5, -5, 0], [5, -5, 0], [5, 5, 0], [-5, 5, 0]]  # m
BROAD = {"type": "sandford_robertson", "epsilon": 0.2, "rho_d": 0.1, "b": 0.5, "e": 0.3}
GREY = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.3}}
INTEGRATORS = {
    "bounce_path": {"type": "bounce_path", "max_bounces": 3},
    "bounce_path, emitter sampling": {
        "type": "bounce_path",
        "max_bounces": 3,
        "emitter_sampling": True,
    },
    "path": {"type": "path", "max_depth": 4, "rr_depth": 100},
    "prb": {"type": "prb", "max_depth": 4, "rr_depth": 100},
}

# Bundled scenes of every kind, and the parameters with which they are loaded
SCENES = {
    "two_plates": {},
    "open_box": {},
    "cavity": {},
    "furnace": {},
    "cylinder_ir_range": {},
    "a340_landing": {"position": 3},
}


def blackbody(temperature, name="LWIR"):
    return float(in_band_radiance(band(name), temperature))


def with_emitter(shape, **changes):
    return {**shape, "emitter": {**shape["emitter"], **changes}}


def camera(size=4, height=10.0, target=(0, 0, 0), origin=(0, 0, 20)):
    """Orthographic, size x size pixels over a square of that height [m]; from above unless told."""
    T = mi.ScalarTransform4f
    look = T().look_at(origin=list(origin), target=list(target), up=[0, 1, 0])
    return {
        "type": "orthographic",
        "to_world": look @ T().scale([height / 2, height / 2, 1]),
        "film": {**FILM, "width": size, "height": size},
    }


def scene(integrator, sensor, **shapes):
    return mi.load_dict(
        {"type": "scene", "integrator": integrator, "sensor": sensor, **shapes}, optimize=False
    )


def runs(scene, count, spp, first_seed=0):
    """Images of independent renders, shape (count, height, width)."""
    return np.array(
        [
            np.array(mi.render(scene, spp=spp, seed=first_seed + k), dtype=float)[..., 0]
            for k in range(count)
        ]
    )
