"""Derivatives with respect to motions: central differences of renders with the same paths.

A derivative of a render misses what moves across edges, so that a motion is differentiated by
differences. Attached differences begin their paths at points of facets (`FacetStarts`), and
differences on the film at points of the film. A pilot chooses the quieter kind.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from math import hypot
from typing import NamedTuple

import numpy as np

from mi_lcair.derivatives.motions.kinks import AT_KINK, Kink, TurningFacets, turning_facets
from mi_lcair.derivatives.shape import comes_apart, slope_along
from mi_lcair.errors import InputError
from mi_lcair.plugins.emission.draw_table import PREFERRED
from mi_lcair.plugins.emission.triangles import vertex_positions
from mi_lcair.plugins.integrators.bounce_path import AUTO
from mi_lcair.plugins.paths import launch
from mi_lcair.rendering.facets import (
    background_meshes,
    in_view,
    meshes_of_model,
    mixed_choice,
    radiances,
    seen_shares,
)
from mi_lcair.rendering.loading.parsing import extent
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.measure import aim_over_model, blurred, measure
from mi_lcair.rendering.motions.motion import MODEL, OBSERVER, Motion, matrix_of
from mi_lcair.rendering.motions.pose import ScenePose, known_motions, moved, unfolded, value_of
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene, changed
from mi_lcair.rendering.statistics import Totals, edge_share
from mi_lcair.rendering.window import Windows

# Where paths begin for two poses of a model that moves: on its facets, and where it changes
# ------------------------------------------------------------------------------------------

# Shares of the paths that begin on facets by their projected area, because a cold facet may reflect
# much, by projected area times radiance, and by the change of the latter between the poses
SHARES = 0.3, 0.3, 0.4
TINY = 1e-6  # part of an area by which rounding may change it
# Cells along each side of a window in which two poses are compared, and the share of the paths that
# begin anywhere on the model all the same
CELLS_OF_CHANGE, ON_MODEL_BESIDE = 1024, 0.15


def starts_in(scene, sensor, poses: list[dict], among=1.0) -> list[launch.FacetStarts]:
    """Starts on the facets of a scene's model in several poses, with the same probabilities.

    scene: Scene whose model consists of meshes. sensor: an orthographic one. poses: values of
    motions by name. among: whether paths begin on a triangle, (n,).
    """
    meshes = meshes_of_model(scene)
    seen = seen_shares(scene, sensor, in_view(meshes, sensor)[1])[0]
    of_poses = []
    for pose in poses:
        with moved(scene, pose):
            of_poses.append(in_view(meshes, sensor))
    corners, areas = zip(*of_poses)
    areas = among * np.concatenate(areas)
    radiance = radiances(meshes)
    area, change = np.max(areas, axis=0), np.ptp(areas, axis=0)
    change[change < TINY * area] = 0  # rounding of vertices that are shifted
    parts = np.array([area, area * radiance, change * radiance]) * seen
    choice = mixed_choice(SHARES, parts)
    return [launch.FacetStarts.at(meshes, *pose, choice) for pose in zip(corners, areas)]


def aim_at_change(scene, sensor, poses: list[dict], seed: int) -> launch.Aim | None:
    """An aim at the cells of a window that emit another radiance in two poses; None without such.

    Nearly all noise of a difference on the film is that of paths that meet something else in the
    other pose. They are often few, such as those beside the edge of an opening that grows.
    """
    side, measurands = CELLS_OF_CHANGE, Measurands.of(None)
    pilot = launch.Launch(side, side, seed, 1, 1, windows=side**2)
    radiance, on_model = [], []
    for pose in poses:
        with moved(scene, pose), changed(scene, max_bounces=0), scene.prepared() as tracer:
            radiance.append(measurands.trace(tracer, sensor, pilot).radiance)
            on_model.append(aim_over_model(scene, sensor).may_be_model[0])
    change = np.abs(np.subtract(*radiance)).reshape(1, side, side)
    if not change.any():
        return None
    seen = np.add(*radiance).reshape(1, side, side)
    importance = launch.shared_out(blurred(change)) + launch.shared_out(seen)
    parts = np.ones((side // launch.CELLS,) * 2, bool)
    cells = np.kron(np.any(on_model, axis=0), parts) | (importance > 0)
    return launch.Aim.at(importance, cells, ON_MODEL_BESIDE)


ATTACHED, ON_FILM = "attached difference", "difference on the film"
ALONG_PATHS = "attached paths"
PILOT_PATHS = 2**12  # paths of each render that chooses the kind of differences and their step
PIXELS = 25.0  # shift of an image that changes it by about as much as it is; a step is half a pixel
# Default step: a turn [deg], a shift as a fraction of what moves, and a change of the size
TURN_STEP_DEG, SHIFT_STEP, SIZE_STEP = 0.5, 0.005, 0.02
# In a kink the one-sided derivatives differ, and half the step leaves at least this share of it
LASTING = 0.75
STEP_OF_SENSOR = 1.1e-3  # of its transformation in Float64, in the unit of the motion
# Smallest change of a derivative, as a fraction of it, that is a kink or depends on the step
NOTICED = 0.05
MOST_CHANGES = 4  # of the default step, by a factor of 2
FINE = 3e-3  # error as a fraction of the derivative for which no other step is tried
WORTH = 0.7  # ratio of the errors of two steps from which on the better one is taken
# What is uncovered over less than the step shows in the emission over a part of the step
NEAR, NEAR_PATHS = 1 / 4, 2**16  # that part, and the paths of its renders without reflections
UNLIKE = 0.3  # change of the difference by then, as a fraction of it, from which on it is told
AGREEING = 2.5  # standard errors; a smaller change to twice the step may be noise
SIGNIFICANT = 5.0  # standard errors; with 7 degrees of freedom noise exceeds it once in 600


class DifferenceKind(NamedTuple):
    """A kind of differences: ATTACHED or ON_FILM, and a value of `emitter_sampling`."""

    method: str
    emitter_sampling: bool | str


@dataclass(frozen=True)
class Difference:
    """A central difference of a number, with respect to a motion.

    derivative: per unit of the motion. deviations: of the randomisations, (R,), as those of
    `Totals`. unscattered: standard error that they do not show. step: distance of the two renders
    from the present value. truncation: |D(2 step) - D(step)| / 3, a part of `unscattered`. method:
    ATTACHED or ON_FILM. verdict: "smooth", "kink" or "step-dependent". one_sided: derivatives below
    and above the kink or else the present value, equal if they do not differ by more than noise.
    one_sided_errors: their standard errors. ends: the renders above and below. kink: distance from
    the present value at which facets turn edge-on, 0 for one at it; None without such a kink.
    touches: whether parts of the model touch that come apart.
    """

    derivative: float
    deviations: np.ndarray
    unscattered: float
    step: float
    truncation: float
    method: str
    verdict: str
    one_sided: tuple[float, float]
    one_sided_errors: tuple[float, float]
    ends: tuple[Totals, Totals]
    kink: float | None = None
    touches: bool = False

    @property
    def error(self) -> float:
        """Standard error of the derivative."""
        return hypot(float(np.sqrt(np.sum(self.deviations**2))), self.unscattered)

    def scaled(self, factor: float) -> "Difference":
        """The difference of the number times a positive factor."""
        return replace(
            self,
            derivative=factor * self.derivative,
            deviations=factor * self.deviations,
            unscattered=factor * self.unscattered,
            truncation=factor * self.truncation,
            one_sided=(factor * self.one_sided[0], factor * self.one_sided[1]),
            one_sided_errors=(factor * self.one_sided_errors[0], factor * self.one_sided_errors[1]),
        )


def scale_of(motion: Motion, value: float) -> float:
    """A change of a motion that changes the scene by about as much as it is."""
    if motion.unit == "deg":
        return 180 / np.pi
    if motion.unit == "1":
        return abs(value) or 1.0
    if motion.unit == "pixel":
        return PIXELS
    boxes = [shape.bbox() for shape in motion.shapes]
    low = np.min([np.ravel(box.min) for box in boxes], axis=0)
    return float(np.linalg.norm(np.max([np.ravel(box.max) for box in boxes], axis=0) - low))


def default_step(scene, motion: Motion) -> float:
    """Step of a motion; a turn about a point far from the scene is shorter, since it shifts it."""
    if motion.unit != "deg":
        part = SHIFT_STEP if motion.unit == "m" else SIZE_STEP
        return unfolded(scene, motion, part * scale_of(motion, value_of(scene, motion)))
    low, high = extent(scene.mi)
    distance = np.linalg.norm((low + high) / 2 + scene.origin)
    is_about_origin = motion.name.partition(".")[0] in (MODEL, OBSERVER)
    size = float(np.linalg.norm(high - low)) if is_about_origin else np.inf
    return TURN_STEP_DEG * float(min(size / max(distance, 1e-300), 1.0))


def poses_around(scene, name: str, step: float) -> list[dict[str, float]]:
    """The poses of a motion between which differences over a step are taken."""
    value = value_of(scene, known_motions(scene)[name])
    return [{name: value + 2 * step}, {name: value - 2 * step}]


def velocities_of(scene, name: str) -> np.ndarray:
    """Velocities of the vertices of all meshes of the model in a motion, (V, 3) [m per unit]."""
    pose, motion, ends = ScenePose.of(scene), known_motions(scene)[name], []
    value = value_of(scene, motion)
    step = TINY * scale_of(motion, value)
    for end in (value + step, value - step):
        values = {**pose.values, name: end}
        ends.append(np.concatenate([pose.vertices(m, values) for m in meshes_of_model(scene)]))
    return (ends[0] - ends[1]) / (2 * step)


def velocities_before(scene, sensor, name: str) -> np.ndarray | None:
    """Velocities of all vertices, (V, 3), with which a sensor sees the same as in its own motion.

    Those of the model's meshes, and then of the others.
    None if there are none: the sun moves, or the image over the film of a perspective sensor.
    """
    pose = ScenePose.of(scene)
    if not name.startswith(f"{OBSERVER}.") or sensor not in pose.sensors:
        return None
    step, value = STEP_OF_SENSOR, value_of(scene, known_motions(scene)[name])
    ends = [pose.settings_of(sensor, {**pose.values, name: value + x}) for x in (step, -step)]
    pose.place_sensors()
    meshes = meshes_of_model(scene) + background_meshes(scene)
    vertices = np.concatenate(list(map(vertex_positions, meshes)))
    now, turned = matrix_of(sensor), [np.linalg.inv(end["to_world"]) for end in ends]
    if np.allclose(*turned, rtol=1e-12, atol=0):
        return None
    rate = now @ (turned[0] - turned[1]) / (2 * step)
    return vertices @ rate[:3, :3].T + rate[:3, 3]


@dataclass(eq=False)
class Differences:
    """Differences of a number that renders give, with respect to one motion.

    Parameters
    ----------
    scene : Scene
    name : str
        Name of the motion.
    sampling : Sampling
        With a number of paths.
    measurands : Measurands
    rows : callable
        Mean of the number and its deviations, (1 + R,), from the Totals of a render.
    channel : str or None
        Channel of the radiance of which the number is a part: "target", or None for the scene.
    aim : Aim or None
        Where paths on the film begin.
    is_target : bool
        Whether the number is the mean radiance of the target.
    """

    scene: Scene
    name: str
    sampling: Sampling
    measurands: Measurands
    rows: Callable[[Totals], np.ndarray]
    channel: str | None = "target"
    aim: launch.Aim | None = None
    is_target: bool = False

    def __post_init__(self):
        self.camera = self.scene.sensor(self.sampling.sensor)
        self.motion: Motion = known_motions(self.scene)[self.name]
        self.value = value_of(self.scene, self.motion)
        self.aims = {}
        self.turning: list[TurningFacets] = []
        self.can_attach = (
            self.channel == "target"
            and self.camera.class_name() == "OrthographicCamera"
            and meshes_of_model(self.scene) is not None
        )

    @cached_property
    def scale(self) -> float:
        return scale_of(self.motion, self.value)

    def poses(self, offsets) -> list[dict[str, float]]:
        """Values of the motion at distances from its present value."""
        return [{self.name: self.value + offset} for offset in offsets]

    def kinds(self) -> list[DifferenceKind]:
        """The kinds of differences among which a pilot chooses.

        A reflected ray meets or misses an emitter that moves, whereas a drawn direction follows it.
        Where directions are drawn, they are therefore preferred.
        """
        integrator = self.scene.mi.integrator()
        says = integrator.emitter_sampling
        choices = [False, PREFERRED] if says == AUTO else [PREFERRED if says else False]
        if integrator.max_bounces == 0:
            choices = choices[:1]
        methods = [ATTACHED, ON_FILM] if self.can_attach else [ON_FILM]
        methods = methods[: 1 if self.turning else 2]
        return [DifferenceKind(method, choice) for method in methods for choice in choices]

    def aim_on_film(self, *ends: float) -> launch.Aim | None:
        """Where paths on the film begin, for poses between two ends."""
        if ends not in self.aims:
            aim = aim_at_change(self.scene, self.camera, self.poses(ends), self.sampling.seed)
            self.aims[ends] = aim or self.aim
        return self.aims[ends]

    def totals(self, offsets, kind: DifferenceKind, paths: int, among=None) -> list[Totals]:
        """Renders with the motion at distances from its present value.

        among: triangles on which attached paths begin; None for all but those that turn edge-on.
        """
        poses = self.poses(offsets)
        if kind.method == ATTACHED:
            if among is None:
                among = np.prod([~facets.among for facets in self.turning], axis=0)
            aims = starts_in(self.scene, self.camera, poses, among)
        else:
            aims = [self.aim_on_film(max(offsets), min(offsets))] * len(poses)
        sampling, renders = replace(self.sampling, paths=paths, spp=None, progress=None), []
        for pose, aim in zip(poses, aims):
            settings = changed(self.scene, emitter_sampling=kind.emitter_sampling)
            with moved(self.scene, pose), settings:
                windows = Windows.whole(self.camera)
                renders.append(measure(self.scene, windows, sampling, self.measurands, aim=aim))
        return renders

    def at(self, step: float | None = None) -> Difference:
        """The derivative from renders at +- step, in units of the motion; None chooses it.

        The renders may lie beyond the bounds of the motion, such as beyond the zenith.
        """
        h = default_step(self.scene, self.motion) if step is None else step
        self.turning = []
        if step is None and self.can_attach:
            place = self.scene, self.camera, self.name, self.value
            self.turning = turning_facets(*place, reach=h, scale=self.scale)
        pilots = {kind: self.pilot(h, kind) for kind in self.kinds()}
        kind = min(pilots, key=lambda kind: self.expected(pilots[kind]))
        pilot, reach = pilots[kind], h
        if step is None:
            h, pilot = self.better_step(*self.smooth_step(h, pilot, kind), kind)
        verdict = pilot.verdict
        if step is None and verdict == "smooth" and (found := self.along_paths(pilot)):
            return found
        touches = step is None and self.comes_apart()
        offsets = [h, -h, *([0] if verdict == "kink" or self.turning or touches else [])]
        ends = self.totals(offsets, kind, self.sampling.paths)
        high, low, *middle = map(self.rows, ends)
        slope, bend = (high - low) / (2 * h), np.append(pilot.jump, 0 * high[1:])
        if middle:
            bend = (high + low - 2 * middle[0]) / h
        largest = max(abs(slope[0] - bend[0] / 2), abs(slope[0] + bend[0] / 2))
        is_even = abs(bend[0]) + 2 * hypot(*bend[1:]) <= NOTICED * largest
        if touches and verdict == "smooth" and not is_even:
            verdict = "kink"
        scatter = float(np.sqrt(np.sum(slope[1:] ** 2)))
        floor = self.floor(ends[:2], kind, h)
        if any(total.lowest["target"][0] == 0 for total in ends):  # points of facets are hidden
            floor = max(floor, self.of_edges(ends[:2], h))
        if verdict == "smooth" and self.differs_nearby(slope[0], h, kind):
            verdict = "step-dependent"
        kinks = [self.kink(facets, reach, kind) for facets in self.turning]
        parts = [
            np.sqrt(max(floor**2 - scatter**2, 0)),
            self.rounding(pilot.rows, h),
            self.missed(ends[:2], kind, h),
            pilot.truncation if step is None else 0.0,
            *(kink.unscattered for kink in kinks),
        ]
        present = slope + self.of_kinks(kinks, 0.0)
        half = 0 * bend if touches and verdict == "smooth" else bend / 2
        sides, named = (present - half, present + half), None
        if verdict != "kink" and kinks:
            sides, named = self.sides(slope, bend / h, kinks) or ((present, present), None)
            verdict = verdict if named is None else "kink"
        unscattered = float(np.sqrt(np.sum(np.square(parts))))
        below, above = (hypot(*side[1:], unscattered) for side in sides)
        return Difference(
            derivative=float(present[0]),
            deviations=present[1:],
            unscattered=unscattered,
            step=h,
            truncation=pilot.truncation,
            method=kind.method,
            verdict=verdict,
            one_sided=(float(sides[0][0]), float(sides[1][0])),
            one_sided_errors=(below, above),
            ends=tuple(ends[:2]),
            kink=named,
            touches=touches,
        )

    def along_paths(self, pilot: "Pilot") -> Difference | None:
        """The derivative by attached paths and silhouettes, where it has less error.

        None where differences are fine, or paths cannot be attached.
        """
        paths, slope = 2 * self.sampling.paths, abs(pilot.slope(3, 1)[0])
        expected = hypot(self.expected(pilot), pilot.truncation)
        if not (self.is_target and self.can_attach and self.motion.shapes) or self.turning:
            return None
        if expected < FINE * slope:
            return None
        velocities = velocities_of(self.scene, self.name)
        place, seed = (self.scene, self.camera, velocities), self.sampling.seed
        few = slope_along(*place, 2 * PILOT_PATHS, seed)
        if few is None:
            return None
        ratio = np.sqrt(2 * PILOT_PATHS / paths)
        if ratio * hypot(*few[0][1:]) > WORTH * expected:
            return None
        rows, unscattered = slope_along(*place, paths, seed)
        unscattered = hypot(unscattered, self.rounding(pilot.rows, self.scale))
        found = float(rows[0])
        result = Difference(
            found, rows[1:], unscattered, 0.0, 0.0, ALONG_PATHS, "smooth", (found,) * 2, (), ()
        )
        if result.error > expected:  # as where no path has begun on some triangles
            return None
        return replace(result, one_sided_errors=(result.error,) * 2)

    def comes_apart(self) -> bool:
        """Whether meshes that touch come apart or pass through each other."""
        if not (self.can_attach and self.motion.shapes):
            return False
        return comes_apart(self.scene, velocities_of(self.scene, self.name))

    def kink(self, facets: TurningFacets, reach: float, kind: DifferenceKind) -> Kink:
        """What facets that turn edge-on add, from renders of them alone beside the kink."""
        radiance, share, paths = {}, 0.0, max(PILOT_PATHS, self.sampling.paths // 4)
        for side in (-1, 1):
            distances = np.array([0.5, 1]) * reach
            offsets = facets.offset + side * distances
            areas = [facets.area(x, side) for x in offsets]
            radiance[side] = np.zeros((2, 1))
            if any(areas):
                totals = self.totals(offsets, kind, paths, facets.among)
                near, far = (self.rows(total) / area for total, area in zip(totals, areas))
                slope = (far - near) / np.ptp(distances)
                radiance[side] = np.array([near - distances[0] * slope, slope])
                points = float(totals[0].paths[0]) / totals[0].randomisations
                share = edge_share(totals[0].randomisations) / points
        return Kink(facets, radiance, share, reach)

    def of_kinks(self, kinks: list[Kink], x: float) -> np.ndarray:
        """What kinks add to the derivative at a distance from the present value, (1 + R,)."""
        return sum(kink.at(x, AT_KINK * self.scale) for kink in kinks) + np.zeros(1)

    def sides(self, slope: np.ndarray, curvature: np.ndarray, kinks: list[Kink]):
        """Derivatives below and above the nearest kink, and its distance; None without a kink.

        slope, curvature: of what the other facets show, with their deviations, (1 + R,).
        """
        for kink in sorted(kinks, key=lambda kink: abs(kink.facets.offset)):
            x = kink.facets.offset
            others = [other for other in kinks if other is not kink]
            smooth = slope + curvature * x + self.of_kinks(others, x)
            below, above = (smooth + kink.slope(x, side) for side in (-1, 1))
            jump = above - below
            error = hypot(*jump[1:], kink.unscattered)
            if abs(jump[0]) > max(SIGNIFICANT * error, NOTICED * max(abs(below[0]), abs(above[0]))):
                return (below, above), x if abs(x) > AT_KINK * self.scale else 0.0
        return None

    def differs_nearby(self, slope: float, h: float, kind: DifferenceKind) -> bool:
        """Whether the difference over a part of the step `h` is another one, as emission shows.

        slope: the difference over the step. Surfaces that lie on each other may come apart within
        it. Their emission, without reflections, has much less noise than the number itself.
        """
        offsets = np.array([1, -1, NEAR, -NEAR]) * h
        with changed(self.scene, max_bounces=0):
            totals = self.totals(offsets, kind, NEAR_PATHS)
        rows, slopes, errors = [self.rows(total) for total in totals], [], []
        for k in (0, 2):
            step = offsets[k]
            slopes.append((rows[k] - rows[k + 1]) / (2 * step))
            scatter = float(np.sqrt(np.sum(slopes[-1][1:] ** 2)))
            floor = self.floor(totals[k : k + 2], kind, step)
            errors.append(max(scatter, floor, self.rounding(np.array(rows), step)))
        change = abs(slopes[1][0] - slopes[0][0])
        return bool(change > max(SIGNIFICANT * hypot(*errors), UNLIKE * abs(slope)))

    def smooth_step(self, h: float, pilot: "Pilot", kind: DifferenceKind) -> tuple[float, "Pilot"]:
        """A step that does not reach a kink beside the present value, and its pilot.

        The step is halved until the differences within it agree. It stays as it is if a kink is at
        the present value, or if noise would hide it from a shorter step.
        """
        halvings = 0 if pilot.verdict == "smooth" else MOST_CHANGES
        largest = max(abs(pilot.bend[0]), abs(pilot.change[0]))
        for shorter in h / 2.0 ** np.arange(1, 1 + halvings):
            other = self.pilot(shorter, kind)
            noise = max(other.error(other.bend), other.error(other.change))
            if SIGNIFICANT * noise > LASTING * largest:
                break
            if other.verdict == "smooth":
                return float(shorter), other
        return h, pilot

    def better_step(self, h: float, pilot: "Pilot", kind: DifferenceKind) -> tuple[float, "Pilot"]:
        """A step with less error than `h`, and its pilot.

        Where paths meet or miss what moves, the noise falls as the step grows. Where facets turn
        away within the step, the truncation error falls as it shrinks. The step is doubled or
        halved as long as the error that the renders with all paths are expected to have falls to
        WORTH. A difference over twice the step has four times the truncation error.
        """
        fewer = np.sqrt(PILOT_PATHS / self.sampling.paths)
        for _ in range(MOST_CHANGES):
            noise, truncation = fewer * pilot.noise, pilot.truncation
            error = hypot(noise, truncation)
            if pilot.verdict == "kink" or error < FINE * abs(pilot.slope(3, 1)[0]):
                break
            change = abs(float(pilot.change[0]))
            grows = noise > truncation or change < AGREEING * pilot.error(pilot.change)
            factor, least = (2, 4 * change / 3) if grows else (0.5, 0.0)
            try:
                other = self.pilot(factor * h, kind)
            except InputError:  # control points would turn triangles over
                break
            of_other = hypot(fewer * other.noise, max(other.truncation, least))
            if of_other > WORTH * error or (factor > 1 and other.verdict != "smooth"):
                break
            h, pilot = factor * h, other
        return h, pilot

    def pilot(self, h: float, kind: DifferenceKind) -> "Pilot":
        """Renders with few paths at five values, for one kind of differences."""
        offsets = np.array([-2, -1, 0, 1, 2]) * h
        totals = self.totals(offsets, kind, PILOT_PATHS)
        floor = self.floor([totals[3], totals[1]], kind, h)
        missed = self.missed([totals[3], totals[1]], kind, h)
        rows = np.array([self.rows(total) for total in totals])
        return Pilot(offsets, rows, max(floor, self.rounding(rows, h)), missed)

    def rounding(self, rows: np.ndarray, h: float) -> float:
        """Standard error of a difference from rounding in the two renders."""
        reflections = self.scene.mi.integrator().max_bounces
        return launch.rounding_error(reflections) * float(np.abs(rows[:, 0]).max()) / h

    def expected(self, pilot: "Pilot") -> float:
        """Standard error of the difference with all paths, as a pilot has it."""
        ratio = PILOT_PATHS / self.sampling.paths
        return hypot(np.sqrt(ratio) * pilot.noise, ratio * pilot.missed)

    def missed(self, ends, kind: DifferenceKind, h: float) -> float:
        """Standard error of a difference from sources that no path has met.

        A reflected ray may meet such a source in one of the two renders only. Drawn directions
        follow the sources, and first hits are on facets whose emission is known.
        """
        error = max(float(total.missed_error(self.channel)[0]) for total in ends)
        is_reflected = self.scene.mi.integrator().max_bounces > 0 and not kind.emitter_sampling
        return error / (2 * h if is_reflected else self.scale)

    def floor(self, ends, kind: DifferenceKind, h: float) -> float:
        """Smallest standard error of a difference.

        All randomisations may agree on how many of their points lie on a facet, or on one side of
        an edge that moves over the film. Their scatter is then 0, see `Totals.edge_error`.
        """
        if kind.method == ON_FILM:
            return self.of_edges(ends, h)
        radiance = radiances(meshes_of_model(self.scene))
        high, low = (total.aim.tables.weight.numpy().astype(float) for total in ends)
        slopes = (high - low) * radiance / (2 * h)
        points = float(ends[0].paths[0]) / ends[0].randomisations
        return edge_share(ends[0].randomisations) * float(np.ptp(slopes)) / points

    def of_edges(self, ends, h: float) -> float:
        """Standard error of a difference from edges that move between the points of all paths."""
        points = float(ends[0].paths[0]) / ends[0].randomisations
        means = [float(total.mean(self.channel)[0]) for total in ends]
        return edge_share(ends[0].randomisations) * hypot(*means) / points / (2 * h)


@dataclass(frozen=True)
class Pilot:
    """A number at five values of a motion, around the present one.

    offsets: distances from the present value, (5,). rows: mean and deviations there, (5, 1 + R).
    floor: smallest standard error. missed: standard error from sources that no path has hit.
    """

    offsets: np.ndarray
    rows: np.ndarray
    floor: float
    missed: float = 0.0

    def slope(self, k: int, j: int) -> np.ndarray:
        return (self.rows[k] - self.rows[j]) / (self.offsets[k] - self.offsets[j])

    def error(self, rows: np.ndarray) -> float:
        return max(float(np.sqrt(np.sum(rows[1:] ** 2))), self.floor)

    @property
    def noise(self) -> float:
        """Standard error of the difference over the step."""
        return self.error(self.slope(3, 1))

    @property
    def change(self) -> np.ndarray:
        """Change of the difference from the step to twice the step, and its deviations."""
        return self.slope(4, 0) - self.slope(3, 1)

    @property
    def truncation(self) -> float:
        """Error of the difference over the step, without what noise adds to its estimate."""
        change = self.change
        return float(np.sqrt(max(change[0] ** 2 - np.sum(change[1:] ** 2), 0))) / 3

    @property
    def bend(self) -> np.ndarray:
        """Difference of the slopes above and below the present value, and its deviations."""
        return self.slope(3, 2) - self.slope(2, 1)

    @property
    def jump(self) -> float:
        """The difference `bend`; 0 if it is not significant."""
        bend = self.bend
        return float(bend[0]) if abs(bend[0]) > SIGNIFICANT * self.error(bend) else 0.0

    @property
    def verdict(self) -> str:
        """Whether the derivative exists at this step.

        A kink is a jump between the one-sided derivatives that a shorter step does not reduce.
        """
        far = self.slope(4, 2) - self.slope(2, 0)
        largest = max(abs(self.slope(2, 1)[0]), abs(self.slope(3, 2)[0]))
        if abs(self.jump) > max(NOTICED * largest, LASTING * abs(far[0])):
            return "kink"
        change = self.change
        noticed = max(SIGNIFICANT * self.error(change), NOTICED * abs(self.slope(3, 1)[0]))
        return "step-dependent" if abs(change[0]) > noticed else "smooth"
