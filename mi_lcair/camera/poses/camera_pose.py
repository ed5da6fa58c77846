"""The pose of a camera from points, as a result, and as a scenario with this camera."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np

from mi_lcair.camera.poses.from_points import Solved, solve
from mi_lcair.camera.view import pointing_of
from mi_lcair.detection.scenario import POLAR, Observer, Scenario, change
from mi_lcair.detection.setting import target_scene
from mi_lcair.errors import InputError
from mi_lcair.files import replacing
from mi_lcair.rendering.statistics import student_factor
from mi_lcair.rendering.views import Target
from mi_lcair.results import Result, entry
from mi_lcair.results.cells import words_of
from mi_lcair.results.result import summary_of
from mi_lcair.results.sections import Table
from mi_lcair.toml_table import text_of

BESIDE = 1e-3  # distance of a ray's start from its point, in radii of the model
COLUMNS = ("x_m", "y_m", "z_m", "column_px", "row_px")


@dataclass(frozen=True, repr=False)
class CameraPose(Result):
    """Where a camera is that sees points of a scene in known pixels.

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
        Standard errors of turns about the directions to the right, upward, and along the axis.
    factor : float
        Half of a 95 % interval in standard errors (Student's, where the residuals are the noise).
    residual_px : ndarray, shape (n, 2)
        Predicted columns and rows less the given ones.
    observer : Observer
        The position from the middle of the scene's model.
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
    saved_by = {".toml": "mi_lcair.camera.poses.camera_pose:write_scenario"}

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
        columns = {"point": (range(1, 1 + len(self.points)), "")}
        columns |= {words_of(name): (values, ".5g") for name, values in self.columns().items()}
        yield Table.of(columns)

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
    solved = solve(points[:, :3], points[:, 3:], imager, sigma_px)
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
    maxt = mi.Float(np.minimum(distance, 2 * target.radius).astype(np.float32))
    ray = mi.Ray3f(mi.Point3f(o), mi.Vector3f(d), maxt, 0.0, [])
    return (1 + np.flatnonzero(scene.mi.ray_test(ray).numpy())).tolist()


def remarks_on(solved: Solved, sigma_px: float | None, hidden: list[int]) -> tuple[str, ...]:
    """What a user should know about a pose. hidden: numbers of the points that are hidden there."""
    remarks = []
    if hidden:
        remarks.append(
            f"from there the model hides point {', '.join(map(str, hidden))} of "
            f"{len(solved.residual_px)}: do the rows go down, and are x, y, z right-handed?"
        )
    if solved.second is not None:
        place = ", ".join(f"{value:.4g}" for value in solved.second.eye)
        remarks.append(
            f"a second pose explains the points as well, at ({place}) m; points off their plane, "
            "or nearer ones, decide between the two"
        )
    if sigma_px is not None and solved.rms_px > 2 * sigma_px:
        remarks.append(
            f"the points miss their pixels by {solved.rms_px:.2g} (rms), more than sigma = "
            f"{sigma_px:g}; the errors are too small: check focal length, pixels and points"
        )
    freedom = solved.residual_px.size - 6
    if sigma_px is None and freedom < 4:
        remarks.append(
            f"{len(solved.residual_px)} points leave {freedom} degrees of freedom for the noise: "
            f"half of an interval is {student_factor(freedom):.3g} standard errors; state "
            "sigma, or add points"
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
