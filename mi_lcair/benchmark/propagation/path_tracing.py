"""Bounce-limited path tracing, `mi_lcair.render` with its options: emitter sampling, and what
stands in for later bounces.
"""

from mi_lcair.benchmark.propagation.problem import Method, Problem
from mi_lcair.rendering.render import render
from mi_lcair.rendering.settings import changed


def intensity(
    problem: Problem,
    spp: int,
    seed: int,
    bounces: int | None = None,
    emitter_sampling=False,
    closure="none",
) -> tuple[float, int]:
    """Intensity [W/sr] from so many paths a pixel, and the most rays that these can take.

    bounces: as many as the problem needs unless told. closure: none, ambient (at the problem's own
    temperature) or tail.
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
        image = render(
            problem.scene, spp=spp, seed=seed, split="target" if problem.has_background else None
        )
    mean = image.parts["target"][0] if problem.has_background else image.mean
    segments = 1 + bounces + (closure == "ambient") + (bounces if emitter_sampling else 0)
    return mean * problem.window_area, image.paths * segments


def method(name: str, applies=lambda problem: True, **options) -> Method:
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
