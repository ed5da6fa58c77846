"""Intensities of a scene's model toward many observers, rendered together."""

from dataclasses import dataclass

import drjit as dr
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins.bounce_path import Samples
from mi_lcair.plugins.paths.channels import sums
from mi_lcair.rendering.limits import check_memory, check_paths
from mi_lcair.rendering.render import DEFAULT_MAX_SPP, PASS_SAMPLES, check_reachable, growth
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import check_valid
from mi_lcair.rendering.views import Target, View, cameras, check_resolution

# Views fainter than this fraction of the brightest view get an absolute tolerance: that of a view
# with this fraction of the brightest intensity.
FAINT = 1e-3


@dataclass(frozen=True)
class ManyViews:
    """Intensities of a scene's model toward V views.

    parts: intensity and its standard error by name, (2, V) [W/sr]. The names are target (the whole
    model), bounce.N, closure and group.LABEL as in `Channels.samples`, and hit, which is the
    projected area of the model [m^2]. brightest: intensity of a window filled by the brightest
    source, (V,) [W/sr]. error: standard error of the target's intensity, (V,) [W/sr]. It includes
    the contribution of one path that hits a source which no other path has hit. spp: samples per
    pixel. invalid: number of NaN or infinite samples, which count as 0.
    """

    parts: dict[str, np.ndarray]
    brightest: np.ndarray
    error: np.ndarray
    spp: int
    invalid: int

    def excess(self, tolerance: float) -> np.ndarray:
        """Ratio of each view's error to the allowed error, (V,).

        The allowed error is `tolerance` times the intensity of the view, or times FAINT of the
        brightest view if that is more. For a view of intensity 0 it is `tolerance` times FAINT of
        the intensity `brightest`.
        """
        intensity = self.parts["target"][0]
        allowed = tolerance * np.where(
            intensity > 0, np.maximum(intensity, FAINT * intensity.max()), FAINT * self.brightest
        )
        return np.divide(
            self.error, allowed, out=np.where(self.error > 0, np.inf, 0), where=allowed > 0
        )


def views_per_batch(resolution: int) -> int:
    """Number of views that one pass with the fewest samples per pixel can render."""
    return max(1, PASS_SAMPLES // (fewest(resolution) * resolution**2))


def fewest(resolution: int) -> int:
    """Smallest number of samples per pixel that gives a standard error.

    It is 1 if neighbouring pixels can be paired (even resolution), otherwise 2.
    """
    return 1 if resolution % 2 == 0 else 2


def render_views(
    scene: Scene,
    views: list[View],
    resolution: int,
    spp: int | None = None,
    tolerance: float = 0.01,
    max_spp: int | None = None,
    seed=0,
) -> ManyViews:
    """Render the intensities of the model toward some views.

    With closure = tail, all views have the same ratio of the geometric continuation.

    Parameters
    ----------
    scene : Scene
    views : list of View
    resolution : int
        Pixels along each side of a view.
    spp : int or None
        Samples per pixel: an even number, or 1 if the resolution is even. None: as many samples, up
        to max_spp, as every view needs for the tolerance.
    tolerance : float
        Largest standard error of an intensity, as a fraction of the intensity. See
        `ManyViews.excess` for faint views.
    max_spp : int or None
        Largest number of samples per pixel (65536).
    seed : int or numpy.random.SeedSequence
        The same seed gives the same results.

    Returns
    -------
    ManyViews

    Raises
    ------
    InputError
        For settings out of bounds, and for a tolerance that cannot be reached.
    """
    check_resolution(resolution)
    least = fewest(resolution)
    if spp is not None and spp % 2 and spp != least:
        raise InputError(
            f"spp = {spp} must be {'1 or ' if least == 1 else ''}even: "
            "the standard error comes from two halves of the samples"
        )
    check_paths(resolution**2 * len(views), spp=spp, max_spp=max_spp)
    seeds = seed if isinstance(seed, np.random.SeedSequence) else np.random.SeedSequence(seed)
    target = Target.of(scene)
    area = np.array([target.window_area(view) for view in views])
    sensor = cameras(scene, target, views, resolution)
    paths = resolution**2
    # Samples per pixel in one pass
    most = max(least, PASS_SAMPLES // (paths * len(views)) // 2 * 2)
    limit = spp or max(least, (max_spp or DEFAULT_MAX_SPP) // least * least)
    done, goal, invalid, totals = 0, spp or least, 0, {}
    with scene.prepared() as tracer:
        check_memory(paths * len(views) * least, tracer, "model")
        if spp is None:
            check_reachable(tolerance, tracer, scene.name)
        chance = np.full(len(views), tracer.chance_contribution(sensor))
        while done < goal:
            step = min(goal - done, most)
            step -= step % 2 if step > 1 else 0
            samples = tracer.sampled(
                sensor,
                int(seeds.spawn(1)[0].generate_state(1)[0]),
                step,
                0,
                paths * len(views),
                "model",
            )
            dr.schedule(samples.chance)
            bad, halves = in_halves(samples, step, len(views), resolution)
            invalid += bad
            if tracer.emitters.draws:
                of_views = samples.chance.numpy().reshape(resolution, len(views), -1)
                chance = np.maximum(chance, of_views.max(axis=(0, 2)))
            for name, statistics in halves.items():
                totals[name] = totals.get(name, 0.0) + statistics * [[step], [step**2]]
            done += step
            check_valid(invalid, done * paths * len(views), scene.name)
            parts = {
                name: np.array(
                    [
                        total / done,
                        np.hypot(np.sqrt(squares), tracer.systematic_error * total) / done,
                    ]
                )
                * area
                for name, (total, squares) in totals.items()
            }
            brightest = tracer.emitters.brightest * area
            result = ManyViews(
                parts=parts,
                brightest=brightest,
                error=np.hypot(parts["target"][1], chance * area / (done * paths)),
                spp=done,
                invalid=invalid,
            )
            if spp is None:
                excess = result.excess(tolerance).max()
                goal = (
                    done
                    if excess <= 1
                    else min(limit, done + 2 * int(np.ceil(done * (growth(excess) - 1) / 2)))
                )
    return result


def in_halves(samples: Samples, spp: int, views: int, resolution: int) -> tuple[int, dict]:
    """Number of invalid samples, and mean and variance over each view's window by name, (2, V).

    The samples of a pixel are divided into two halves, and the scatter of the halves gives the
    variance. Differences between pixels do not add to it. With one sample per pixel the halves are
    neighbouring pixels, and the difference between neighbours adds a little.

    Parameters
    ----------
    samples : Samples
    spp : int
        Samples per pixel of this pass.
    views : int
        Number of views V.
    resolution : int
        Pixels along each side of a view.
    """
    finite = dr.isfinite(samples.radiance)
    names = [
        name
        for name in samples.channels
        if name.startswith(("target", "bounce.", "group.", "closure", "hit"))
    ]
    values = {name: dr.select(finite, samples.channels[name], 0) for name in names}
    dr.eval(finite, values)

    def statistics(value):
        halves = sums(value, max(1, spp // 2)).reshape(resolution, views, -1, 2) / spp
        return halves.sum(axis=(0, 2, 3)) / resolution**2, (
            (halves[..., 0] - halves[..., 1]) ** 2
        ).sum(axis=(0, 2)) / resolution**4

    return int(dr.count(~finite)[0]), {
        name: np.array(statistics(value)) for name, value in values.items()
    }
