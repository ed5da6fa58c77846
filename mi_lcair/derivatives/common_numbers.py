"""Repeated renders of one scene with the same paths, whose noise cancels in differences.

Derivatives in scenes with materials by wavelength are differences of such renders. The mean of the
band decides where paths go, so that a change of a spectrum keeps all paths.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from mi_lcair.derivatives.motions.pixel_step import pixel_step
from mi_lcair.rendering.measurands import Criterion, IntensityInterval, Measurands
from mi_lcair.rendering.measure import aim_at_model, measure
from mi_lcair.rendering.motions.pose import known_motions
from mi_lcair.rendering.parameters.entries import SCALED, Parameter
from mi_lcair.rendering.parameters.values import changed, parameter
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.statistics import Totals
from mi_lcair.rendering.window import Windows, window_area

PARTS = {"target": "target", "scene": None}  # channel of each part of the radiance
USED = ("bounce", "group")  # parts of the radiance that are recorded
METHOD = "difference"
TEMPERATURE_STEP = 1e-3  # step of a temperature, as a fraction of it
STEP = 0.02  # step of a radiance or an emissivity, as a fraction, and of a material's parameter
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
    sampling : Sampling
        Its tolerance is that of half of the 95 % interval of the intensity of `part`. The first
        render adds paths until it is reached. Its progress is called in each render.
    by_spectrum : bool
        Also record the emission of each source.
    part : str
        "target" or "scene".
    criterion : Criterion or None
        What the first render must meet, in place of the sampling's tolerance.

    Attributes
    ----------
    area : float
        Area of the window, m^2.
    count : int
        Number of renders so far.
    reached : bool or None
        Whether the first render met the criterion; None for a given number of paths.
    """

    def __init__(
        self,
        scene,
        sampling: Sampling,
        by_spectrum: bool = False,
        part: str = "target",
        criterion: Criterion | None = None,
    ):
        self.scene, self.part, self.by_spectrum = scene, part, by_spectrum
        self.camera = scene.sensor(sampling.sensor)
        self.area = window_area(self.camera, scene.name)
        self.windows = Windows.whole(self.camera)
        if criterion is None and sampling.tolerance is not None:
            criterion = IntensityInterval(sampling.tolerance, PARTS[part], or_whole=False)
        if criterion is None:
            sampling = sampling.settled(self.camera)
            self.windows.check(sampling)
        self.sampling, self.criterion = sampling, criterion
        self.aim, self.count, self.reached = None, 0, None

    @property
    def paths(self) -> int | None:
        """Number of paths; None until the first render has chosen it."""
        return None if self.criterion else self.windows.paths(self.sampling)

    @property
    def repeated(self) -> Sampling:
        """The sampling of another render from the same random numbers, without progress."""
        return Sampling(paths=self.paths, seed=self.sampling.seed, sensor=self.sampling.sensor)

    def render(self, values: Mapping[str, float] | None = None) -> Totals:
        """Sums over the paths, with these values of parameters in place of the scene's."""
        measurands = Measurands.of("target", self.by_spectrum, parts=USED)
        with changed(self.scene, values or {}):
            self.take_aim()
            total = measure(
                self.scene, self.windows, self.sampling, measurands, self.criterion, self.aim
            )
        if self.criterion is not None:
            self.reached, self.criterion = total.reached, None
            self.sampling = replace(
                self.sampling, tolerance=None, max_spp=None, paths=int(total.traced[0])
            )
        self.aim = total.aim
        self.count += 1
        return total

    @property
    def prefix(self) -> str:
        """Beginning of the names of the part's channels."""
        return "target." if self.part == "target" else ""

    def by_reflections(self, total: Totals) -> np.ndarray:
        """Intensity of the part by number of reflections [W/sr]."""
        names = [name for name in total.sums if name.startswith(f"{self.prefix}bounce.")]
        return total.mean(names)[:, 0] * self.area

    def take_aim(self) -> None:
        """Choose where the paths begin, if their number is known and large enough for a pilot."""
        if self.aim is None and (self.paths or 0) >= WORTH_AIMING:
            with self.scene.prepared(self.by_spectrum) as tracer:
                measurands = Measurands.of("target", parts=USED)
                self.aim = aim_at_model(
                    self.scene, tracer, self.camera, self.sampling.seed, measurands
                )


def ends(scene, name: str, sensor) -> tuple[float, float]:
    """Values above and below the present one over which a difference is taken."""
    of = parameter(scene, name)
    step = step_of(of)
    if of.kind == "motion":
        # About a quarter of a pixel: a shorter step has more noise, a longer one blurs edges
        step = pixel_step(scene, sensor, known_motions(scene)[name])
    return min(of.value + step, of.upper), max(of.value - step, of.lower)


def step_of(of: Parameter) -> float:
    if of.kind == "temperature":
        return TEMPERATURE_STEP * of.value
    if of.kind == "plugin":
        return STEP * (abs(of.value) or 1.0)
    return STEP * (of.value if of.kind in SCALED else min(of.upper - of.lower, 1.0))


def renders_beside(
    scene, name: str, windows: Windows, sampling: Sampling, measurands: Measurands, aim=None
) -> tuple[Totals, Totals, float]:
    """Renders with a parameter above and below its value, and the distance of the two values."""
    high, low = ends(scene, name, windows.sensor)
    totals = []
    for value in (high, low):
        with changed(scene, {name: value}):
            totals.append(measure(scene, windows, sampling, measurands, aim=aim))
    return *totals, high - low
