"""Renders under the settings of a plan that is given or that is made for them."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from mi_lcair.errors import InputError, unknown
from mi_lcair.planning.plan import DEFAULT_TOLERANCE, Plan, find_plan
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene


@contextmanager
def planned(
    scene: Scene, plan: Plan | str | None, each_pixel: bool, sampling: Sampling
) -> Iterator[tuple[Plan | None, Sampling]]:
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
        allowed = DEFAULT_TOLERANCE if tolerance is None else tolerance
        plan = find_plan(scene, replace(sampling, tolerance=allowed), each_pixel)
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
