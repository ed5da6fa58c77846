"""Numbers that follow from what arrives at a sensor: temperature, range, noise."""

from abc import abstractmethod
from dataclasses import fields, replace
from functools import cached_property
from typing import get_args

import numpy as np
from scipy.optimize import brentq

from mi_lcair.camera.camera import Camera
from mi_lcair.camera.electronics.response import electron_band
from mi_lcair.camera.measures import netd
from mi_lcair.camera.quality import background_noise
from mi_lcair.camera.ranges.silhouette import Silhouette
from mi_lcair.camera.view import CameraView
from mi_lcair.declared import Bounds
from mi_lcair.detection.detection_range import detection_range
from mi_lcair.errors import InputError
from mi_lcair.physics.blackbody import brightness_temperature
from mi_lcair.physics.detector import Detector
from mi_lcair.physics.imager import Imager
from mi_lcair.rendering.parameters.entries import Parameter
from mi_lcair.uncertainty.numbers.contrast_number import ContrastNumber, Seen
from mi_lcair.uncertainty.numbers.number import SMALL, Linear

NEAR = 1.5  # ratio of ranges within which a changed detection range is sought first


class DerivedNumber(ContrastNumber):
    """A number that follows from what arrives at the sensor of a scenario.

    Besides the quantities of a contrast it depends on those of the sensor and of the camera:

    sensor.optics_transmittance, nei, snr     entries of [sensor] that the scenario states
    camera.f_number, read_noise_e, ...        numbers of [camera]

    A subclass sets title and unit and defines `value_of`.
    """

    has_weights = False

    @abstractmethod
    def value_of(self, seen: Seen) -> float:
        """The number for a target at the sensor."""

    def scenario_quantities(self):
        known = super().scenario_quantities() | numbers_of("sensor", self.setting.detector)
        known.pop("scenario.nei")  # an error of the contrast alone; sensor.nei is its size
        return known | numbers_of("camera", self.scenario.camera)

    def linear(self, total, areas, quantities):
        value = self.value_of(self.seen(total, areas, quantities))
        return Linear(np.ones(1), np.array([value]), np.zeros((1, 1)))

    @cached_property
    def of_intensity(self) -> float:
        """Derivative of the number with respect to the logarithm of the target's irradiance."""
        seen = self.seen(self.total, self.areas, {})
        low, high = (self.value_of(replace(seen, brightness=1 + end)) for end in (-SMALL, SMALL))
        return (high - low) / (2 * SMALL)

    @property
    def most_of_intensity(self) -> float:
        seen = self.seen(self.total, self.areas, {})
        return abs(self.of_intensity) / seen.parts()[0] * seen.irradiance.per_intensity(seen.path)

    @property
    def error(self) -> float:
        seen = self.seen(self.total, self.areas, {})
        of_contrast = ContrastNumber.linear(self, self.total, self.areas, {}).error
        scattered = abs(self.of_intensity) / seen.parts()[0] * of_contrast
        return float(np.hypot(scattered, self.unscattered * self.most_of_intensity))

    def camera(self, seen: Seen) -> Camera:
        """The camera before a background; raises InputError if the scenario has none."""
        if seen.imager is None:
            raise InputError(f"{self.title}: needs a table [camera]")
        behind = seen.setting.backdrop.at_sensor(seen.path.range_m).scaled(seen.factors[2])
        scenario = replace(self.scenario, camera=seen.imager)
        return Camera.of(scenario, seen.setting.detector, behind, seed=0)


def numbers_of(table: str, instrument: Detector | Imager | None) -> dict[str, Parameter]:
    """The numbers that a table [sensor] or [camera] states, with the bounds of their fields."""
    result = {}
    for entry in fields(instrument) if instrument is not None else ():
        value = getattr(instrument, entry.name)
        if value is not None and float in (entry.type, *get_args(entry.type)):
            bounds = entry.metadata.get("bounds", Bounds())
            lower = np.nextafter(0.0, 1.0) if bounds.is_positive else bounds.lower
            name = f"{table}.{entry.name}"
            limits = lower, bounds.upper
            result[name] = Parameter(name, "scenario", float(value), bounds.unit, *limits)
    return result


class ApparentTemperature(DerivedNumber):
    """Temperature of the blackbody that looks as bright as the target, mean over its area."""

    title, unit = "apparent temperature", "K"

    def value_of(self, seen):
        target, path, _ = seen.parts()
        radiance = (target + path) * seen.path.range_m**2 / seen.irradiance.amounts[-1]
        return float(brightness_temperature(seen.setting.detector.band, radiance))

    @property
    def error(self):
        """Standard error from the noise of the rendering, of which much is in the area too."""
        seen = self.seen(self.total, self.areas, {})
        amounts, (target, path, _) = seen.irradiance.amounts, seen.per_amount()
        arriving = (target + path) @ amounts
        covariance = ContrastNumber.linear(self, self.total, self.areas, {}).covariance
        of_ratio = np.append(target + path, 0.0)
        of_ratio[-2] -= arriving / amounts[-1]
        variance = max(of_ratio @ covariance @ of_ratio, 0.0)
        scattered = abs(self.of_intensity) / (target @ amounts) * np.sqrt(variance)
        return float(np.hypot(scattered, self.unscattered * self.most_of_intensity))


class DetectionRangeNumber(DerivedNumber):
    """Largest range at which the target is detected along its line of sight."""

    title, unit = "detection range", "m"
    first = None  # the range for the values of the scenario

    def value_of(self, seen):
        detector, air = seen.setting.detector, seen.setting.air

        def excess(range_m):
            signal = detector.signal(seen.at(air.path(range_m))["total"].value)
            return abs(signal) - detector.snr * detector.nei

        if self.first is not None:
            last = np.inf if air.is_vacuum else air.ranges_m[-1]
            ends = self.first / NEAR, min(self.first * NEAR, last)
            if excess(ends[0]) > 0 > excess(ends[1]):
                return float(brentq(excess, *ends, rtol=1e-10))
        result = detection_range(seen, detector, air, seen.setting.target.radius)
        if result.largest_m is None or result.at_least:
            raise InputError(f"has no end of the detection for a budget: {result.summary()}")
        if self.first is None:
            self.first = result.largest_m
        return result.largest_m


class SignalToNoise(DerivedNumber):
    """Signal of the target over the noise: of a camera with a matched filter, or of a sensor."""

    title, unit = "signal-to-noise ratio", "1"

    def band(self, detector, imager):
        if imager is None:
            return detector.band
        return electron_band(detector.band, imager, detector.optics_transmittance)

    def value_of(self, seen):
        contrast, detector, imager = seen.contrast(), seen.setting.detector, seen.imager
        if imager is None:
            if detector.nei is None:
                raise InputError(f"{self.title}: needs a table [camera], or nei of [sensor]")
            return float(abs(detector.signal(contrast)) / detector.nei)
        camera, range_m, target = self.camera(seen), seen.path.range_m, seen.setting.target
        view = CameraView.of(target, self.scenario.observer.view, range_m, imager)
        silhouette = Silhouette.of(self.scene, view, range_m)
        spread, _ = silhouette.spread(camera.optics.at(range_m), range_m)
        electrons = contrast / imager.pixel_angle**2
        return float(abs(electrons) * spread / background_noise(camera))


class Netd(DerivedNumber):
    """Noise-equivalent temperature difference of the camera at its background."""

    title, unit = "NETD", "K"

    def value_of(self, seen):
        camera = self.camera(seen)
        return netd(seen.imager, camera.band, camera.temperature, camera.design.offset)
