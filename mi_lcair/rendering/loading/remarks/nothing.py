"""Remarks on a scene of which the first sensor sees dark surfaces: backs, or nothing reflected."""

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.declared import percent
from mi_lcair.plugins.bsdfs.plume import is_passed
from mi_lcair.plugins.emission.emitter_table import EmitterTable

RAYS = 2**12  # rays of the first sensor that are followed to what the target reflects there
# Smallest share of the reflected light, and of all light that a surface could reflect, that is
# remarked
LEAST_SHARE, LEAST_REFLECTED = 0.05, 0.01
MOST_BEHIND = 0.5  # share of what is seen from behind that is not remarked


def random_numbers() -> np.ndarray:
    """The same for each scene, (7, RAYS)."""
    return np.random.default_rng(0).random((7, RAYS)).astype(np.float32)


def first_hits(scene: mi.Scene, emitters: EmitterTable, numbers: np.ndarray) -> tuple:
    """First hits of the first sensor's rays, their BSDFs, and which are opaque and of the model."""
    ray, _ = scene.sensors()[0].sample_ray(
        0.0, mi.Float(numbers[0]), mi.Point2f(numbers[1:3]), mi.Point2f(numbers[3:5])
    )
    si = scene.ray_intersect(ray)
    bsdf = si.bsdf(ray)
    of_model = si.is_valid() & emitters.is_model(si.emitter(scene))
    return si, bsdf, of_model & ~is_passed(bsdf.flags())


def seen_from_behind(scene: mi.Scene, emitters: EmitterTable) -> list[str]:
    """Remark on a model of which the first sensor sees mostly the backs of one-sided surfaces."""
    with dr.suspend_grad():
        si, bsdf, on_target = first_hits(scene, emitters, random_numbers())
        side = dr.select(
            si.wi.z > 0, mi.UInt32(+mi.BSDFFlags.FrontSide), mi.UInt32(+mi.BSDFFlags.BackSide)
        )
        met, behind = dr.count(on_target)[0], dr.count(on_target & (bsdf.flags() & side == 0))[0]
    if not behind > MOST_BEHIND * met:
        return []
    return [
        f"{percent(behind / met)} of what the first sensor sees of the model are backs of "
        "one-sided surfaces, which are black; turn their facets, or wrap their BSDFs in twosided"
    ]


def reflections_of_nothing(scene: mi.Scene, emitters: EmitterTable) -> list[str]:
    """Remark on rays of the first sensor whose first reflection escapes to where nothing emits.

    Without surroundings a reflecting surface is as dark as in empty space. The remark says for
    which share of the reflected light this is so.
    """
    numbers = random_numbers()
    with dr.suspend_grad():
        si, bsdf, on_target = first_hits(scene, emitters, numbers)
        sample, number = mi.Point2f(numbers[5:7]), mi.Float(numbers[0])
        bs, weight = bsdf.sample(mi.BSDFContext(), si, number, sample, on_target)
        reflected = dr.select(on_target, weight[0], 0)
        beyond = scene.ray_intersect(emitters.spawn_ray(si, si.to_world(bs.wo)), on_target)
        escapes = on_target & ~beyond.is_valid()
        if scene.environment() is not None:
            escapes &= scene.environment().eval(beyond)[0] == 0
        met, total, lost = (
            dr.sum(values)[0]
            for values in (dr.select(on_target, mi.Float(1), 0), reflected, reflected * escapes)
        )
    if not lost > max(LEAST_SHARE * total, LEAST_REFLECTED * met):
        return []
    return [
        f"{percent(lost / total)} of what the target reflects comes from nothing (0 K); an "
        "emitter sky, [surroundings] of a scenario, or sky and ground of an import surround it"
    ]
