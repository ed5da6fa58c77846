"""Settings of a loaded scene that may change between renders, and how to change them."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

import mi_lcair
from mi_lcair.errors import InputError, unknown
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene

if TYPE_CHECKING:
    from mi_lcair.planning.plan import Plan

INTEGRATOR = ("max_bounces", "emitter_sampling", "closure", "ambient_temperature")


@contextmanager
def changed(
    scene: Scene, lobe: str | dict[str, str] | None = None, **settings: object
) -> Iterator[None]:
    """Context manager in which a scene has other settings; they are restored at the end.

    lobe: lobe of all reflection models, or of some materials as a dictionary (brdf, mirror or
    diffuse). settings: max_bounces, emitter_sampling, closure and ambient_temperature, the
    properties of bounce_path. Raises InputError for an unknown name, material or lobe, and for
    values that contradict each other.
    """
    integrator = scene.mi.integrator()
    for name in settings:
        if name not in INTEGRATOR:
            raise unknown("setting", name, INTEGRATOR)
    values = {name: getattr(integrator, name) for name in settings}
    # Recorded by surface, because two surfaces with the same material may have different lobes
    lobes = [(surface, surface.lobe) for surface in scene.surfaces()]
    try:
        for material, rung in (lobe if isinstance(lobe, dict) else {None: lobe}).items():
            if rung is not None:
                scene.set_lobe(rung, material)
        set_all(integrator, settings)
        integrator.check()
        yield
    finally:
        set_all(integrator, values)
        for surface, rung in lobes:
            surface.set_lobe(rung)


def set_all(integrator, values: dict) -> None:
    for name, value in values.items():
        setattr(integrator, name, value)


@contextmanager
def planned(
    scene: Scene, plan: "Plan | str | None", each_pixel: bool, sampling: Sampling
) -> Iterator[tuple["Plan | None", Sampling]]:
    """Context manager in which a scene has the settings of a plan for one render.

    It gives the plan, and the sampling with the tolerance that the plan leaves for noise. Without a
    plan it gives None and the sampling.

    Parameters
    ----------
    scene : Scene
    plan : Plan, "auto" or None
        "auto" makes a plan for the tolerance, or for 1 %.
    each_pixel : bool
        Whether the tolerance is that of the rms error over the pixels, as for `mi_lcair.plan`.
    sampling : Sampling
        That of the render.

    Raises
    ------
    InputError
        If samples are given beside the plan, or if the plan is for another tolerance.
    """
    if plan is None:
        yield None, sampling
        return
    if sampling.spp is not None:
        raise InputError("a plan chooses the samples for its tolerance; spp does not go with it")
    tolerance = sampling.tolerance
    if plan == "auto":
        plan = mi_lcair.plan(
            scene,
            0.01 if tolerance is None else tolerance,
            each_pixel,
            sampling.seed,
            sampling.sensor,
            sampling.progress,
        )
    elif isinstance(plan, str):
        raise unknown("plan", plan, ["auto", "a Plan that mi_lcair.plan returned"])
    if tolerance not in (None, plan.tolerance):
        raise InputError(
            f"the plan is for a tolerance of {plan.tolerance:g}, not for {tolerance:g}; leave the "
            "tolerance out, or make another plan"
        )
    if plan.each_pixel != each_pixel:
        raise InputError(
            f"the plan bounds the error of {'each pixel' if plan.each_pixel else 'the intensity'}; "
            f"make one with each_pixel={each_pixel}"
        )
    with plan.applied(scene):
        yield plan, replace(sampling, tolerance=plan.noise_tolerance)
