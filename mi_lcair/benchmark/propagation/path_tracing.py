"""Path tracing by `mi_lcair.signature`, with its options.

The options are the number of bounces, emitter sampling and the closure, which replaces the bounces
beyond the last one.
"""

from mi_lcair.benchmark.propagation.problem import Method, Problem
from mi_lcair.rendering.settings import changed
from mi_lcair.signatures.signature import signature


def intensity(
    problem: Problem,
    spp: int,
    seed: int,
    bounces: int | None = None,
    emitter_sampling=False,
    closure="none",
) -> tuple[float, int]:
    """Compute the intensity by path tracing.

    Parameters
    ----------
    problem
        Scene and sensor.
    spp
        Paths per pixel.
    seed
        Seed of the random numbers.
    bounces
        Reflections after which a path ends; None for those that the problem needs.
    emitter_sampling
        Whether points on emitters are sampled.
    closure
        "none", "ambient" (at the problem's own temperature) or "tail".

    Returns
    -------
    tuple[float, int]
        Intensity [W/sr], and the number of rays if every path reaches its last bounce.
    """
    bounces = problem.bounces if bounces is None else bounces
    temperature = problem.ambient if closure == "ambient" else None
    with changed(
        problem.scene,
        max_bounces=bounces,
        emitter_sampling=emitter_sampling,
        closure=closure,
        ambient_temperature=temperature,
    ):
        result = signature(problem.scene, spp=spp, seed=seed)
    part = result.target if problem.has_background else result.scene
    segments = 1 + bounces + (closure == "ambient") + (bounces if emitter_sampling else 0)
    return part.intensity, result.paths * segments


def method(name: str, applies=lambda problem: True, **options) -> Method:
    """Return path tracing with the given options of `intensity` as a method.

    applies(problem): whether the method is worth a try.
    """
    return Method(
        name,
        "",
        lambda problem, effort, seed: intensity(problem, effort, seed, **options),
        lambda problem: [4**k for k in range(7)] if applies(problem) else [],
        is_random=True,
    )


PATHS = method("path tracing")
EMITTER_SAMPLING = method("path tracing, emitter sampling", emitter_sampling=True)
AMBIENT = method(
    "path tracing, N = 1 and ambient",
    lambda problem: problem.ambient is not None,
    bounces=1,
    closure="ambient",
)
TAIL = method(
    "path tracing, N = 2 and tail", lambda problem: problem.bounces > 2, bounces=2, closure="tail"
)
