"""Rays of orthographic sensors, from a few arrays instead of the sensor."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from mi_lcair.plugins.derivatives import children

# Positions in the film of a sensor at which rays are taken. Those of a batch must lie inside the
# film, because the edge belongs to the next sensor.
NEAR, FAR = 0.25, 0.75


@dataclass
class ParallelRays:
    """The rays of an orthographic sensor, or of a batch of them next to each other in a film.

    A recorded launch cannot read a sensor. It gets these arrays instead, with one entry for each
    sensor, and one kernel traces the paths of any number of sensors.

    start: start of the ray at the position (NEAR, NEAR) of the sensor's film [m]. right, up: change
    of the start along the sides of the film [m]. direction: unit vector. length: length of the rays
    [m]. sensors: number of sensors.
    """

    start: mi.Point3f
    right: mi.Vector3f
    up: mi.Vector3f
    direction: mi.Vector3f
    length: mi.Float
    sensors: mi.UInt32

    @staticmethod
    def of(sensor) -> "ParallelRays | None":
        """The rays of a sensor; None if it is not orthographic."""
        kinds = [sensor]
        if sensor.class_name() == "BatchSensor":
            kinds = [child for child in children(sensor) if isinstance(child, mi.Sensor)]
        if any(kind.class_name() != "OrthographicCamera" for kind in kinds):
            return None
        # An opaque number, so that one kernel serves any number of sensors
        count = dr.opaque(mi.UInt32, len(kinds))
        index = dr.arange(mi.UInt32, 3 * len(kinds))
        first, corner = 3 * dr.arange(mi.UInt32, len(kinds)), index % 3
        x = (mi.Float(index // 3) + dr.select(corner == 1, FAR, NEAR)) / mi.Float(count)
        position = mi.Point2f(x, dr.select(corner == 2, FAR, NEAR))
        ray, _ = sensor.sample_ray(0, 0, position, mi.Point2f(0.5))
        dr.eval(ray)
        start, at_right, at_top = (dr.gather(mi.Point3f, ray.o, first + k) for k in range(3))
        rays = ParallelRays(
            start,
            mi.Vector3f(at_right - start) / (FAR - NEAR),
            mi.Vector3f(at_top - start) / (FAR - NEAR),
            dr.gather(mi.Vector3f, ray.d, first),
            dr.gather(mi.Float, ray.maxt, first),
            count,
        )
        dr.make_opaque(rays)
        return rays

    def at(self, column, row, position, columns, rows) -> mi.Ray3f:
        """Rays at positions in the windows of the film.

        Parameters
        ----------
        column, row : mi.UInt32
            The window.
        position : mi.Point2f
            Position in the window, in 0..1.
        columns, rows : mi.UInt32
            Number of windows along the sides of the film.
        """
        of_sensor = columns // self.sensors
        sensor = column // of_sensor
        x = (mi.Float(column % of_sensor) + position.x) / mi.Float(of_sensor)
        y = (mi.Float(row) + position.y) / mi.Float(rows)
        take = lambda kind, values: dr.gather(kind, values, sensor)
        start = (
            take(mi.Point3f, self.start)
            + (x - NEAR) * take(mi.Vector3f, self.right)
            + (y - NEAR) * take(mi.Vector3f, self.up)
        )
        direction = take(mi.Vector3f, self.direction)
        return mi.Ray3f(start, direction, take(mi.Float, self.length), 0, [])
