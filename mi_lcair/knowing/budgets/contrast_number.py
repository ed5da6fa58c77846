"""The contrast of a scenario as a number with an uncertainty budget."""

import re
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property, partial
from typing import get_args

import numpy as np
from scipy.optimize import brentq

from mi_lcair.declared import Bounds
from mi_lcair.derivatives.common_numbers import CommonNumbers
from mi_lcair.derivatives.motions.differences import poses_around
from mi_lcair.detection.camera.electronics import Camera, electron_band
from mi_lcair.detection.camera.measures import background_noise, matched_ratio, netd
from mi_lcair.detection.camera.ranges import Silhouette
from mi_lcair.detection.camera.view import CameraView
from mi_lcair.detection.detection_range import SLOPE_STEP, detection_range, searched_ranges
from mi_lcair.detection.irradiance import (
    QUANTITIES,
    TERMS,
    Backdrop,
    Irradiance,
    RenderError,
    in_weather,
    weather_quantities,
)
from mi_lcair.detection.line_of_sight import backdrop
from mi_lcair.detection.scenario import Scenario
from mi_lcair.detection.setting import Setting, holding
from mi_lcair.errors import InputError
from mi_lcair.estimate import Estimate
from mi_lcair.knowing.budgets.number import SMALL, Linear, Number
from mi_lcair.physics.air.atmosphere import LineOfSight
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import brightness_temperature, spectral_radiance
from mi_lcair.physics.imager import Detector, Imager
from mi_lcair.plugins.emitters.thermal_emitter import is_thermal
from mi_lcair.plugins.properties import RADIANCE_UNIT
from mi_lcair.rendering.measurands import ExcessFunction
from mi_lcair.rendering.parameters.entries import Parameter
from mi_lcair.rendering.parameters.values import parameters_of
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.statistics import Totals
from mi_lcair.signatures.effective_areas import PARTS, SPECTRUM_ROWS

# Parameters of surroundings, and the entries of the background that they are
BEHIND = {
    "ground.temperature": "ground_temperature",
    "ground.emissivity": "ground_emissivity",
    "sky.temperature": "sky",
    "sky.scale": None,
}
TARGET, PATH, BACKGROUND = (TERMS.index(name) for name in ("target", "path", "background"))
# Quantities that the irradiances of target, path and background are proportional to
AMOUNTS = "transmittance", "path_radiance", "background_radiance"
MOST_SIGMA = 4  # standard deviations of a motion over which the target stays in the window
SPECTRAL = re.compile(r"scenario\.transmittance@(\d+\.?\d*)-(\d+\.?\d*)")  # wavelengths in um


@dataclass(frozen=True)
class Seen:
    """A target at the sensor, for some values of a scenario's quantities.

    irradiance: its irradiances. setting, path: what they are seen in. imager: the camera, if there
    is one. factors: of AMOUNTS, (3,). shares: factor of the transmittance at each wavelength of
    `irradiance`, (n,), or 1. brightness: factor of the target's irradiance.
    """

    irradiance: Irradiance
    setting: Setting
    path: LineOfSight
    imager: Imager | None
    factors: np.ndarray
    shares: np.ndarray | float = 1.0
    brightness: float = 1.0

    def per_amount(self, range_m: float | None = None) -> np.ndarray:
        """Irradiances of target, path and background per amount, (3, amounts), also at a range [m].

        The optical depth of the mean transmittance has the same relative error at all ranges.
        """
        path = self.path if range_m is None else self.setting.air.path(range_m)
        power, irradiance = 1.0, self.irradiance
        if range_m is not None and (self.factors[0] != 1 or np.any(self.shares != 1)):
            depth = self.depth(self.path)
            power = self.depth(path) / depth if depth > 0 else 1.0
        per_amount = irradiance.per_amount(path)[[TARGET, PATH, BACKGROUND]]
        if np.any(self.shares != 1):
            weights = irradiance.weights_um * self.shares**power / path.range_m**2
            per_amount[0, :-1] = irradiance.arriving(path) @ weights
        factors = self.factors ** [power, 1, 1] * [self.brightness, 1, 1]
        return per_amount * factors[:, None]

    def depth(self, path: LineOfSight) -> float:
        """Optical depth of the mean transmittance of a path, without `factors`."""
        weights = self.irradiance.weights_um
        mean = path.at(self.irradiance.wavelengths_um)[0] @ weights / weights.sum()
        return -float(np.log(max(mean, np.finfo(float).tiny)))

    def parts(self, range_m: float | None = None) -> np.ndarray:
        """Irradiances of target, path and background, (3,), also at a range [m]."""
        return self.per_amount(range_m) @ self.irradiance.amounts

    def contrast(self, range_m: float | None = None) -> float:
        """Contrast irradiance, also at a range [m]."""
        target, path, background = self.parts(range_m)
        return float(target + path - background)

    def at(self, path: LineOfSight) -> dict[str, Estimate]:
        """The contrast at the end of a path, as `detection_range` asks for it, without an error."""
        return {"total": Estimate(self.contrast(path.range_m), 0.0)}


class ContrastNumber(Number):
    """Contrast irradiance of a scenario's target at the sensor, W m^-2.

    Besides the parameters of the scene it depends on these quantities:

    scenario.transmittance         mean transmittance of the path; its spectrum keeps its shape
    scenario.transmittance@8-9     the same between two wavelengths [um]; others stay as they are
    scenario.path_radiance         radiance of the path, likewise
    scenario.background_radiance   radiance of the background, likewise
    scenario.background_temperature  temperature of a background that is a blackbody [K]
    scenario.range_m               range; the path changes with it [m]
    scenario.nei                   noise of the sensor, an irradiance [W m^-2]
    scenario.air_temperature, air_humidity, air_pressure, visibility, co2
                                   weather of a clear air along the path, and of sun and sky

    Parameters
    ----------
    scenario : Scenario
        The largest of its numbers of reflections is used.
    names : sequence of str
        Quantities that will be asked for.

    The scene must have the scenario's lobe and number of reflections while the number is used.
    """

    title, unit = "contrast", "W m^-2"

    def __init__(self, scenario: Scenario, setting: Setting, names=()):
        self.scenario, self.setting = scenario, setting
        self.scene, self.what = setting.view, scenario.name
        self.known = parameters_of(self.scene) | self.scenario_quantities()
        self.known |= {name: self.in_interval(name) for name in names if in_um(name)}
        self.sampling = scenario.render.of_render()
        self.criterion = ExcessFunction(self.excess) if scenario.render.has_tolerance else None
        self.numbers = CommonNumbers(self.scene, self.sampling, True, criterion=self.criterion)

    def make_room(self, names, sigma):
        poses = [
            pose
            for name, deviation in zip(names, sigma)
            if self.known[name].kind == "motion"
            for pose in poses_around(self.scene, name, MOST_SIGMA / 2 * deviation)
        ]
        if poses:
            self.setting = holding(self.setting, self.scenario, poses)
            self.scene = self.setting.view
            self.numbers = CommonNumbers(self.scene, self.sampling, True, criterion=self.criterion)

    def start(self):
        super().start()
        if not self.areas.projected_area > 0:
            raise InputError("no ray hit the target; raise resolution or spp of [render]")

    def scenario_quantities(self) -> dict[str, Parameter]:
        """The scenario's quantities and their values, by name."""
        setting, band = self.setting, self.setting.detector.band
        extrapolate, range_m = self.scenario.atmosphere.extrapolate, setting.path.range_m
        x = np.linspace(band.lower_um, band.upper_um, SPECTRUM_ROWS)
        background = np.trapezoid(
            setting.backdrop.at_sensor(range_m).at(x) * band.response_at(x), x
        )
        transmittance = setting.air.transmittance_mean(band, range_m, extrapolate)
        (path_radiance,) = setting.air.band_path_radiance(band, [range_m], extrapolate)
        values = {
            "transmittance": (transmittance, "1", 0.0, 1.0),
            "path_radiance": (path_radiance, RADIANCE_UNIT, 0.0, np.inf),
            "background_radiance": (background, RADIANCE_UNIT, 0.0, np.inf),
            "range_m": (range_m, "m", setting.target.radius, self.farthest),
            "nei": (0.0, self.unit, -np.inf, np.inf),
        }
        temperature = self.scenario.background.temperature
        if temperature is not None:
            values["background_temperature"] = (temperature, "K", 1.0, np.inf)
        return weather_quantities(self.scenario.atmosphere) | {
            f"scenario.{name}": Parameter(
                f"scenario.{name}", "scenario", float(value), unit, lower, upper
            )
            for name, (value, unit, lower, upper) in values.items()
        }

    def in_interval(self, name: str) -> Parameter:
        """The mean transmittance of the path between the wavelengths in its name."""
        start, end = in_um(name)
        band = self.setting.detector.band
        if not band.lower_um <= start < end <= band.upper_um:
            raise InputError(
                f"'{name}': must name two rising wavelengths within {band.lower_um:g}-"
                f"{band.upper_um:g} um"
            )
        mean = self.setting.path.at(np.linspace(start, end, SPECTRUM_ROWS))[0].mean()
        return Parameter(name, "scenario", float(mean), "1", 0.0, 1.0)

    @property
    def farthest(self) -> float:
        """Largest range that the atmosphere allows [m]."""
        air = self.setting.air
        if air.is_vacuum or self.scenario.atmosphere.extrapolate:
            return np.inf
        return float(air.ranges_m[-1])

    def irradiance(
        self, total: Totals, areas, setting: Setting | None = None, band: Band | None = None
    ) -> Irradiance:
        """Irradiances of a render, also in another setting and in another band."""
        setting = setting or self.setting
        # The ends of intervals of wavelength are met exactly
        ends = [end for name in self.known for end in in_um(name)]
        rows_um = np.union1d(setting.backdrop.rows_um, ends)
        return Irradiance(
            areas,
            RenderError(
                total.randomisations - 1,
                float(total.missed("target")[0] * self.numbers.area),
            ),
            band or setting.detector.band,
            setting.air,
            setting.backdrop._replace(rows_um=rows_um),
        )

    def band(self, detector: Detector, imager: Imager | None) -> Band:
        """Band in which irradiances count."""
        return detector.band

    def instruments(self, quantities: Mapping) -> tuple[Detector, Imager | None]:
        """Detector and camera for other values of their quantities, `sensor.` and `camera.`."""
        changes = {"sensor": {}, "camera": {}}
        for name, value in quantities.items():
            owner, _, entry = name.partition(".")
            if owner in changes and self.is_own(name):
                changes[owner][entry] = value
        imager = self.scenario.camera
        return (
            replace(self.setting.detector, **changes["sensor"]),
            imager and replace(imager, **changes["camera"]),
        )

    def excess(self, total: Totals) -> float:
        """Ratio of the half width of the contrast's 95 % interval to the allowed one."""
        terms, path = self.irradiance(total, self.areas_of(total)), self.setting.path
        allowed = self.scenario.render.allowed(terms.at(path)["total"].value)
        return terms.half_width(path) / allowed if allowed > 0 else np.inf

    def seen(self, total, areas, quantities) -> Seen:
        """The target of a render for other values of quantities."""

        def value(name):
            return quantities.get(f"scenario.{name}")

        setting = self.setting
        if weather := {name: quantities[name] for name in QUANTITIES if name in quantities}:
            setting = setting.through(in_weather(self.scenario, weather))
            if areas.sources:
                areas = replace(areas, sources=setting.light.sources(self.scene, areas.sources))
        detector, imager = self.instruments(quantities)
        behind = self.backdrop(setting, quantities)
        setting = replace(setting, detector=detector, backdrop=behind)
        path = setting.path
        if value("range_m") is not None:
            path = setting.air.path(value("range_m"), self.scenario.atmosphere.extrapolate)
        factors = {
            name: value(name) / was if value(name) is not None and was else 1.0
            for name in AMOUNTS
            for was in [self.known[f"scenario.{name}"].value]
        }
        irradiance = self.irradiance(total, areas, setting, self.band(detector, imager))
        x, shares = irradiance.wavelengths_um, 1.0
        for name, changed in quantities.items():
            if interval := in_um(name):
                is_inside = (x >= interval[0]) & (x < interval[1])
                shares = shares * np.where(is_inside, changed / self.known[name].value, 1.0)
        return Seen(irradiance, setting, path, imager, np.array(list(factors.values())), shares)

    def terms(self, total, areas, quantities) -> tuple[Irradiance, np.ndarray]:
        """Irradiances, and the target's, the path's and the background's part per amount."""
        seen = self.seen(total, areas, quantities)
        return seen.irradiance, seen.per_amount()

    def linear(self, total, areas, quantities):
        irradiance, (target, path, background) = self.terms(total, areas, quantities)
        whole = np.zeros((len(target) + 1,) * 2)
        whole[:-1, :-1] = irradiance.covariance
        return Linear(
            np.append(target + path - background, 1.0),
            np.append(irradiance.amounts, quantities.get("scenario.nei", 0.0)),
            whole,
        )

    # ------------------------------------------------------------------ Surroundings

    def is_stated(self, name):
        """Also parameters of surroundings, which are behind the target too."""
        is_behind = name in BEHIND and self.scenario.surroundings is not None
        return is_behind or super().is_stated(name)

    def derivatives(self, names, sigma):
        slopes, errors = super().derivatives(names, sigma)
        for k, name in enumerate(names):
            # Differences of the number know of the background already
            if self.is_stated(name) and self.needs_render(name) and self.has_weights:
                value, step = self.known[name].value, SMALL * sigma[k]
                ends = self.within(name, value - step), self.within(name, value + step)
                low, high = (self.linear(self.total, self.areas, {name: v}).value for v in ends)
                slopes[k] += (high - low) / (ends[1] - ends[0])
        return slopes, errors

    def backdrop(self, setting: Setting, quantities: Mapping) -> Backdrop:
        """The background of a setting for other values of quantities."""
        result = setting.backdrop
        for name, value in quantities.items():
            if name == "scenario.background_temperature":
                at = partial(spectral_radiance, temperature=value)
                result = Backdrop(result.name, at, result.rows_um)
            elif name == "sky.scale":
                factor = value / (self.known[name].value or 1.0)
                result = result if setting.sight.meets_ground else result.scaled(factor)
        scenario = before(self.scenario, quantities)
        if scenario is not self.scenario:
            result = backdrop(scenario, setting.detector, setting.sight)
        return result

    @property
    def has_weights(self):
        return self.is_linear

    def weights(self):
        factors = self.terms(self.total, self.areas, {})[1][0]
        return {
            (source.group, source.name): factor / source.in_band if source.in_band > 0 else 0.0
            for source, factor in zip(self.areas.sources, factors)
        }

    @property
    def most_of_intensity(self) -> float:
        irradiance, _ = self.terms(self.total, self.areas, {})
        return irradiance.per_intensity(self.setting.path)

    @property
    def of_intensity(self) -> float:
        irradiance, (target, *_) = self.terms(self.total, self.areas, {})
        return float(target @ irradiance.amounts)


def before(scenario: Scenario, values: Mapping) -> Scenario:
    """The scenario before sky and ground with other values of BEHIND."""
    behind = {entry: values[name] for name, entry in BEHIND.items() if entry and name in values}
    if not behind:
        return scenario
    if "sky" in behind:
        behind["sky"] = repr(float(behind["sky"]))
    return replace(scenario, background=replace(scenario.background, **behind))


def present(scenario: Scenario, setting: Setting) -> tuple[Scenario, Setting, float]:
    """Scenario and setting before the sky and ground that the scene has now, and the sky's scale.

    The scenario has [surroundings]. The scale is not in its setting.
    """
    known = parameters_of(setting.view)
    values = {name: known[name].value for name in BEHIND if name in known}
    scenario = before(scenario, values)
    behind = backdrop(scenario, setting.detector, setting.sight)
    return scenario, replace(setting, backdrop=behind), values.get("sky.scale", 1.0)


def in_um(name: str) -> tuple[float, ...]:
    """Ends of the interval of wavelengths that a quantity's name states [um]; () for none."""
    match = SPECTRAL.fullmatch(name)
    return tuple(map(float, match.groups())) if match else ()


# Numbers that follow from what arrives at a sensor: temperature, range, noise
# ----------------------------------------------------------------------------

NEWTON = 4  # steps to the end of a detection between two ranges
NEAR = 1.5  # ratio of ranges within which a changed detection range is sought first


class DerivedNumber(ContrastNumber):
    """A number that follows from what arrives at the sensor of a scenario.

    Besides the quantities of a contrast it depends on those of the sensor and of the camera:

    sensor.optics_transmittance, nei, snr     entries of [sensor] that the scenario states
    camera.f_number, read_noise_e, ...        numbers of [camera]

    A subclass sets title and unit and defines `value_of`. If that is the size of something with a
    sign, `smooth_of` is what has the sign.
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
        seen = self.seen(total, areas, quantities)
        return Linear.known(self.value_of(seen), partial(self.smooth_of, seen))

    def smooth_of(self, seen: Seen) -> np.ndarray:
        """What the number follows from, smooth in all quantities, (m,)."""
        return np.array([self.value_of(seen)])

    def closed_derivative(self, name, sigma):
        (high, low), width = self.closed_ends(name, sigma)
        return self.along(name, (high.smooth - low.smooth) / width), 0.0

    @cached_property
    def brighter(self):
        seen = self.seen(self.total, self.areas, {})
        low, high = (self.smooth_of(replace(seen, brightness=1 + end)) for end in (-SMALL, SMALL))
        return (high - low) / (2 * SMALL)

    @property
    def of_intensity(self) -> float:
        """Derivative of the number with respect to the logarithm of the target's irradiance."""
        return self.slope(self.brighter)

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
            is_last = air.is_vacuum or excess(last) < 0
            if is_last and excess(ends[0]) > 0 > excess(ends[1]):
                return float(brentq(excess, *ends, rtol=1e-10))
        result = detection_range(seen, detector, air, seen.setting.target.radius)
        if self.first is None:
            if result.largest_m is None or result.at_least:
                raise InputError(f"has no end of detection for a budget: {result.summary()}")
            self.first = result.largest_m
        return result.largest_m or 0.0

    # The signal over the least one, with its sign, at each range. The number is the largest range
    # where its size is 1 or more.

    @cached_property
    def ranges_m(self) -> np.ndarray:
        """Rising ranges, of which `first` is one; in vacuum the only one."""
        if self.setting.air.is_vacuum:
            return np.array([self.first])
        return np.union1d(searched_ranges(self.setting.air, self.setting.target.radius), self.first)

    def signals(self, seen: Seen, ranges_m) -> np.ndarray:
        detector = seen.setting.detector
        contrasts = np.array([seen.contrast(range_m) for range_m in ranges_m])
        return detector.signal(contrasts) / (detector.snr * detector.nei)

    def smooth_of(self, seen):
        return self.signals(seen, self.ranges_m)

    def results(self, smooth):
        r, nearest = self.ranges_m, self.setting.target.radius
        if len(r) == 1:  # in vacuum the signal falls as 1 / range^2
            largest = r * np.sqrt(np.abs(smooth[:, 0]))
            return np.where(largest > nearest, largest, 0.0)
        last = len(r) - 1 - np.argmax(np.abs(smooth[:, ::-1]) >= 1, axis=1)
        draw, k = np.arange(len(smooth)), np.minimum(last, len(r) - 2)
        # Between two ranges the signal times range^2 is linear in the logarithm of range
        ends = smooth[draw, [k, k + 1]] * r[[k, k + 1]] ** 2 * np.sign(smooth[draw, k])
        width, t = np.log(r[k + 1] / r[k]), np.ones(len(smooth))
        for _ in range(NEWTON):
            least, slope = (r[k] * np.exp(width * t)) ** 2, ends[1] - ends[0]
            t -= (ends[0] + t * slope - least) / (slope - 2 * width * least)
        largest = np.where(last == len(r) - 1, r[-1], r[k] * np.exp(width * np.clip(t, 0, 1)))
        return np.where(np.any(np.abs(smooth) >= 1, axis=1), largest, 0.0)

    def slope(self, direction):
        seen, step = self.seen(self.total, self.areas, {}), SLOPE_STEP * self.first
        low, high = self.signals(seen, [self.first - step, self.first + step])
        return float(-direction[self.signed_column] * 2 * step / (high - low))

    @property
    def signed_column(self) -> int:
        return int(np.searchsorted(self.ranges_m, self.first))

    @property
    def unit_change(self):
        change = self.brighter if self.of_intensity else self.present
        return change / self.slope(change)


class SignalToNoise(DerivedNumber):
    """Signal of the target over the noise: of a camera with a matched filter, or of a sensor."""

    title, unit = "signal-to-noise ratio", "1"

    def band(self, detector, imager):
        if imager is None:
            return detector.band
        return electron_band(detector.band, imager, detector.optics_transmittance)

    signed_column = 0

    def value_of(self, seen):
        return abs(self.signed(seen))

    def smooth_of(self, seen):
        return np.array([self.signed(seen)])

    def results(self, smooth):
        return np.abs(smooth[:, 0])

    def slope(self, direction):
        return float(np.copysign(1, self.present[0]) * direction[0])

    def signed(self, seen: Seen) -> float:
        """The ratio with the sign of the contrast."""
        contrast, detector, imager = seen.contrast(), seen.setting.detector, seen.imager
        if imager is None:
            if detector.nei is None:
                raise InputError(f"{self.title}: needs a table [camera], or nei of [sensor]")
            return float(detector.signal(contrast) / detector.nei)
        camera, range_m, target = self.camera(seen), seen.path.range_m, seen.setting.target
        view = CameraView.of(target, self.scenario.observer.view, range_m, imager)
        silhouette = Silhouette.of(self.scene, view, range_m)
        outline, pixels = silhouette.seen(camera, range_m)[0], silhouette.pixels(range_m)
        electrons = contrast / imager.pixel_angle**2  # of the whole target, taken as even
        shared = camera.pattern.products(outline[None])[0, 0]
        ratio = matched_ratio(np.sum(outline**2), shared, background_noise(camera))
        return float(electrons / pixels * ratio)


class Netd(DerivedNumber):
    """Noise-equivalent temperature difference of the camera at its background."""

    title, unit = "NETD", "K"

    def value_of(self, seen):
        camera = self.camera(seen)
        return netd(camera.imager, camera.band, camera.temperature, camera.design.offset)


# The intensity of a scene's target as a number with an uncertainty budget
# ------------------------------------------------------------------------


class IntensityNumber(Number):
    """Intensity of a scene's target toward an orthographic sensor, W/sr.

    Parameters
    ----------
    scene : Scene
    part : str
        "target", or "scene" for all in the sensor's window.
    sampling : Sampling
        As for `CommonNumbers`.
    """

    unit = "W/sr"

    def __init__(self, scene, sampling: Sampling, part: str = "target"):
        self.title = f"intensity of the {part}"
        self.part, self.scene, self.what = part, scene, scene.name
        self.known = parameters_of(scene)
        self.numbers = CommonNumbers(scene, sampling, has_spectra(scene), part)

    def linear(self, total, areas, quantities):
        name = None if self.part == "scene" else self.part
        if areas is None or areas.nodes_um.size:
            mean, error = total.mean(name)[0], total.standard_error(name)[0]
            area = self.numbers.area
            return Linear(np.ones(1), np.array([mean * area]), np.array([[(error * area) ** 2]]))
        p = PARTS.index(self.part)
        factors = np.array([source.in_band_radiance(areas.band) for source in areas.sources])
        # What a closure adds belongs to no source
        closure = total.mean(f"{self.numbers.prefix}closure")[0] * self.numbers.area
        covariance = np.zeros((len(factors) + 1,) * 2)
        covariance[:-1, :-1] = areas.covariance[p, :-1, :-1]
        return Linear(np.append(factors, 1.0), np.append(areas.area[p], closure), covariance)


def has_spectra(scene) -> bool:
    """Whether all sources of a scene have a spectrum, so that a render can resolve them."""
    if scene.band.is_total:
        return False
    return all(is_thermal(emitter) and emitter.has_spectrum for emitter in scene.mi.emitters())
