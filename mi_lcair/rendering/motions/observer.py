"""Motions of a scene's sensors and of its sun: where the observer is, and how the image lies.

======================================= ===========================================================
observer.azimuth_deg, .elevation_deg    direction from the origin of the scene's file to the
                                        observer: azimuth 0 is +x, 90 +y [deg]
observer.range_m                        distance of a perspective sensor from that origin [m]
observer.x_px, .y_px                    shift of the image to the right and down [pixels]
observer.roll_deg                       turn of the sensor about its axis, to the right [deg]
sun.azimuth_deg, .elevation_deg         direction of the emitter `sun`, with its light there [deg]
======================================= ===========================================================

All sensors of a scene move together. The values of the direction are those of the first one.
"""

import mitsuba as mi
import numpy as np
from scipy.spatial.transform import Rotation

from mi_lcair.plugins.emitters.thermal_emitter import one_sun
from mi_lcair.rendering.motions.motion import FULL_TURN_DEG, Motion
from mi_lcair.rendering.window import window

OBSERVER, SUN = "observer", "sun"
ANGLES = ("azimuth_deg", "elevation_deg")
KINDS = ("OrthographicCamera", "PerspectiveCamera")
LARGEST_PX, LARGEST_RANGE_M = 1e6, 1e7


def observer_motions(scene) -> list[Motion]:
    """The motions of the sensors that a scene was loaded with; none for other kinds of sensors."""
    sensors = scene.mi.sensors()
    if any(sensor.class_name() not in KINDS for sensor in sensors):
        return []
    azimuth, elevation, range_m = direction_of(matrix_of(sensors[0]), np.array(scene.origin))

    def motion(name: str, unit: str, rest: float, lower: float, upper: float) -> Motion:
        return Motion(f"{OBSERVER}.{name}", unit, rest, lower, upper, ())

    motions = [
        motion("azimuth_deg", "deg", azimuth, -FULL_TURN_DEG, FULL_TURN_DEG),
        motion("elevation_deg", "deg", elevation, -90.0, 90.0),
        motion("roll_deg", "deg", 0.0, -FULL_TURN_DEG, FULL_TURN_DEG),
        motion("x_px", "pixel", 0.0, -LARGEST_PX, LARGEST_PX),
        motion("y_px", "pixel", 0.0, -LARGEST_PX, LARGEST_PX),
    ]
    if sensors[0].class_name() == "PerspectiveCamera":
        motions.append(motion("range_m", "m", range_m, 1e-3 * range_m, LARGEST_RANGE_M))
    return motions


def sun_motions(scene) -> list[Motion]:
    """The motions of the emitter `sun`; none without one.

    A sun that a sky fits cannot leave it, see `one_sun`.
    """
    sun = one_sun(scene.mi.emitters())
    if sun is None:
        return []
    rests = zip(ANGLES, (sun.azimuth_deg, sun.elevation_deg), (FULL_TURN_DEG, 90.0))
    return [Motion(f"{SUN}.{n}", "deg", float(rest), -most, most, ()) for n, rest, most in rests]


def matrix_of(sensor) -> np.ndarray:
    """The transformation of a sensor to the scene, (4, 4), Float64."""
    return np.array(mi.traverse(sensor)["to_world"].matrix, dtype=float).reshape(4, 4)


def direction_of(matrix: np.ndarray, origin: np.ndarray) -> tuple[float, float, float]:
    """Azimuth and elevation [deg] and range [m] of a sensor from the origin of its file."""
    backward = -matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])
    azimuth = np.degrees(np.arctan2(backward[1], backward[0]))
    elevation = np.degrees(np.arcsin(np.clip(backward[2], -1, 1)))
    return float(azimuth), float(elevation) + 0.0, float((matrix[:3, 3] + origin) @ backward)


def settings_of(sensor) -> dict:
    """The parameters of a sensor that motions change, by Mitsuba's names."""
    parameters = mi.traverse(sensor)
    names = ("to_world", "principal_point_offset_x", "principal_point_offset_y")
    return {name: type(parameters[name])(parameters[name]) for name in names if name in parameters}


def set_sensor(sensor, settings: dict) -> None:
    parameters = mi.traverse(sensor)
    for name, value in settings.items():
        parameters[name] = value
    parameters.update()


def placed(sensor, loaded: dict, change: dict[str, float], rest: dict, origin) -> dict:
    """The parameters of a sensor for values of the motions.

    Parameters
    ----------
    sensor : mi.Sensor
    loaded : dict
        Its `settings_of` in the loaded scene.
    change : dict of str to float
        Differences of all motions from their values at rest, by the names behind `observer.`
    rest : dict of str to float
        The values at rest.
    origin : ndarray, shape (3,)
        Position of the scene's origin in the file's coordinates.
    """
    matrix = np.array(loaded["to_world"].matrix, dtype=float).reshape(4, 4)
    settings = dict(loaded)
    width, height = sensor.film().size()
    if sensor.class_name() == "OrthographicCamera":
        set_sensor(sensor, loaded)
        _, right, down, _ = window(sensor)
        columns, rows = sensor.film().crop_size()
        matrix[:3, 3] -= change["x_px"] * right / columns + change["y_px"] * down / rows
    else:
        for name, pixels in (("x", change["x_px"] / width), ("y", change["y_px"] / height)):
            key = f"principal_point_offset_{name}"
            settings[key] = loaded[key] - pixels
    axis = matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])
    matrix[:3, 3] -= change.get("range_m", 0.0) * axis
    roll = Rotation.from_rotvec(np.radians(change["roll_deg"]) * axis).as_matrix()
    matrix[:3, :3] = roll @ matrix[:3, :3]
    azimuth, elevation = rest["azimuth_deg"], rest["elevation_deg"]
    ends = azimuth + change["azimuth_deg"], elevation + change["elevation_deg"]
    turn = toward(*ends) @ toward(azimuth, elevation).T
    matrix[:3, :3] = turn @ matrix[:3, :3]
    matrix[:3, 3] = turn @ (matrix[:3, 3] + origin) - origin
    settings["to_world"] = type(loaded["to_world"])(mi.Matrix4f(matrix.tolist()))
    return settings


def toward(azimuth_deg: float, elevation_deg: float) -> np.ndarray:
    """The rotation of +x to a direction, (3, 3)."""
    return Rotation.from_euler("yz", [-elevation_deg, azimuth_deg], degrees=True).as_matrix()
