"""Repeated renders of one scene with the same paths, to compare parameters without their noise."""

from collections.abc import Callable, Mapping

import numpy as np

from mi_lcair.rendering.aiming import aim_at_model
from mi_lcair.rendering.limits import check_paths, check_positive
from mi_lcair.rendering.render import DEFAULT_MAX_SPP, check_bounded, check_reachable
from mi_lcair.rendering.statistics import Totals
from mi_lcair.rendering.window import window_area
from mi_lcair.rendering.window_means import window_means
from mi_lcair.sensitivity.parameters import changed

PARTS = {"target": "target", "scene": None}  # channel of each part of the radiance
WORTH_AIMING = 2**19  # paths from which on a pilot is traced, to aim the paths at the model


class CommonNumbers:
    """Renders of a scene's window with the same random numbers, for different parameters.

    The first render chooses the number of paths and where they begin. All later ones repeat both.
    Their random numbers are the same too, so that the difference of two renders is much better
    known than either of them.

    Parameters
    ----------
    scene : Scene
        Scene with an orthographic sensor.
    sensor : int
        Number of the sensor.
    spp, seed
        As for `signature`.
    paths : int or None
        Number of paths in place of `spp`.
    tolerance : float or None
        Allowed half of the 95 % interval of the intensity of `part`, as a fraction of it. The first
        render adds paths until it is reached.
    by_spectrum : bool
        Also record the emission of each source.
    progress : callable or None
        Called with (paths done, paths expected) in each render.
    part : str
        "target" or "scene".
    excess : callable or None
        In place of a tolerance: ratio of the error to the allowed error for the `Totals` so far.

    Attributes
    ----------
    area : float
        Area of the window, m^2.
    sources : Sources
        Sources of the last render.
    count : int
        Number of renders so far.
    reached : bool or None
        Whether the first render met the tolerance; None for a given number of paths.
    """

    def __init__(
        self,
        scene,
        sensor: int = 0,
        spp: int | None = None,
        paths: int | None = None,
        tolerance: float | None = None,
        seed: int = 0,
        by_spectrum: bool = False,
        progress=None,
        part: str = "target",
        excess: Callable[[Totals], float] | None = None,
    ):
        check_positive(spp=spp, paths=paths, tolerance=tolerance)
        self.scene, self.sensor, self.camera = scene, sensor, scene.sensor(sensor)
        self.area = window_area(self.camera, scene.name)
        self.excess = excess or (self.within_tolerance if tolerance else None)
        self.tolerance, self.part, self.seed, self.by_spectrum = tolerance, part, seed, by_spectrum
        self.pixels = int(np.prod(self.camera.film().crop_size()))
        if self.excess is None and paths is None:
            spp = spp or self.camera.sampler().sample_count()
            check_paths(self.pixels, spp=spp)
            paths = spp * self.pixels
        self.paths, self.aim, self.count, self.progress = paths, None, 0, progress
        self.reached = None

    def render(self, values: Mapping[str, float] | None = None) -> Totals:
        """Sums over the paths, with these values of parameters in place of the scene's."""
        with changed(self.scene, values or {}), self.scene.prepared(self.by_spectrum) as tracer:
            self.sources = tracer.emitters.sources
            if self.paths is None:
                check_bounded(tracer.emitters, self.scene.name)
                if self.tolerance is not None:
                    check_reachable(self.tolerance, tracer, self.scene.name, of_interval=True)
            self.take_aim(tracer)
            total = window_means(
                self.scene,
                tracer,
                self.camera,
                paths=self.paths,
                excess=self.excess,
                most_paths=DEFAULT_MAX_SPP * self.pixels,
                seed=self.seed,
                aim=self.aim,
                progress=self.progress,
            )
        if self.paths is None:
            self.paths, self.reached = int(total.traced[0]), bool(self.excess(total) <= 1)
        self.aim = total.aim
        self.count += 1
        return total

    @property
    def prefix(self) -> str:
        """Beginning of the names of the part's channels."""
        return "target." if self.part == "target" else ""

    def by_reflections(self, total: Totals) -> np.ndarray:
        """Intensity of the part by number of reflections [W/sr]."""
        count = self.scene.mi.integrator().max_bounces + 1
        names = [f"{self.prefix}bounce.{k}" for k in range(count)]
        return np.array([total.mean(n)[0] for n in names if n in total.sums]) * self.area

    def take_aim(self, tracer) -> None:
        """Choose where the paths begin, if their number is known and large enough for a pilot."""
        if self.aim is None and (self.paths or 0) >= WORTH_AIMING:
            self.aim = aim_at_model(self.scene, tracer, self.camera, self.seed, "target")

    def within_tolerance(self, total: Totals) -> float:
        """Ratio of the 95 % interval of the part's mean radiance to the tolerance."""
        name = PARTS[self.part]
        allowed = self.tolerance * total.mean(name)[0]
        return float(total.half_width(name)[0] / allowed) if allowed > 0 else np.inf
