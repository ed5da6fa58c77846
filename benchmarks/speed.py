"""Paths per second and time of derivatives against Mitsuba's own integrators."""

import time

import drjit as dr
import mitsuba as mi

import mi_lcair
from benchmarks import throughput
from benchmarks.timing import ratio

# Bundled scenes: name -> parameters and paths for each pixel
BUNDLED = {
    "cavity": ({"max_bounces": 24}, 64),
    "cylinder_ir_range": ({}, 8),
    "a340_landing": ({"position": 3, "band": "LWIR"}, 8),
}


class Throughput:
    """Speed of `bounce_path` relative to other integrators, from `benchmarks.throughput`."""

    params = ["prb_basic", "path", "ray intersection alone"]
    param_names = ["against"]
    unit = "ours / theirs"
    timeout = 900

    def setup_cache(self, **settings):
        """Ratios of one measurement by the name of the rival; all contestants run in turn."""
        ratios = {}
        for row in throughput.measure(**settings).rows:
            if row.ratio is not None:
                ratios.setdefault(row.against, row.ratio)
        return ratios

    def track_paths(self, ratios, against):
        """Ratio of our first contestant's paths per second to the rival's."""
        return ratios[against]


def track_bundled(scene, rival, spp=None, rounds=9):
    """Paths per second of `bounce_path` in a bundled scene, relative to a stock integrator.

    Both render the same loaded scene, with its sampler and its plugins, to the same number of
    reflections. `path` draws emitters, and `bounce_path` beside it does, too.
    """
    parameters, paths = BUNDLED[scene]
    loaded = mi_lcair.load(scene, **parameters).mi
    bounces = loaded.integrator().max_bounces

    def renders(kind, **options):
        integrator = mi.load_dict({"type": kind, **options})
        return lambda seed: throughput.timed(
            lambda number: integrator.render(loaded, seed=number, spp=spp or paths), seed
        )

    ours = renders("bounce_path", max_bounces=bounces, emitter_sampling=rival == "path")
    return ratio(renders(rival, max_depth=bounces + 1, rr_depth=throughput.NEVER), ours, rounds)


# Scenes of backward: parameters, paths for each pixel, and what has gradients
BACKWARD = {
    "open_box": ({}, 64, ["wall.emitter.temperature", "floor.bsdf.emissivity"]),
    "cavity": (
        {"max_bounces": 8},
        64,
        ["walls.emitter.temperature", "walls.bsdf.reflectance.value"],
    ),
    "furnace": ({"max_bounces": 8}, 16, ["room.emitter.temperature", "body.epsilon"]),
    "cylinder_ir_range": (
        {},
        8,
        ["ir_range_ir_range_wall.emissivity", "cylinder_bare_aluminum_bare_aluminum.epsilon"],
    ),
}


def backward(loaded, integrator, keys: list, spp: int):
    """A function of a seed that renders, goes back to the parameters and reads the gradients."""
    parameters = mi.traverse(loaded)

    def run(seed):
        for key in keys:
            dr.enable_grad(parameters[key])
            parameters.set_dirty(key)
        parameters.update()
        image = mi.render(loaded, parameters, integrator=integrator, spp=spp, seed=seed)
        dr.backward(dr.mean(image, axis=None))
        found = [dr.grad(parameters[key]).numpy().mean() for key in keys]
        for key in keys:
            dr.disable_grad(parameters[key])
        return found

    return run


def track_backward(scene, emitter_sampling, rounds=9):
    """Processor time of render and backward, relative to `prb_basic`, at equal reflections."""
    parameters, spp, keys = BACKWARD[scene]
    loaded = mi_lcair.load(scene, sampler="independent", **parameters).mi
    most = loaded.integrator().max_bounces
    ours = {"type": "bounce_path", "max_bounces": most, "emitter_sampling": emitter_sampling}
    theirs = {"type": "prb_basic", "max_depth": most + 1, "rr_depth": throughput.NEVER}
    runs = [backward(loaded, mi.load_dict(one), keys, spp) for one in (ours, theirs)]
    return ratio(*runs, rounds, clock=time.process_time)


track_backward.params = [list(BACKWARD), [True, False]]
track_backward.param_names = ["scene", "emitters drawn"]
track_backward.unit = "ours / theirs"
track_bundled.params = [list(BUNDLED), ["prb_basic", "path"]]
track_bundled.param_names = ["scene", "against"]
track_bundled.unit = "ours / theirs"
