"""Repeated renders of one scene with the same paths, whose noise cancels in differences.

Derivatives in scenes with materials by wavelength are differences of such renders. The mean of the
band decides where paths go, so that a change of a spectrum keeps all paths.
"""

from collections.abc import Mapping
from dataclasses import replace

import mitsuba as mi
import numpy as np

from mi_lcair.plugins.emission.triangles import vertex_positions
from mi_lcair.rendering.loading.parsing import extent
from mi_lcair.rendering.measurands import Criterion, IntensityInterval, Measurands
from mi_lcair.rendering.measure import aim_at_model, measure
from mi_lcair.rendering.motions.motion import Motion, direction_of, matrix_of
from mi_lcair.rendering.motions.pose import known_motions, moved, unfolded, value_of
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


# Steps of the differences of images: how far a motion moves what a pixel shows
# -----------------------------------------------------------------------------

PIXELS = 0.25  # shift of an image for a difference: more blurs edges, less has more noise
MOST = {"deg": 1.0, "1": 0.02}  # longest steps by unit: coarse pixels would ask for longer ones
TRIAL = 1e-3  # change of a motion from which its displacement is taken, in its unit


def pixel_step(scene, sensor, motion: Motion, parts: int = 1) -> float:
    """Change of a motion that moves what a sensor sees by PIXELS at most, in the motion's unit.

    parts: pixels of the sensor's film along each side of a pixel.
    """
    step = min(parts * of_pixels(scene, sensor, motion), MOST.get(motion.unit, np.inf))
    return unfolded(scene, motion, step)


def of_pixels(scene, sensor, motion: Motion) -> float:
    """The same for pixels of any size."""
    name = motion.name.rpartition(".")[2]
    if motion.unit == "pixel":
        return PIXELS
    if motion.shapes:
        before = corners(motion.shapes)
        with moved(scene, {motion.name: value_of(scene, motion) + TRIAL}):
            distance = np.linalg.norm(corners(motion.shapes) - before, axis=1).max() / TRIAL
        return PIXELS * pixel_pitch(sensor, before.mean(axis=0)) / max(float(distance), 1e-12)
    half_diagonal = np.hypot(*sensor.film().size()) / 2
    if name == "range_m":
        return PIXELS / half_diagonal * motion.rest
    if name == "roll_deg":
        return float(np.degrees(PIXELS / half_diagonal))
    low, high = extent(scene.mi)
    middle = (low + high) / 2
    # The farthest point from the origin of the file, about which the observer turns
    radius = np.linalg.norm(high - low) / 2 + np.linalg.norm(middle + scene.origin)
    return float(np.degrees(PIXELS * pixel_pitch(sensor, middle) / max(radius, 1e-12)))


def corners(shapes) -> np.ndarray:
    """Vertices of some meshes, (n, 3) [m]."""
    return np.concatenate([vertex_positions(shape).astype(float) for shape in shapes])


def pixel_pitch(sensor, point: np.ndarray) -> float:
    """Distance of neighbouring pixels of a sensor at the distance of a point (3,) [m]."""
    distance = direction_of(matrix_of(sensor), -point)[2]
    pixel = 1 / np.array(sensor.film().crop_size())
    ends = mi.Point2f([0.5, 0.5 + pixel[0]], [0.5, 0.5])
    ray, _ = sensor.sample_ray(0, 0, ends, mi.Point2f(0.5))
    a, b = (np.array(ray.o) + abs(distance) * np.array(ray.d)).T.astype(float)
    return float(np.linalg.norm(a - b))
