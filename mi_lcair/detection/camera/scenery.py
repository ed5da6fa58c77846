"""What is behind the target in a camera's frame: sky and ground by the direction of each pixel."""

from dataclasses import dataclass

import numpy as np

from mi_lcair.detection.camera.exposure import detector_mean
from mi_lcair.detection.camera.optics import FARTHEST, MARGIN, OVERSAMPLING, Optics
from mi_lcair.detection.camera.view import CameraView
from mi_lcair.detection.irradiance import Backdrop
from mi_lcair.detection.line_of_sight import background_sun, surroundings_of
from mi_lcair.detection.scenario import Scenario
from mi_lcair.detection.setting import Setting
from mi_lcair.physics.bands import Band
from mi_lcair.physics.surroundings import Surroundings

FINER = 8  # parts of a row of samples at the horizon
LEVEL = 0.03  # rise of a horizon that counts as level, as a share of the frame's width
BESIDE_HORIZON_DEG = 1e-3  # elevation from the horizon of what stands for a missing sky or ground


@dataclass(frozen=True)
class Scenery:
    """Background of a frame.

    Attributes
    ----------
    view : CameraView
    behind : Backdrop
        Background along the line of sight to the target's middle, at the sensor.
    sight : tuple of float
        Elevation of this line at the sensor, and its azimuth from the sun, degrees.
    around : Surroundings or None
        Sky and ground around the sensor; None where the background is the same in all directions.
    scale : float
        Factor of the light of the sky, also of what the ground reflects of it.
    """

    view: CameraView
    behind: Backdrop
    sight: tuple[float, float]
    around: Surroundings | None
    scale: float = 1.0

    @staticmethod
    def of(scenario: Scenario, setting: Setting, view: CameraView, scale: float = 1.0) -> "Scenery":
        """The background of a scenario in a view of its camera."""
        range_m = scenario.observer.range_m
        around = surroundings_of(scenario, setting.sight)
        if view.imager.projection == "orthographic":
            around = None
        sun = setting.sun or background_sun(scenario) or (0.0, 0.0)
        azimuth = scenario.observer.azimuth_deg + 180 - sun[0]
        elevation = setting.sight.elevation_at_sensor(range_m)
        behind = setting.backdrop.at_sensor(range_m)
        if around is None and not setting.sight.meets_ground:
            behind = behind.scaled(scale)
        return Scenery(view, behind, (elevation, azimuth), around, scale)

    def level(self, rule: Band) -> float:
        """In-band value of the background along the line of sight."""
        return detector_mean(self.behind, rule)

    def directions(self, columns, rows) -> tuple[np.ndarray, np.ndarray]:
        """Elevations, and azimuths from the sun, of places in the frame, degrees, (rows, columns).

        columns, rows: in pixels, rising arrays.
        """
        view, imager = self.view, self.view.imager
        x = (columns - imager.width / 2)[None, :, None] * imager.pixel_angle
        y = (imager.height / 2 - rows)[:, None, None] * imager.pixel_angle
        away = view.axis + x * view.right + y * view.up
        horizontal = np.hypot(away[..., 0], away[..., 1])
        elevation = np.degrees(np.arctan2(away[..., 2], horizontal))
        azimuth = np.degrees(np.arctan2(away[..., 1], away[..., 0]))
        line = view.toward
        turned = self.sight[0] - np.degrees(np.arctan2(line[2], np.hypot(line[0], line[1])))
        return elevation + turned, azimuth - np.degrees(np.arctan2(line[1], line[0])) + self.sight[
            1
        ]

    def at(self, rule: Band, columns, rows) -> np.ndarray:
        """In-band values of the background at places in the frame, (rows, columns).

        Along the line of sight they are `level`. Beyond the horizon of a background without a sky
        or without a ground, they are those beside the horizon.
        """
        level = self.level(rule)
        if self.around is None:
            return np.full((len(rows), len(columns)), level)
        horizon = self.around.horizon_deg
        elevation, azimuth = self.directions(np.asarray(columns), np.asarray(rows))
        lowest = -np.inf if self.around.ground is not None else horizon + BESIDE_HORIZON_DEG
        highest = np.inf if self.around.sky is not None else horizon - BESIDE_HORIZON_DEG
        elevations = np.clip(np.append(elevation, self.sight[0]), lowest, highest)
        azimuths = np.append(azimuth, self.sight[1])
        emitted, other = self.around.in_band_components(rule, elevations, azimuths)
        of_sky = other + np.where(elevations >= horizon, emitted, 0)
        values = emitted + other + (self.scale - 1) * of_sky
        # The air of a user's table is not that of the surroundings
        same_side = (elevation >= horizon) == (self.sight[0] >= horizon)
        missing = level - emitted[-1] - other[-1]
        return values[:-1].reshape(elevation.shape) + missing * same_side

    def of_parts(self, rule: Band) -> np.ndarray:
        """In-band values behind the parts of the view's window, (rows, columns)."""
        view = self.view
        return self.at(
            rule,
            *((start + np.arange(n) + 0.5) / view.parts for start, n in zip(view.first, view.size)),
        )

    def image(self, rule: Band, optics: Optics) -> np.ndarray | float:
        """In-band values of the frame without a target, as the optics blur them, (H, W)."""
        level = self.level(rule)
        if self.around is None:
            return level
        places = [
            (np.arange(-MARGIN * OVERSAMPLING, (n + MARGIN) * OVERSAMPLING) + 0.5) / OVERSAMPLING
            for n in (self.view.imager.width, self.view.imager.height)
        ]
        if not self.horizon_between(*places):  # the background is smooth
            return self.at(rule, *self.pixels)
        columns, rows = places
        # The horizon is highest or lowest in the middle of the frame, or at its sides
        some, borders = columns[[0, len(columns) // 2, -1]], np.arange(len(rows) + 1)
        borders = borders / OVERSAMPLING - MARGIN
        above = self.directions(some, borders)[0] >= self.around.horizon_deg
        (crossed,) = np.nonzero(np.any(above[1:] != above[:-1], axis=1))
        crossed = np.arange(crossed.min(initial=len(rows)), crossed.max(initial=-1) + 1)
        if is_level := len(crossed) < LEVEL * len(columns):
            columns, _ = self.pixels
        samples = self.at(rule, columns, rows) - level
        # Rows of samples that the horizon crosses are means of finer rows
        parts = (np.arange(FINER) + 0.5) / (FINER * OVERSAMPLING)
        finer = self.at(rule, columns, (borders[crossed, None] + parts).ravel()) - level
        samples[crossed] = finer.reshape(-1, FINER, len(columns)).mean(axis=1)
        far = FARTHEST // 2
        cut = (-MARGIN - far, -MARGIN - far)
        if is_level:
            samples = np.pad(samples, ((OVERSAMPLING * far,) * 2, (0, 0)), mode="edge")
            return level + optics.seen_along_columns(samples, cut)
        samples = np.pad(samples, OVERSAMPLING * far, mode="edge")
        return level + optics.seen(samples, (cut, cut))

    def horizon_between(self, columns, rows) -> bool:
        """Whether the horizon is between these places of the frame."""
        above = self.directions(columns, rows[[0, -1]])[0] >= self.around.horizon_deg
        return bool(above.any() and not above.all())

    @property
    def pixels(self) -> tuple[np.ndarray, np.ndarray]:
        """Columns and rows of the pixels' middles."""
        return tuple(np.arange(n) + 0.5 for n in (self.view.imager.width, self.view.imager.height))

    def missing(self) -> list[str]:
        """Remark on pixels in which the background has no sky or no ground, in a list."""
        around = self.around
        if around is None or (around.sky is not None and around.ground is not None):
            return []
        above = self.directions(*self.pixels)[0] >= around.horizon_deg
        share = float(np.mean(above if around.sky is None else ~above))
        if share == 0:
            return []
        what, entry = ("sky", "sky") if around.sky is None else ("ground", "ground_temperature")
        return [
            f"{share:.0%} of the pixels look at the {what}, but [background] has no {what}: they "
            f"get the radiance at the horizon; give [background] {entry}"
        ]
