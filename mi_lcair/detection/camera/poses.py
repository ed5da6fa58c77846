"""Pose of a camera from points of a model and their pixels (resection), by least squares."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
from scipy.linalg import LinAlgError
from scipy.optimize import approx_fprime, least_squares
from scipy.spatial.transform import Rotation

from mi_lcair.detection.camera.view import pointing_of
from mi_lcair.detection.scenario import POLAR, Observer, Scenario, change
from mi_lcair.detection.setting import target_scene
from mi_lcair.errors import InputError
from mi_lcair.files import replacing
from mi_lcair.physics.imager import Imager
from mi_lcair.rendering.statistics import student_factor
from mi_lcair.rendering.views import Target
from mi_lcair.results import Result, entry, summary_of
from mi_lcair.sections import Table
from mi_lcair.toml_table import text_of

FEWEST = 4  # points; three have up to four poses
ON_A_LINE = 1e-4  # width of points that count as one line, relative to their length
IN_A_PLANE = 0.05  # thickness of points that count as a plane for the first guess, likewise
NEAREST = 1e-6  # smallest depth of a point during the search, relative to the points' extent
MISFIT_PX = 3.0  # rms residual from which on the points are tried behind the camera
BETTER = 3.0  # factor by which the residual must fall then
ALIKE = 9.0  # difference in chi-square up to which a second pose explains the points as well
APART = 3.0  # least distance of a second pose, in standard errors


@dataclass(frozen=True)
class Minimum:
    """A pose at which the sum of the squared residuals has a minimum.

    Attributes
    ----------
    eye : ndarray, shape (3,)
        Position of the camera [m].
    sides : ndarray, shape (3, 3)
        Unit vectors to the right, upward, and along the optical axis, one a row.
    residual_px : ndarray, shape (n, 2)
        Predicted columns and rows less the measured ones.
    slopes : ndarray, shape (2n, 6)
        Derivatives of the residuals with respect to turns about right, up and axis [1/rad], and to
        the position [1/m].
    """

    eye: np.ndarray
    sides: np.ndarray
    residual_px: np.ndarray
    slopes: np.ndarray

    @property
    def square(self) -> float:
        """Sum of the squared residuals [pixels^2]."""
        return float(np.sum(self.residual_px**2))

    @property
    def rms_px(self) -> float:
        """Rms residual of a column or row [pixels]."""
        return float(np.sqrt(np.mean(self.residual_px**2)))


@dataclass(frozen=True)
class Solved(Minimum):
    """The deepest minimum, and how well the points determine it.

    errors: standard errors of the turns [rad] and of the position [m], (6,). factor: half of a 95 %
    interval in standard errors. second: another pose that explains the points as well, or None.
    """

    errors: np.ndarray
    factor: float
    second: Minimum | None


def pixels(points: np.ndarray, eye: np.ndarray, sides: np.ndarray, imager: Imager) -> np.ndarray:
    """Columns and rows at which a camera sees points, (n, 2).

    The corner of the frame is 0, the middle of its first pixel 0.5. Rows go down.
    """
    right, up, depth = sides @ (points - eye).T
    depth = np.maximum(depth, NEAREST * np.ptp(points, axis=0).max())
    across = np.stack([right, -up]) / (depth * imager.pixel_angle)
    return across.T + [imager.width / 2, imager.height / 2]


def solve(points: np.ndarray, places: np.ndarray, imager: Imager, sigma_px: float | None) -> Solved:
    """The pose in which a camera sees points at their places in the frame.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        In the scene's axes [m].
    places : ndarray, shape (n, 2)
        Columns and rows, as of `pixels`.
    imager : Imager
    sigma_px : float or None
        Standard deviation of a column or row [pixels]. None: that of the residuals.

    Raises
    ------
    InputError
        For points that do not determine a pose.
    """
    check_points(points, places)
    best, *others = minima(points, places, imager)
    if best.rms_px > MISFIT_PX:
        # Seen through the camera's middle, points behind it are those in front of it, inverted
        behind = minima(-points, places, imager)[0]
        if BETTER * behind.rms_px < best.rms_px:
            raise InputError(
                f"the points would be behind the camera: in front of it they miss their pixels by "
                f"{best.rms_px:.3g} (rms); are x, y, z right-handed, and do the rows go down?"
            )
    freedom = places.size - 6
    variance = best.square / freedom if sigma_px is None else sigma_px**2
    try:
        covariance = variance * np.linalg.inv(best.slopes.T @ best.slopes)
    except LinAlgError:
        raise InputError("the points do not determine the pose; add points elsewhere") from None
    errors = np.sqrt(np.diag(covariance))
    second = None
    for other in others:
        alike = other.square - best.square < ALIKE * max(variance, 1e-12)
        if alike and np.any(abs(other.eye - best.eye) > APART * errors[3:]):
            second = other
    factor = student_factor(freedom if sigma_px is None else np.inf)
    return Solved(**vars(best), errors=errors, factor=factor, second=second)


def check_points(points: np.ndarray, places: np.ndarray) -> None:
    """Raise InputError for points that no pose follows from, whatever their pixels are."""
    if len(points) < FEWEST:
        raise InputError(
            f"{len(points)} points; a pose needs {FEWEST} or more, and six or more for its errors"
        )
    if is_line(points):
        raise InputError(
            "the points lie on a line, about which the camera could turn; add one outside the line"
        )
    if is_line(places):
        raise InputError("the pixels lie on a line; such points do not determine a pose")


def is_line(points: np.ndarray) -> bool:
    """Whether points (n, 2) or (n, 3) are one point or count as a line."""
    sizes = np.linalg.svd(points - points.mean(axis=0))[1]
    return bool(sizes[1] <= ON_A_LINE * sizes[0])


def starts(points: np.ndarray, places: np.ndarray, imager: Imager) -> list[tuple]:
    """First guesses (eye, sides) from a parallel projection with a scale.

    With points and pixels from their middles, the tangents are x = I.p and y = J.p, where I and J
    are the vectors to the right and upward divided by the distance (DeMenthon and Davis 1995).
    Points that are nearly in a plane leave the parts of I and J across it open. Both must be
    equally long and at right angles, which has two solutions.
    """
    x = (places - places.mean(axis=0)) * [1, -1] * imager.pixel_angle
    _, sizes, axes = np.linalg.svd(points)
    if sizes[2] > IN_A_PLANE * sizes[0]:
        guesses = [np.linalg.lstsq(points, x, rcond=None)[0].T]
    else:
        flat = points @ axes[:2].T
        inside = np.linalg.lstsq(flat, x, rcond=None)[0].T @ axes[:2]
        difference = inside[1] @ inside[1] - inside[0] @ inside[0]
        product = -inside[0] @ inside[1]
        across = np.sqrt(max((difference + np.hypot(difference, 2 * product)) / 2, 0))
        along = np.copysign(np.sqrt(max(across**2 - difference, 0)), product)
        guesses = [inside + sign * np.outer([across, along], axes[2]) for sign in (1, -1)]
    result = []
    for right, up in guesses:
        if np.linalg.matrix_rank([right, up]) < 2:
            continue
        distance = 1 / np.linalg.norm([right, up], axis=1).mean()
        # The nearest pair of unit vectors at right angles
        u, _, v = np.linalg.svd([right, up], full_matrices=False)
        right, up = u @ v
        sides = np.stack([right, up, np.cross(up, right)])
        result.append((-distance * sides[2], sides))
    return result


def minima(points: np.ndarray, places: np.ndarray, imager: Imager) -> list[Minimum]:
    """The minima of the squared residuals that the first guesses lead to, the deepest first."""
    result, middle = [], points.mean(axis=0)
    points = points - middle  # for the precision of small steps
    for eye, sides in starts(points, places, imager):
        scale = np.linalg.norm(eye)

        def placed(step, eye=eye, sides=sides, scale=scale):
            return eye + scale * step[3:], Rotation.from_rotvec(step[:3]).as_matrix() @ sides

        def residuals(step, placed=placed):
            return (pixels(points, *placed(step), imager) - places).ravel()

        fit = least_squares(residuals, np.zeros(6), method="lm", xtol=1e-12)
        eye, sides = placed(fit.x)

        def turned(step, eye=eye, sides=sides):
            turn = Rotation.from_rotvec(-(step[:3] @ sides)).as_matrix()
            return pixels(points, eye + step[3:], sides @ turn, imager).ravel()

        slopes = approx_fprime(np.zeros(6), turned)
        result.append(Minimum(middle + eye, sides, fit.fun.reshape(-1, 2), slopes))
    if not result:
        raise InputError("the pixels do not fit to a view of the points; check their order")
    return sorted(result, key=lambda minimum: minimum.square)


# The pose of a camera from points, as a result, and as a scenario with this camera
# ---------------------------------------------------------------------------------

BESIDE = 1e-3  # distance of a ray's start from its point, in radii of the model
COLUMNS = ("x_m", "y_m", "z_m", "column_px", "row_px")


@dataclass(frozen=True, repr=False)
class CameraPose(Result):
    """Position and pointing of a camera, from points of a scene in known pixels.

    Attributes
    ----------
    name : str
        Name of the scenario.
    points : ndarray, shape (n, 5)
        Points in the scene's axes [m], with column and row [pixels].
    position_m : ndarray, shape (3,)
        Position in the scene's axes.
    position_error_m : ndarray, shape (3,)
        Standard errors of its coordinates.
    turn_error_deg : ndarray, shape (3,)
        Standard errors of rotations about the directions to the right, upward, and along the axis.
    factor : float
        Half of a 95 % interval in standard errors (Student's factor if the noise is estimated from
        the residuals).
    residual_px : ndarray, shape (n, 2)
        Predicted columns and rows minus the given ones.
    observer : Observer
        The position relative to the middle of the scene's model.
    pointing : dict of str to float
        right_deg, up_deg and roll_deg of a table [camera].
    tables : dict
        Tables of the scenario with this camera.
    remarks : tuple of str
    """

    name: str = entry("scenario")
    points: np.ndarray = entry()
    position_m: np.ndarray
    position_error_m: np.ndarray
    turn_error_deg: np.ndarray
    factor: float = entry("half_width_in_errors")
    residual_px: np.ndarray = entry()
    observer: Observer = entry()
    pointing: dict[str, float] = entry("camera")
    tables: dict[str, dict] = entry()
    remarks: tuple[str, ...] = ()

    kind = "pose"
    computed = {"rms_px": "rms_px", "observer": "polar", "columns": "columns"}
    saved_by = {".toml": "mi_lcair.detection.camera.poses:write_scenario"}

    @property
    def rms_px(self) -> float:
        """Rms residual of a column or row [pixels]."""
        return float(np.sqrt(np.mean(self.residual_px**2)))

    def summary(self) -> str:
        """One line with the position, its 95 % interval, and the residual."""
        place = ", ".join(f"{value:.5g}" for value in self.position_m)
        half = ", ".join(f"{value:.2g}" for value in self.factor * self.position_error_m)
        return (
            f"pose of the camera of {self.name}: at ({place}) m, 95 % +- ({half}) m, "
            f"{self.rms_px:.2g} pixels rms"
        )

    def polar(self) -> dict:
        """The observer's position in both forms, for JSON."""
        return {name: getattr(self.observer, name) for name in ("position_m", *POLAR)}

    def facts(self) -> Iterator[Any]:
        """The pose with its errors, and the residuals of the points."""
        observer, half = self.observer, self.factor * self.turn_error_deg
        sides = zip(half, ("right", "up", "axis"))
        turns = ", ".join(f"{value:.2g} about {side}" for value, side in sides)
        yield summary_of(self)
        yield "range", f"{observer.range_m:.6g} m from the model's middle"
        direction = f"azimuth {observer.azimuth_deg:.5g}, elevation {observer.elevation_deg:.5g}"
        yield "direction", direction
        yield "pointing", ", ".join(f"{name} = {x:.4g}" for name, x in self.pointing.items())
        yield "turns, 95 %", f"{turns} [degrees]"
        yield Table.of({"point": range(1, 1 + len(self.points))} | self.columns())

    def columns(self) -> dict[str, np.ndarray]:
        """The points, their pixels, and the residuals."""
        residuals = zip(("residual_column_px", "residual_row_px"), self.residual_px.T)
        return dict(zip(COLUMNS, self.points.T)) | dict(residuals)


def camera_pose(
    scenario: Scenario, tables: dict, points: np.ndarray, sigma_px: float | None
) -> CameraPose:
    """The pose in which the camera of a scenario sees points; see `mi_lcair.pose`.

    tables: those of the scenario's file.
    """
    imager = scenario.camera
    if imager is None or imager.projection != "perspective":
        raise InputError(
            "a pose needs a table [camera] with focal_length_mm, pitch_um, width and height, and "
            "projection = perspective"
        )
    if scenario.flight is not None:
        raise InputError("the scenario has a [flight]; a pose needs an [observer] in its place")
    places, size = points[:, 3:], np.array([imager.width, imager.height])
    for k in np.flatnonzero(((places < -size) | (places > 2 * size)).any(axis=1)):
        raise InputError(
            f"point {k + 1}: column {places[k, 0]:g}, row {places[k, 1]:g} is far outside the "
            f"frame of {imager.width} x {imager.height} pixels; check [camera] and the columns"
        )
    solved = solve(points[:, :3], places, imager, sigma_px)
    scene = target_scene(scenario, scenario.sensor.detector())
    target = Target.of(scene)
    # The loaded scene may have been moved near its origin
    from_middle = solved.eye - (target.centre + scene.origin)
    hidden = hidden_points(scene, target, points[:, :3] - scene.origin, from_middle)
    observer = Observer(position_m=tuple(map(float, from_middle)))
    pointing = pointing_of(observer.view, solved.sides[0], solved.sides[2])
    change(tables, ["observer", "position_m"], list(observer.position_m))
    for name, angle in pointing.items():
        change(tables, ["camera", name], angle)
    return CameraPose(
        scenario.name,
        points,
        solved.eye,
        solved.errors[3:],
        np.degrees(solved.errors[:3]),
        solved.factor,
        solved.residual_px,
        observer,
        pointing,
        tables,
        remarks_on(solved, sigma_px, hidden),
    )


def hidden_points(scene, target: Target, points: np.ndarray, from_middle: np.ndarray) -> list[int]:
    """Numbers, from 1, of the points that the model hides from a place relative to its middle.

    What is farther away, such as a sky, does not hide them.
    """
    toward = target.centre + from_middle - points
    distance = np.linalg.norm(toward, axis=1)
    toward /= distance[:, None]
    start = points + BESIDE * target.radius * toward
    o, d = (value.T.astype(np.float32) for value in (start, toward))
    ray = mi.Ray3f(mi.Point3f(o), mi.Vector3f(d))
    ray.maxt = mi.Float(np.minimum(distance, 2 * target.radius).astype(np.float32))
    return (1 + np.flatnonzero(scene.mi.ray_test(ray).numpy())).tolist()


def remarks_on(solved: Solved, sigma_px: float | None, hidden: list[int]) -> tuple[str, ...]:
    """What a user should know about a pose. hidden: numbers of the points that are hidden there."""
    remarks = []
    if hidden:
        remarks.append(
            f"the model hides point {', '.join(map(str, hidden))} of {len(solved.residual_px)}: "
            "do the rows go down, and are x, y, z right-handed?"
        )
    if solved.second is not None:
        place = ", ".join(f"{value:.4g}" for value in solved.second.eye)
        remarks.append(
            f"a second pose at ({place}) m fits the points as well; add points outside their "
            "plane, or nearer to the camera, to decide between the two"
        )
    if sigma_px is not None and solved.rms_px > 2 * sigma_px:
        remarks.append(
            f"the points miss their pixels by {solved.rms_px:.2g} (rms), more than sigma = "
            f"{sigma_px:g}; the errors are too small: check focal length, pixels and points"
        )
    freedom = solved.residual_px.size - 6
    if sigma_px is None and freedom < 4:
        remarks.append(
            f"{len(solved.residual_px)} points leave {freedom} degrees of freedom for the noise, "
            f"so that half of a 95 % interval is {student_factor(freedom):.3g} standard errors; "
            "give sigma, or add points"
        )
    return tuple(remarks)


def write_scenario(path: Path, pose: CameraPose) -> None:
    """Write the scenario with this camera as TOML, which `image` and `invert` take."""

    def moved(value):
        if isinstance(value, dict):
            return {key: moved(entry) for key, entry in value.items()}
        if isinstance(value, str) and Path(value).suffix and os.path.isfile(value):
            return os.path.relpath(value, path.parent)
        return [moved(entry) for entry in value] if isinstance(value, list) else value

    title = f"# {pose.name} as a camera sees it that was found from {len(pose.points)} points.\n"
    with replacing(path) as partial:
        partial.write_text(title + text_of(moved(pose.tables)), encoding="utf-8")
