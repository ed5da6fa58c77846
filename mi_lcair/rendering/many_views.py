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

# of the brightest view's intensity: a fainter view, from which nothing may be seen at all, need not
# be better known
FAINT = 1e-3


@dataclass(frozen=True)
class ManyViews:
    """Of each view (V,): `parts`, by name the intensity [W/sr] and its standard error, (2, V), and
    `brightest`, the intensity of a window full of the brightest source [W/sr].

    Names: target (all that the model sends), bounce.N, closure, group.LABEL as in
    `plugins.channels`, and hit: the model's projected area [m^2]. spp: samples per pixel; error:
    standard error of the target's intensity, including what one path may gain from a source that
    no other has met [W/sr], (V,); invalid: NaN or infinite samples, which count as 0.
    """

    parts: dict[str, np.ndarray]
    brightest: np.ndarray
    error: np.ndarray
    spp: int
    invalid: int

    def excess(self, tolerance: float) -> np.ndarray:
        """Error over what the tolerance allows: that fraction of the view's intensity, or of FAINT
        of the brightest view's; where nothing is seen, of FAINT of what a window could send.
        """
        intensity = self.parts["target"][0]
        allowed = tolerance * np.where(
            intensity > 0, np.maximum(intensity, FAINT * intensity.max()), FAINT * self.brightest
        )
        return np.divide(
            self.error, allowed, out=np.where(self.error > 0, np.inf, 0), where=allowed > 0
        )


def views_per_batch(resolution: int) -> int:
    """How many views one pass of the fewest samples holds."""
    return max(1, PASS_SAMPLES // (fewest(resolution) * resolution**2))


def fewest(resolution: int) -> int:
    """The least number of samples per pixel that tells an error: of one each, neighbouring pixels
    make a pair.
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
    """Renders what the model sends toward each view, of resolution x resolution pixels.

    spp: samples per pixel, an even number (or 1 where resolution is even); without it as many (up
    to max_spp, 65536) as every view needs for a standard error of its intensity below `tolerance`
    of it. closure = tail continues all views by one ratio. seed: a number or a numpy SeedSequence;
    the same one gives the same numbers.
    """
    check_resolution(resolution)
    least = fewest(resolution)
    if spp is not None and spp % 2 and spp != least:
        raise InputError(
            f"spp = {spp} must be {'1 or ' if least == 1 else ''}even: what is drawn twice tells the error"
        )
    check_paths(resolution**2 * len(views), spp=spp, max_spp=max_spp)
    seeds = seed if isinstance(seed, np.random.SeedSequence) else np.random.SeedSequence(seed)
    target = Target.of(scene)
    area = np.array([target.window_area(view) for view in views])
    sensor = cameras(scene, target, views, resolution)
    paths = resolution**2
    most = max(least, PASS_SAMPLES // (paths * len(views)) // 2 * 2)  # in one pass
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
            found = ManyViews(
                parts=parts,
                brightest=brightest,
                error=np.hypot(parts["target"][1], chance * area / (done * paths)),
                spp=done,
                invalid=invalid,
            )
            if spp is None:
                excess = found.excess(tolerance).max()
                goal = (
                    done
                    if excess <= 1
                    else min(limit, done + 2 * int(np.ceil(done * (growth(excess) - 1) / 2)))
                )
    return found


def in_halves(samples: Samples, spp: int, views: int, resolution: int) -> tuple[int, dict]:
    """Invalid samples, and by name the mean over each view's window and its variance, (2, V).

    A pixel's samples come in two halves, whose scatter tells the variance; what differs from pixel
    to pixel does not add to it, or, with one sample for each pixel, little: the halves are then
    neighbours.
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
