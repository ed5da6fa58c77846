"""Path tracing by `mi_lcair.signature`, with its options.

The options are the number of bounces, emitter sampling, the closure, which replaces the bounces
beyond the last one, and the sampler.
"""

from benchmarks.methods.propagation.problem import Method, Problem
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import changed
from mi_lcair.signatures.signature import measure_signature

EFFORTS = [4**k for k in range(3, 13)]  # numbers of paths that are tried


def intensity(
    problem: Problem,
    paths: int,
    seed: int,
    bounces: int | None = None,
    emitter_sampling=False,
    closure="none",
    sampler="lattice",
) -> tuple[float, int]:
    """Compute the intensity by path tracing.

    Parameters
    ----------
    problem
        Scene and sensor. The film of the sensor has one pixel.
    paths
        Number of paths.
    seed
        Seed of the random numbers.
    bounces
        Reflections after which a path ends; None for those that the problem needs.
    emitter_sampling
        Whether points on emitters are sampled.
    closure
        "none", "ambient" (at the problem's own temperature) or "tail".
    sampler
        "lattice" or "independent".

    Returns
    -------
    tuple[float, int]
        Intensity [W/sr], and the number of rays if every path reaches its last bounce.
    """
    scene = problem.independent if sampler == "independent" else problem.scene
    bounces = problem.bounces if bounces is None else bounces
    temperature = problem.ambient if closure == "ambient" else None
    with changed(
        scene,
        max_bounces=bounces,
        emitter_sampling=emitter_sampling,
        closure=closure,
        ambient_temperature=temperature,
    ):
        result = measure_signature(scene, Sampling(spp=paths, seed=seed))
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
        lambda problem: EFFORTS if applies(problem) else [],
    )


LATTICE = method("lattice points")
LATTICE_EMITTERS = method("lattice points, emitter sampling", emitter_sampling=True)
AMBIENT = method(
    "lattice points, N = 1 and ambient",
    lambda problem: problem.ambient is not None,
    bounces=1,
    closure="ambient",
)
TAIL = method(
    "lattice points, N = 2 and tail", lambda problem: problem.bounces > 2, bounces=2, closure="tail"
)
INDEPENDENT = method("independent points", sampler="independent")
INDEPENDENT_EMITTERS = method(
    "independent points, emitter sampling", sampler="independent", emitter_sampling=True
)
