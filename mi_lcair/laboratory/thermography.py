"""Temperatures of objects from images of thermographic cameras, and the air between."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from scipy.special import ndtr, ndtri

from mi_lcair import formats
from mi_lcair.declared import Bounds, Described, excludes, needs, rule, together
from mi_lcair.declared import entry as bounded
from mi_lcair.errors import InputError, errors_of
from mi_lcair.estimate import Contribution, Estimate, slope
from mi_lcair.files import replacing
from mi_lcair.laboratory.regions import Region, combined, of_image, regional
from mi_lcair.physics.air.clear_air import ClearPaths, clear_air
from mi_lcair.physics.air.levels import HEIGHT_M, Weather
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import brightness_temperature, in_band_radiance
from mi_lcair.rendering.images.files import write_exr as write_channels
from mi_lcair.rendering.images.radiometric import Calibration
from mi_lcair.results import Result, contributions, entry, summary_of
from mi_lcair.sections import Table

ATMOSPHERE = "us_standard"  # model atmosphere whose weather a measurement may change
REFINEMENTS = 2  # corrections of the quadrature over an air's wavelengths when it is inverted


@dataclass(frozen=True, eq=False)
class AirPath:
    """Air between an object and a camera.

    Attributes
    ----------
    band : Band
        Band of the camera.
    nodes : Band
        A quadrature of the band over the wavelengths at which the transmittance is known.
    through : Band
        The same, with its weights times the transmittance.
    path : float
        In-band path radiance [W m^-2 sr^-1].
    """

    band: Band
    nodes: Band
    through: Band
    path: float

    @staticmethod
    def given(band: Band, transmittance: float, temperature: float) -> "AirPath":
        """Grey air of one transmittance and temperature [K]."""
        through = replace(band, weights_um=transmittance * band.weights_um)
        path = (1 - transmittance) * float(in_band_radiance(band, temperature))
        return AirPath(band, band, through, path)

    @staticmethod
    def computed(band: Band, distance: float, weather: Weather) -> "AirPath":
        """Clear air in some weather along a horizontal path of a length [m].

        Raises InputError for a band that it does not cover.
        """
        clear = clear_air(ATMOSPHERE, weather)
        air = ClearPaths(ATMOSPHERE, clear, HEIGHT_M, 0.0, True, stated_m=distance)
        air.check_covers(band)
        line = air.path(distance)
        weights = band.row_weights(line.wavelengths_um)
        rows = np.flatnonzero(weights)
        nodes = replace(band, wavelengths_um=line.wavelengths_um[rows], weights_um=weights[rows])
        through = replace(nodes, weights_um=nodes.weights_um * line.transmittance[rows])
        return AirPath(band, nodes, through, float(weights @ line.radiance))

    def radiance(self, temperature) -> np.ndarray:
        """In-band radiance of a blackbody."""
        return in_band_radiance(self.band, temperature)

    def transmitted(self, temperature) -> np.ndarray:
        """In-band radiance that arrives from a blackbody, without the path radiance."""
        return in_band_radiance(self.through, temperature) / self.excess(temperature)

    def source_temperature(self, arriving: np.ndarray) -> np.ndarray:
        """Temperature [K] of the blackbody of which this in-band radiance arrives; NaN if it is not
        positive.
        """
        arriving = np.where(arriving > 0, arriving, np.nan)
        temperature = brightness_temperature(self.through, arriving)
        for _ in range(REFINEMENTS if self.nodes is not self.band else 0):
            temperature = brightness_temperature(self.through, arriving * self.excess(temperature))
        return temperature

    def excess(self, temperature) -> np.ndarray:
        """Radiance of a blackbody by the quadrature over the air's wavelengths, divided by the
        radiance. It differs from 1 by the curvature of Planck's law between the wavelengths.
        """
        if self.nodes is self.band:
            return np.ones(np.shape(temperature))
        with np.errstate(invalid="ignore", divide="ignore"):
            return in_band_radiance(self.nodes, temperature) / self.radiance(temperature)

    def transmittance(self, temperature: float) -> float:
        """Mean transmittance in the band for the radiance of a blackbody of a temperature [K]."""
        return float(self.transmitted(temperature) / self.radiance(temperature))


@dataclass(frozen=True)
class CalibratedPath:
    """Grey air in front of a camera with a calibration, see `AirPath`; radiances are its signals.

    through: transmittance. temperature: of the air [K].
    """

    camera: Calibration
    through: float
    temperature: float

    @property
    def path(self) -> float:
        """Path radiance."""
        return (1 - self.through) * float(self.radiance(self.temperature))

    def radiance(self, temperature) -> np.ndarray:
        """Signal of a blackbody."""
        return self.camera.radiance(temperature)

    def transmitted(self, temperature) -> np.ndarray:
        """Signal of a blackbody that arrives."""
        return self.through * self.radiance(temperature)

    def source_temperature(self, arriving: np.ndarray) -> np.ndarray:
        """Temperature [K] of the blackbody of which this signal arrives; NaN if there is none."""
        return self.camera.kelvin(arriving / self.through)

    def transmittance(self, temperature: float) -> float:
        """Transmittance."""
        return self.through


# The temperature of an object, as a result
# -----------------------------------------


@dataclass(frozen=True, repr=False)
class Temperature(Result):
    """The temperature of an object, or of each pixel of an image.

    Attributes
    ----------
    name : str
        Name of the image.
    band : Band
        Band of the camera.
    estimate : Estimate
        Temperatures [K], of the image's shape, with their errors; NaN for nothing. The errors of
        the quantities are independent, and each is the same in all pixels.
    headline : Estimate
        Mean temperature of the first region. Without one it is that of the hottest pixel.
    interval_K : tuple of float
        Interval that contains 95 % of the headline's temperatures for random quantities. The
        quantities have normal distributions that are cut off at their bounds.
    conditions : dict of str to Estimate
        The quantities of the measurement.
    transmittance : float
        Mean transmittance of the air in the band, for the headline's temperature.
    regions, differences : dict of str to ndarray
        Mean temperature of each region with its error and its interval, its lowest and highest
        temperature, and the position of the highest one. The same for differences from the first
        region. Errors that are common to both regions cancel in a difference. Empty for a number.
    places : tuple of Region
        The regions.
    remarks : tuple of str
    """

    name: str = entry("image")
    band: Band = entry("band", "label")
    estimate: Estimate = entry()
    headline: Estimate = entry("estimate")
    interval_K: tuple[float, float]
    conditions: dict[str, Estimate]
    transmittance: float
    regions: dict[str, np.ndarray]
    differences: dict[str, np.ndarray]
    places: tuple[Region, ...] = entry()
    remarks: tuple[str, ...] = ()

    kind = "temperature"
    drawn_by = "mi_lcair.show.pictures.temperatures:of_image"
    computed = {"pixels": "pixels", "range_K": "range_K"}
    saved_by = {
        suffix: f"mi_lcair.laboratory.thermography:write_{suffix[1:4]}"
        for suffix in (".tif", ".tiff", ".exr", ".csv")
    }

    @property
    def kelvin(self) -> np.ndarray:
        """Temperatures [K], of the image's shape; NaN for nothing."""
        return self.estimate.value

    @property
    def sigma(self) -> np.ndarray:
        """Standard uncertainty of each temperature [K]."""
        return self.estimate.standard_error

    @property
    def pixels(self) -> int:
        """Number of pixels that have a temperature."""
        return int(np.isfinite(self.kelvin).sum())

    @property
    def range_K(self) -> tuple[float, float]:
        """Lowest and highest temperature [K]."""
        return float(np.nanmin(self.kelvin)), float(np.nanmax(self.kelvin))

    def summary(self) -> str:
        """One line with the temperature of the first region, its uncertainty, and the range."""
        head = f"temperature of {self.name}, {self.band.label}: {self.headline}"
        if not self.places:
            return head
        low, high = self.range_K
        return f"{head} ({self.places[0].name}), image {low:.5g} to {high:.5g} K"

    def facts(self) -> Iterator[Any]:
        """The temperature, the air, the regions, and the budget of the uncertainty."""
        yield summary_of(self)
        if not self.headline.contributions:
            yield "uncertainty", "no uncertainty is given; write 0.92+-0.02 to give one"
        else:
            yield "interval", "{:.5g}..{:.5g} K (95 %, from draws)".format(*self.interval_K)
        yield "conditions", ", ".join(f"{name} {x}" for name, x in self.conditions.items())
        yield "transmittance", f"{self.transmittance:.4f}, mean in the band"
        if self.places:
            yield "pixels", f"{self.pixels} of {self.kelvin.size} have a temperature"
            yield from (Table.of(table) for table in (self.regions, self.differences) if table)
        if self.headline.contributions:
            yield contributions(self.headline)

    def columns(self) -> dict[str, np.ndarray]:
        """The budget of the headline: a row for each uncertain quantity."""
        return self.headline.columns()


def write_tif(path, temperature: Temperature) -> None:
    """Write the temperatures [K] as a TIFF of 32-bit floats, NaN for nothing."""
    text = f"object temperature (K) of {temperature.name}"
    formats.write_tiff(path, np.atleast_2d(temperature.kelvin), text)


def write_exr(path, temperature: Temperature) -> None:
    """Write the temperatures and their standard uncertainties [K] as an EXR, 0 for nothing."""
    images = {"temperature.Y": temperature.kelvin, "sigma_K.Y": temperature.sigma}
    channels = {name: np.nan_to_num(np.atleast_2d(values)) for name, values in images.items()}
    write_channels(path, channels, temperature.band.header | {"scene": temperature.name})


def write_csv(path, temperature: Temperature) -> None:
    """Write the temperatures [K] as text, a row of pixels a line, nan for nothing."""
    with replacing(path) as partial, partial.open("w", encoding="utf-8") as file:
        for row in np.atleast_2d(temperature.kelvin):
            file.write(",".join(f"{value:.9g}" for value in row) + "\n")


# Temperature of an object from its apparent temperature, and the budget of its uncertainty
# -----------------------------------------------------------------------------------------
# A camera receives the in-band radiance
#
#     W(T_app) = epsilon tau W(T_obj) + (1 - epsilon) tau W(T_refl) + W_path              (1)
#
# of an object of emissivity epsilon and temperature T_obj in surroundings of temperature T_refl,
# through air of transmittance tau that radiates W_path = (1 - tau) W(T_air). W(T) is the integral
# of Planck's law over the band. Source: the measurement formula in FLIR, Photon user's manual,
# chapter History and Theory of Infrared Technology, Equations 2 to 4. For air by wavelength, tau
# W(T) is the integral of transmittance and Planck's law together. A window before the camera of
# transmittance t changes this W to t W + (1 - t) W(T_window).

COLDEST_K = 120.0  # an apparent temperature that no sky and no air has
DRAWS = 4096  # of the uncertain quantities
INTERVAL = 0.025, 0.975
# Difference of an end of the interval from the linear one, relative to half its width, from which
# the linear uncertainty fails
FAILS = 0.15
STEP = 0.01  # half of a difference that gives a sensitivity, in standard uncertainties


def is_one(number: Estimate) -> bool:
    """Whether a number is exactly 1."""
    return (number.value, number.standard_error) == (1, 0)


@dataclass(frozen=True)
class ImageConditions(
    Described,
    rules=(
        rule(
            lambda t: t.reflected or is_one(t.emissivity),
            "reflected is missing: an object of an emissivity below 1 reflects its surroundings; "
            "give their temperature in K",
        ),
        rule(
            lambda t: (
                t.reflected or t.air_temperature or not t.transmittance or is_one(t.transmittance)
            ),
            "air_temperature is missing: air of a transmittance below 1 emits; give its "
            "temperature in K",
        ),
        excludes("transmittance", "distance"),
        needs("humidity", "distance", why="with a transmittance it does not count"),
        together("window", "window_temperature"),
    ),
):
    """The quantities of a measurement, in their order in a budget."""

    emissivity: Estimate = bounded(upper=1, is_positive=True)
    reflected: Estimate | None = bounded(None, lower=60, upper=6000, unit="K")
    transmittance: Estimate | None = bounded(None, upper=1, is_positive=True)
    air_temperature: Estimate | None = bounded(None, lower=60, upper=6000, unit="K")
    distance: Estimate | None = bounded(None, is_positive=True, upper=200_000, unit="m")
    humidity: Estimate | None = bounded(None, lower=0, upper=0.98)
    window: Estimate | None = bounded(None, upper=1, is_positive=True)
    window_temperature: Estimate | None = bounded(None, lower=60, upper=6000, unit="K")

    @property
    def quantities(self) -> dict[str, Estimate]:
        """The given ones by name."""
        return {name: number for name, number in vars(self).items() if number is not None}

    def completed(self) -> tuple["ImageConditions", list[str]]:
        """The conditions with default values for the other quantities, and remarks about these."""
        # What a body of emissivity 1 reflects does not count
        reflected = self.reflected or Estimate(QUANTITIES["reflected"].lower)
        if self.distance:
            return replace(self, reflected=reflected), []
        air, through = self.air_temperature, self.transmittance or Estimate(1.0)
        remarks = [
            f"the air is assumed to have the reflected temperature, {reflected.value:g} K; set "
            "another one with air_temperature"
        ]
        return replace(
            self,
            reflected=reflected,
            transmittance=through,
            air_temperature=air or replace(reflected, standard_error=0.0),
        ), [] if air or is_one(through) else remarks

    def air(
        self, band: Band, values: dict[str, float], camera: Calibration | None
    ) -> AirPath | CalibratedPath:
        """The air for values of the quantities. With a camera it is that of its makers."""
        if camera is not None:
            return CalibratedPath(camera, *grey(values, camera))
        if "distance" not in values:
            return AirPath.given(band, values["transmittance"], values["air_temperature"])
        weather = Weather(values.get("air_temperature"), values.get("humidity"))
        return AirPath.computed(band, values["distance"], weather)


QUANTITIES = {of.name: of.metadata["bounds"] for of in fields(ImageConditions)}


def grey(values: dict[str, Any], camera: Calibration | None) -> tuple[Any, Any]:
    """Transmittance and temperature [K] of grey air for values of the quantities."""
    kelvin = values.get("air_temperature", values["reflected"])
    if "distance" not in values:
        return values["transmittance"], kelvin
    return camera.transmittance(values["distance"], values.get("humidity", 0.5), kelvin), kelvin


def before_window(signal: Any, values: dict[str, Any], air: AirPath | CalibratedPath) -> Any:
    """In-band radiance before a camera's window, from the one behind it."""
    window = values.get("window", 1.0)
    glow = air.radiance(values["window_temperature"]) if "window" in values else 0.0
    return (signal - (1 - window) * glow) / window


def object_temperature(
    apparent, values: dict[str, float], air: AirPath | CalibratedPath
) -> np.ndarray:
    """Temperature of the object by (1), [K]; NaN where no object can have the apparent temperature.

    apparent: apparent temperatures [K]. values: of the quantities.
    """
    emissivity = values["emissivity"]
    arriving = before_window(air.radiance(apparent), values, air) - air.path
    emitted = arriving - (1 - emissivity) * air.transmitted(values["reflected"])
    return air.source_temperature(emitted / emissivity)


def parts_of(
    stated: Mapping[str, Estimate], solved: Callable[[dict[str, float]], np.ndarray]
) -> Iterator[Contribution]:
    """What each quantity with a standard error adds to the temperature.

    solved: gives the temperatures for changed quantities.
    """
    for quantity, number in stated.items():
        if sigma := number.standard_error:
            known = quantity in QUANTITIES
            of_quantity = slope(
                lambda value, quantity=quantity: solved({quantity: value}),
                number.value,
                STEP * sigma,
                limits(QUANTITIES[quantity] if known else Bounds()),
            )
            value = number.value if known else None  # `apparent` differs from pixel to pixel
            yield Contribution.of(quantity, sigma, of_quantity, value=value, unit=number.unit)


def temperature_of(
    apparent: np.ndarray,
    sigma: float,
    band: Band,
    conditions: ImageConditions,
    name: str,
    camera: Calibration | None = None,
    places: tuple[Region, ...] = (),
) -> Temperature:
    """The temperature of an object with its budget.

    Parameters
    ----------
    apparent : ndarray
        Apparent temperatures [K], of any shape; NaN for nothing.
    sigma : float
        Their standard uncertainty [K], common to all pixels.
    band : Band
    conditions : ImageConditions
    name : str
        Name of the image in the result.
    camera : Calibration, optional
        Curve of the camera, which takes the place of Planck's law in the band, and its air.
    places : tuple of Region
        Regions of an image. The hottest pixel and the whole image follow them.

    Raises
    ------
    InputError
        For conditions that are incomplete, for a region outside the image, and if no object can
        have any of the temperatures.
    """
    band.check_limits("camera")
    given = conditions.quantities
    conditions, remarks = conditions.completed()
    stated = {"apparent": Estimate(0.0, sigma, "K"), **conditions.quantities}
    values = {quantity: number.value for quantity, number in stated.items()}

    def solved(changes: dict[str, float]) -> np.ndarray:
        new = values | changes
        return object_temperature(
            apparent + new["apparent"], new, conditions.air(band, new, camera)
        )

    kelvin = solved({})
    impossible = int(np.sum(np.isnan(kelvin) & np.isfinite(apparent)))
    if impossible:
        low, high = np.nanmin(apparent), np.nanmax(apparent)
        text = (
            f"{impossible} of {np.sum(np.isfinite(apparent))} pixels are colder than reflection "
            f"and air alone would be, in an image of {low:.4g} to {high:.4g} K"
        )
        if not np.isfinite(kelvin).any():
            raise InputError(f"{name}: {text}; check emissivity, reflected and the air")
        remarks.append(f"{text}; they have no temperature (NaN)")
    kelvins = {"the warmest pixel": np.nanmax(apparent)} | {
        name: given[name].value for name in ("reflected", "air_temperature") if name in given
    }
    remarks += [
        f"{what} is {value:g} K, colder than any sky; is it in degrees Celsius?"
        for what, value in kelvins.items()
        if value < COLDEST_K
    ]
    estimate = Estimate.of(np.asarray(kelvin), "K", list(parts_of(stated, solved)))
    for place in places:
        if not kelvin.ndim:
            raise InputError(f"{name}: a number has no {place.name}")
        with errors_of(name):
            place.check(kelvin)
    every = (*places, *of_image(kelvin))
    # The typical pixels of the regions, the coldest pixel and the hottest one
    pixels = [place.typical(kelvin) for place in every]
    pixels += [int(np.nanargmin(kelvin)), int(np.nanargmax(kelvin))]
    draws = drawn(np.ravel(apparent)[pixels], stated, conditions, band, camera)
    ends, linear = np.nanquantile(draws, INTERVAL, axis=0), estimate.standard_error.flat[pixels]
    off = abs(ends - kelvin.flat[pixels] - np.outer([-2, 2], linear)).max(axis=0)
    off /= FAILS * 2 * linear + 1e-6
    if (off > 1).any():
        k, lost = int(np.argmax(off)), np.isnan(draws).mean(axis=0)
        without = f"; {lost[k]:.0%} of the draws have no temperature" if lost[k] > 0.005 else ""
        remarks.append(
            f"at {kelvin.flat[pixels[k]]:.4g} K +- {linear[k]:.3g} K the linear uncertainty is "
            f"wrong: 95 % of draws are in {ends[0, k]:.4g}..{ends[1, k]:.4g} K{without}"
        )
    regions, differences = regional(estimate, every, draws, INTERVAL)
    headline = combined(estimate, every[0].mean)
    return Temperature(
        name=name,
        band=band,
        estimate=estimate,
        headline=headline,
        interval_K=(float(regions["from_K"][0]), float(regions["to_K"][0])),
        # Without those that do not count and that nobody gave
        conditions={
            quantity: number
            for quantity, number in conditions.quantities.items()
            if quantity in given or "reflected" in given or quantity == "transmittance"
        },
        transmittance=conditions.air(band, values, camera).transmittance(headline.value),
        regions=regions if kelvin.ndim else {},
        differences=differences if len(places) > 1 else {},
        places=every if kelvin.ndim else (),
        remarks=tuple(remarks),
    )


def drawn(
    apparent: np.ndarray,
    stated: dict[str, Estimate],
    conditions: ImageConditions,
    band: Band,
    camera: Calibration | None,
) -> np.ndarray:
    """Temperatures of pixels for random quantities, (DRAWS, n); NaN for none.

    `in_terms` of computed air are taken from one standard uncertainty of each of its quantities to
    both sides.

    apparent: apparent temperatures, (n,). stated: the quantities and `apparent`, an offset.
    """
    random, values = np.random.default_rng(0), {}
    for name, number in stated.items():
        values[name], sigma = number.pair
        if sigma:
            at = (np.array(limits(QUANTITIES.get(name, Bounds()))) - values[name]) / sigma
            share = (random.permutation(DRAWS)[:, None] + 0.5) / DRAWS
            values[name] = number.value + sigma * ndtri(ndtr(at[0]) + np.ptp(ndtr(at)) * share)
    means = {name: number.value for name, number in stated.items()}
    air = conditions.air(band, means, camera)
    if "distance" not in stated or camera:
        through, kelvin = grey(values, camera)
        glow = air.radiance(kelvin)
    else:
        depth, glow = in_terms(air, means)
        for name in ("distance", "humidity", "air_temperature"):
            if sigma := name in stated and stated[name].standard_error:
                ends = np.clip(means[name] + np.array([-sigma, sigma]), *limits(QUANTITIES[name]))
                airs = (conditions.air(band, means | {name: float(end)}, None) for end in ends)
                low, high = (in_terms(of_end, means) for of_end in airs)
                z = (values[name] - means[name]) / np.ptp(ends)
                depth, glow = depth * (high[0] / low[0]) ** z, glow + z * (high[1] - low[1])
        through = np.exp(-depth)
    factor, path = through / air.transmittance(means["reflected"]), (1 - through) * glow
    light = (1 - values["emissivity"]) * factor * air.transmitted(values["reflected"])
    arriving = before_window(air.radiance(apparent + values["apparent"]), values, air)
    kelvin = air.source_temperature((arriving - path - light) / (values["emissivity"] * factor))
    return np.broadcast_to(kelvin, (DRAWS, len(apparent)))


def in_terms(air: AirPath, values: dict[str, float]) -> tuple[float, float]:
    """Optical depth of an air for the reflected light, and in-band radiance of its path if it were
    opaque.
    """
    through = min(air.transmittance(values["reflected"]), 1 - 1e-12)  # of a very short path
    return -np.log(through), air.path / (1 - through)


def limits(bounds: Bounds) -> tuple[float, float]:
    """Smallest and largest value of a quantity in a difference."""
    return max(bounds.lower, 1e-9 if bounds.is_positive else -np.inf), bounds.upper
