"""Measured images, spectra and contrasts, checked against a scene."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from mi_lcair.declared import Described, Rule, entry, excludes, fraction, needs, one_of, rule, texts
from mi_lcair.derivatives.common_numbers import renders_beside, step_of
from mi_lcair.derivatives.motions.differences import default_step
from mi_lcair.detection.irradiance import in_weather, weather_quantities
from mi_lcair.detection.scenario import Scenario
from mi_lcair.detection.setting import Setting, holding, rendered_as, setting_of
from mi_lcair.errors import InputError, check_known
from mi_lcair.estimate import WIDTH
from mi_lcair.knowing.budgets.contrast_number import ContrastNumber, present
from mi_lcair.knowing.inversion.tables import prior_of
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import brightness_temperature, in_band_radiance, in_band_slope
from mi_lcair.physics.imager import MILLIKELVIN
from mi_lcair.physics.spectra.bins import Bins
from mi_lcair.physics.spectra.parameters import Change
from mi_lcair.physics.spectral_table import WAVELENGTH
from mi_lcair.plugins.bsdfs.reflection_bsdf import has_spectral_materials
from mi_lcair.plugins.paths.launch import UNIT
from mi_lcair.rendering.images.files import TEMPERATURE, check_kelvin, read_values
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.motions.pose import known_motions, value_of
from mi_lcair.rendering.parameters.entries import Parameter
from mi_lcair.rendering.parameters.values import parameters_named
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import Totals
from mi_lcair.rendering.window import Windows
from mi_lcair.table import read_table

NETD_K = 300.0  # temperature of the blackbody for which a NETD holds, K
RADIANCE, SIGMA = "radiance_W_m2_sr_um", "sigma_W_m2_sr_um"
UNEVEN = 1e-3  # largest error of a wavelength, in distances of two wavelengths
# Saturated pixels have the same value. Of noisy pixels fewer do, and of rounded ones others, too.
LEAST_PLATEAU = 4  # number of pixels with the largest value from which they may be saturated
EXCESS = 4.0  # ratio of this number to that of any other value
WEATHER_SIGMA = 0.01  # standard deviation of the weather whose derivative is wanted, of its range


def measured_radiance(measurement, band: Band, size: tuple[int, int]) -> tuple:
    """The radiance of each pixel of a measurement, and which pixels count.

    Parameters
    ----------
    measurement : Measurement
    band : Band
        Band of the scene.
    size : tuple of int
        Height and width of the scene's film.

    Returns
    -------
    radiance : ndarray, shape (H, W)
        In-band radiance, W m^-2 sr^-1.
    sigma : ndarray, shape (H, W), or None
        Standard deviation of `sigma_image`, W m^-2 sr^-1.
    counts : ndarray of bool, shape (H, W)
        Pixels that are finite, not masked and not saturated.
    plateau : ndarray of bool, shape (H, W)
        Pixels that do not count because of `is_on_plateau`.

    Raises
    ------
    InputError
        For a file that cannot be read, another size, band or unit, and if no pixel counts.
    """
    path, sigma = measurement.image, None
    values, quantity, counts, plateau = values_that_count(
        measurement, measurement.channel, measurement.quantity, band, size
    )
    check_counts(path, counts)
    if measurement.sigma_image is not None:
        sigma, _ = read_values(measurement.sigma_image, measurement.channel, quantity, band)
        check_size(measurement.sigma_image, sigma, size)
        if not (sigma[counts] > 0).all():
            raise InputError(
                f"{measurement.sigma_image}: a standard deviation is not positive; mask its pixel"
            )
    if quantity == TEMPERATURE:
        check_kelvin(path, values[counts])
        kelvin = np.where(counts, values, 300.0)
        if sigma is not None:
            sigma = sigma * in_band_slope(band, kelvin)
        values = in_band_radiance(band, kelvin)
    return values, sigma, counts, plateau


def values_that_count(measurement, channel, quantity, band: Band, size: tuple[int, int]) -> tuple:
    """Scaled values of a measured image, their quantity, which are finite, not saturated and not
    masked, and which of the others seem to be saturated.

    channel, quantity: those of the file. size: height and width of the film.
    """
    values, quantity = read_values(measurement.image, channel, quantity, band)
    values = values * measurement.scale
    check_size(measurement.image, values, size)
    counts = np.isfinite(values)
    if measurement.saturation is not None:
        counts &= values < measurement.saturation
    plateau = np.zeros_like(counts)
    if measurement.mask is not None:
        mask, _ = read_values(measurement.mask, None, "mask", band)
        check_size(measurement.mask, mask, size, "mask")
        counts &= np.isfinite(mask) & (mask != 0)
    if measurement.saturation is None and counts.any():
        plateau = is_on_plateau(values, counts)
    return values, quantity, counts & ~plateau, plateau


def is_on_plateau(values: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Pixels (H, W) at which a detector seems to be saturated: many have the largest value."""
    some = values[counts]
    _, number = np.unique(some.astype(np.float32), return_counts=True)
    is_many = number[-1] >= max(LEAST_PLATEAU, EXCESS * max(number[:-1], default=0))
    return counts & (values >= np.max(some) * (1 - UNIT)) & (is_many and len(number) > 1)


def check_counts(path, counts: np.ndarray) -> None:
    """Raise InputError if no pixel of an image counts."""
    if not counts.any():
        raise InputError(
            f"{path}: all pixels are masked, saturated or not finite; at least one must count"
        )


def noise_of_netd(band: Band, radiance, netd_mK: float) -> np.ndarray:
    """Standard deviation of the radiance of pixels, for a NETD that holds at NETD_K.

    A camera's variance is a constant part (electronics, dark current, warm optics) and shot noise,
    which is proportional to the radiance. Their shares are not known. With L0 the radiance of
    NETD_K, the variance max(1, L / L0) is at least as large for any shares, and the same at L0.
    """
    share = np.maximum(np.asarray(radiance) / in_band_radiance(band, NETD_K), 1.0)
    return in_band_slope(band, NETD_K) * netd_mK * 1e-3 * np.sqrt(share)


def check_radiance(path, values: np.ndarray, predicted: np.ndarray, band: Band) -> None:
    """Raise InputError for a measured radiance that is a temperature, or of another unit.

    predicted: radiance of the same pixels by the scene as it was loaded.
    """
    measured, expected = float(np.median(values)), float(np.median(predicted))
    kelvin = float(brightness_temperature(band, expected)) if expected > 0 else np.nan
    if abs(measured - kelvin) < 0.1 * kelvin and measured > 3 * expected:
        raise InputError(
            f"{path}: median radiance {measured:.4g} W m^-2 sr^-1, where the scene has "
            f"{expected:.4g} and an apparent temperature of {kelvin:.4g} K; give quantity = "
            "'apparent_temperature' if these are kelvin"
        )
    if expected > 0 and not 1e-2 < measured / expected < 1e2:
        raise InputError(
            f"{path}: median radiance {measured:.4g}, where the scene has {expected:.4g} "
            "W m^-2 sr^-1; check unit, band and scale"
        )


def check_size(path, values: np.ndarray, size: tuple[int, int], what: str = "image") -> None:
    """Raise InputError for an image that is not of the size (height, width) of the film."""
    if values.shape != tuple(size):
        raise InputError(
            f"{path}: the {what} has {values.shape[1]} x {values.shape[0]} pixels, and the scene's "
            f"film {size[1]} x {size[0]}; give both the same size"
        )


@dataclass(frozen=True)
class MeasuredSpectrum:
    """Spectral radiance of all that a scene's sensor sees, at the bins of its band.

    bins: the bins, with nodes at the measured wavelengths. radiance, sigma: measured values and
    their standard deviations, (count,) [W m^-2 sr^-1 um^-1].
    """

    bins: Bins
    radiance: np.ndarray
    sigma: np.ndarray

    @staticmethod
    def read(path: str, sigma: float | None, scene: Scene) -> "MeasuredSpectrum":
        """The spectrum of a CSV file `wavelength_um,radiance_W_m2_sr_um`.

        Its standard deviations are `sigma` or the column `sigma_W_m2_sr_um`. Raises InputError for
        wavelengths that are not even over the scene's band.
        """
        names = (WAVELENGTH, RADIANCE, *(() if sigma else (SIGMA,)))
        columns = read_table(path, names, "spectrum").numbers(names)
        x = columns[WAVELENGTH]
        if scene.band.is_total or len(x) < 3 or not x[0] < x[-1]:
            raise InputError(f"{path}: needs three rising wavelengths or more within a band")
        bins = Bins(scene.band, len(x))
        if np.abs(bins.nodes_um - x).max() > UNEVEN * (x[-1] - x[0]) / (len(x) - 1):
            raise InputError(
                f"{path}: wavelengths {x[0]:g}..{x[-1]:g} um; they must be even over the scene's "
                f"band {scene.band.lower_um:g}-{scene.band.upper_um:g} um, its limits included"
            )
        if not has_spectral_materials(scene.mi):
            raise InputError(f"{scene.name}: a spectrum needs a material by wavelength, none is")
        sigma = np.full(len(x), sigma) if sigma else columns[SIGMA]
        WIDTH.check_all(sigma, lambda k: f"{path}: {SIGMA}")
        return MeasuredSpectrum(bins, columns[RADIANCE], sigma)

    def predicted(self, scene: Scene, names, sampling: Sampling) -> tuple[np.ndarray, list]:
        """Spectral radiance of each randomisation, (R, count), and its columns, (count, K) each.

        A bin depends on the spectrum of a material in that bin alone. One difference with respect
        to the offset of the spectrum therefore gives the derivatives at all its nodes.
        """
        windows = Windows.whole(scene.sensor(sampling.sensor))
        measurands = Measurands.of(None, bins=self.bins.count)

        def values(total: Totals) -> np.ndarray:
            names = [f"bin.{k}" for k in range(self.bins.count)]
            return np.array([total.mean(n)[0] + spread(total.deviations(n))[0] for n in names]).T

        def slope(name: str) -> np.ndarray:
            high, low, step = renders_beside(scene, name, windows, sampling, measurands)
            return (values(high) - values(low)) / step

        radiance, slopes = values(measure(scene, windows, sampling, measurands)), {}
        columns = []
        for parameter in parameters_named(scene, names):
            number = parameter.stored[0].number if parameter.kind == "spectrum" else None
            name = parameter.name
            if number is not None:
                name = f"{parameter.name.rpartition('.')[0]}.offset"
            if name not in slopes:
                slopes[name] = slope(name)
            share = np.ones(self.bins.count)
            if number is not None:
                unit = Change(parameter.stored[0].node.spectrum_change.band_um, scale=0.0)
                unit = unit.replaced(str(int(number[0])), 1.0)
                share = unit.unclipped(self.bins.nodes_um, share)
            columns.append(slopes[name] * share)
        columns = np.array(columns).reshape(len(names), *radiance.shape)
        return radiance, list(columns.transpose(1, 2, 0))


def spread(deviations: np.ndarray) -> np.ndarray:
    """Deviations of single randomisations from those that are scaled to the mean, (..., R)."""
    R = deviations.shape[-1]
    return deviations * np.sqrt(R * (R - 1))


@dataclass(frozen=True)
class MeasuredContrast:
    """A scenario's line of sight, whose contrast was measured.

    scenario: the scenario. setting: what its contrast is computed from.
    """

    scenario: Scenario
    setting: Setting

    @staticmethod
    def of(
        source: str, entries: Mapping, motions: Mapping = MappingProxyType({})
    ) -> "MeasuredContrast":
        """The line of sight of a scenario with other entries, by dotted key, and more motions.

        Raises InputError if the scenario cannot be used.
        """
        scenario = Scenario.read(source, **entries).with_motions(motions)
        return MeasuredContrast(scenario, setting_of(scenario))

    def known(self) -> dict[str, Parameter]:
        """The weather of the air, by name."""
        return weather_quantities(self.scenario.atmosphere)

    def in_conditions(self, values: Mapping[str, float]) -> "MeasuredContrast":
        """The line of sight for values of the weather, in which its scene is lit from then on."""
        scenario = in_weather(self.scenario, values)
        setting = self.setting.through(scenario)
        setting.light.shine_on(setting.view)
        return MeasuredContrast(scenario, setting)

    @property
    def present(self) -> tuple[Scenario, Setting]:
        """Scenario and setting with the sky and the ground that the scene has now."""
        if self.scenario.surroundings is None:
            return self.scenario, self.setting
        scenario, setting, scale = present(self.scenario, self.setting)
        if not setting.sight.meets_ground:
            setting = replace(setting, backdrop=setting.backdrop.scaled(scale))
        return scenario, setting

    def contrast(
        self, names, spp: int | None, seed: int, randomisations: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Contrast of independent renders, and its derivatives, those of a budget.

        Parameters
        ----------
        names : sequence of str
            K parameters of the scene, or quantities of the weather.
        spp : int or None
            Samples per pixel of all renders together, in place of those, or of the tolerance, of
            the scenario.
        seed : int
            Seed of the random numbers of the first render.
        randomisations : int
            R renders.

        Returns
        -------
        contrast : ndarray, shape (R,)
            Contrast irradiance at the sensor [W m^-2].
        columns : ndarray, shape (K, R)

        Raises
        ------
        InputError
            If no ray meets the target.
        """
        (scenario, setting), render = self.present, self.scenario.render
        spp = spp or render.spp
        if spp is not None:
            spp = max(-(-spp // randomisations), 2)
            to_spp = {"tolerance": None, "tolerance_W_m2": None, "max_spp": None, "spp": spp}
            render = replace(render, **to_spp)
        motions = known_motions(setting.view)
        if any(value_of(setting.view, motion) != motion.rest for motion in motions.values()):
            setting = holding(setting, scenario, [])
        contrast, columns = [], []
        with rendered_as(setting.view, render):
            for number_of_render in range(randomisations):
                sampling = replace(render, seed=(seed + number_of_render) % 2**32)
                number = ContrastNumber(replace(scenario, render=sampling), setting)
                sigma = [deviation(number, name) for name in names]
                number.make_room(names, sigma)
                number.start()
                contrast.append(number.value)
                columns.append(number.derivatives(names, sigma)[0])
        return np.array(contrast), np.transpose(columns)


def deviation(number: ContrastNumber, name: str) -> float:
    """Standard deviation of a quantity for which its derivative is taken."""
    of = number.known[name]
    if of.kind == "motion":
        return default_step(number.scene, known_motions(number.scene)[name])
    if of.kind == "scenario":
        return WEATHER_SIGMA * (of.upper - of.lower)
    return step_of(of)


# Measurements of an inverse problem and candidates for further ones: [[data]], [[candidates]]
# --------------------------------------------------------------------------------------------

QUANTITIES = ("radiance", "apparent_temperature")
CAMERA_QUANTITIES = ("counts", "apparent_temperature")
NOISES = ("netd_mK", "sigma", "sigma_image")
ASSUMED_SIGMA = 0.01  # standard deviation of faults of a camera and a scene that nobody states
OF_AN_IMAGE = (
    "camera_sigma",
    "model_sigma",
    "row_noise",
    "column_noise",
    "frame_noise",
    "gain",
    "offset",
)
NAME_KEY = re.compile(r"[^\[\],]{1,64}")


def relative(text: str) -> float:
    """A relative standard deviation as a number; "0" for none."""
    return 0.0 if text.strip(" %") == "0" else fraction(text)


def named(key: str) -> Rule:
    return rule(
        lambda t: not getattr(t, key) or NAME_KEY.fullmatch(getattr(t, key)),
        f"{key} = '{{t.{key}}}'; must have 1 to 64 characters, without brackets and commas",
    )


@dataclass(frozen=True)
class Observation(Described, rules=(named("name"), named("state"))):
    """Where a measurement looks: a scene, a view and a heating state.

    Attributes
    ----------
    scene : str
        Bundled scene or Mitsuba XML file. For a camera's image and for a contrast, the TOML file of
        a scenario (`detection.scenario`). `parameters` then change its entries, such as
        {"observer.range_m" = 500}.
    name : str
        Name in messages and results; by default data 1, data 2 and so on.
    parameters : dict
        The scene's $-parameters.
    sensor : int
        Number of the sensor, counted from 0.
    state : str
        Name of the heating state. Temperatures have one value for each state.
    netd_mK : float, optional
        Noise-equivalent temperature difference of a pixel that sees a blackbody of 300 K, mK.
        Colder pixels have the same noise in radiance. Hotter pixels have more shot noise.
    sigma : float, optional
        Standard deviation of the noise: W m^-2 sr^-1 for an image, W/sr for an intensity, W m^-2
        for a contrast.
    camera_sigma : str, optional
        Standard deviation of faults of the camera, such as "0.5%" ("1%"): of its gain, of its
        offset relative to the mean of the image, of the vignetting at the corners, and of linear
        gradients at the edges. "0" for a camera without them.
    model_sigma : str, optional
        Standard deviation of the error of the predicted radiance itself, such as "1%", for a
        geometry or a material that is slightly wrong. There is one such error for each group in an
        image, common to all pixels that see the group, and one for each pixel. By default the
        groups have errors of 1 %, and the pixels none. "0" for a scene without errors.
    """

    scene: str = entry(is_file=True)
    name: str = ""
    parameters: dict = entry(dict, is_file=True)
    sensor: int = entry(0, lower=0)
    state: str = ""
    netd_mK: float | None = entry(None, is_positive=True, upper=MILLIKELVIN["upper"])
    sigma: float | None = entry(None, is_positive=True)
    camera_sigma: str | None = None
    model_sigma: str | None = None

    def complete(self) -> None:
        """Raise InputError for a standard deviation that is no fraction."""
        _ = self.camera_error, self.model_error

    @property
    def camera_error(self) -> float:
        """camera_sigma as a number."""
        return ASSUMED_SIGMA if self.camera_sigma is None else relative(self.camera_sigma)

    @property
    def model_error(self) -> float:
        """model_sigma of groups as a number."""
        return ASSUMED_SIGMA if self.model_sigma is None else relative(self.model_sigma)

    def scene_parameters(self) -> dict[str, str]:
        """The scene's $-parameters as text."""
        return texts("parameters", self.parameters)

    def noises(self) -> list[str]:
        """Names of the entries that state the noise."""
        return [key for key in NOISES if getattr(self, key, None) is not None]


def without_camera(key: str) -> Rule:
    return rule(
        lambda t: not (t.is_of_camera and getattr(t, key)),
        f"{key} cannot be combined with the image of a scenario's camera",
    )


def noise_once(data: "Measurement") -> str | None:
    """What is wrong with the noise, which a camera and some files state themselves."""
    noises, allowed = data.noises(), NOISES if data.image else ("sigma",)
    if data.is_of_camera:
        return noises and (
            f"gives its noise by {' and '.join(noises)}, but the [camera] of {data.scene} has "
            "its own; leave it out"
        )
    if len(noises) == 1 and noises[0] in allowed or (data.trend or data.spectrum) and not noises:
        return None
    return (
        f"gives its noise by {' and '.join(noises) or 'nothing'}; give "
        f"{'one of ' if len(allowed) > 1 else ''}{', '.join(allowed)}"
    )


def known_quantity(data: "Measurement") -> None:
    known = CAMERA_QUANTITIES if data.is_of_camera else QUANTITIES
    check_known("quantity", known, data.quantity)


OF_A_MEASUREMENT = (
    one_of("image", "intensity", "contrast", "trend", "spectrum"),
    excludes("contrast", "sensor", why="a scenario has its observer"),
    *map(without_camera, ("sensor", "sigma_image")),
    rule(
        lambda t: not (t.is_of_camera and t.offset) or t.offset_prior,
        "offset of a camera's image needs offset_prior, in electrons",
    ),
    Rule(noise_once),
    Rule(known_quantity),
    rule(lambda t: t.scale, "scale = 0; must not be zero"),
    *(needs(key, "image", why="for a number raise sigma") for key in OF_AN_IMAGE),
    *(needs(f"{key}_prior", **{key: True}) for key in ("gain", "offset")),
    *map(prior_of, ("gain_prior", "offset_prior")),
)


@dataclass(frozen=True)
class Measurement(Observation, rules=OF_A_MEASUREMENT):
    """Table [[data]]: a measured image, number or trend.

    Attributes
    ----------
    image : str, optional
        EXR, TIFF, CSV or NPY file, or a camera's radiometric file such as FLIR's JPEG, of the size
        of the scene's film. If the scene is a scenario, it is the image of the scenario's camera,
        and the camera's noise model is used.
    channel : str, optional
        Channel of an EXR file ("Y").
    quantity : str, optional
        "radiance" [W m^-2 sr^-1] or "apparent_temperature" [K]; for a scenario's camera "counts" or
        "apparent_temperature". Needed except for EXR and radiometric files.
    scale : float
        Number by which the values of the file are multiplied, such as 0.01 for centikelvin.
    mask : str, optional
        PNG, TIFF, CSV or NPY file; pixels that are 0 are ignored.
    saturation : float, optional
        Pixels with this value and above are ignored, in the unit of `quantity`. By default pixels
        are ignored if many have the same largest value. `inf` means a detector without saturation.
    sigma_image : str, optional
        Image of the noise's standard deviation in the unit of `quantity`.
    gain, offset : bool
        Whether the gain or the offset is unknown, with measured = gain x radiance + offset.
    gain_prior, offset_prior : tuple of float, optional
        Mean and standard deviation that are known beforehand.
    row_noise, column_noise, frame_noise : float
        Standard deviation of an error that is common to all pixels of a row, of a column, or of the
        image, relative to the independent noise of a pixel.
    intensity : float, optional
        Intensity of the target, W/sr, in place of an image.
    contrast : float, optional
        Contrast irradiance of the target at the sensor, W m^-2, in place of an image.
    spectrum : str, optional
        CSV with the columns wavelength_um, radiance_W_m2_sr_um and, without `sigma`,
        sigma_W_m2_sr_um: mean spectral radiance over the image of the scene's sensor, at even
        wavelengths over the scene's band, in place of an image.
    trend : str, optional
        CSV with the columns azimuth_deg, elevation_deg, intensity_W_sr and, without `sigma`,
        standard_error_W_sr, in place of an image.
    """

    image: str | None = entry(None, is_file=True)
    channel: str | None = None
    quantity: str | None = None
    scale: float = 1.0
    mask: str | None = entry(None, is_file=True)
    saturation: float | None = None
    sigma_image: str | None = entry(None, is_file=True)
    gain: bool = False
    offset: bool = False
    gain_prior: tuple[float, float] | None = None
    offset_prior: tuple[float, float] | None = None
    row_noise: float = entry(0.0, lower=0)
    column_noise: float = entry(0.0, lower=0)
    frame_noise: float = entry(0.0, lower=0)
    intensity: float | None = None
    contrast: float | None = None
    trend: str | None = entry(None, is_file=True)
    spectrum: str | None = entry(None, is_file=True)

    @property
    def is_of_camera(self) -> bool:
        """Whether the image is that of a scenario's camera."""
        return self.image is not None and self.scene.endswith(".toml")


@dataclass(frozen=True)
class Candidate(Observation, rules=(one_of("netd_mK", "sigma"),)):
    """Table [[candidates]]: a measurement that could be made; what it would bring is computed.

    Its noise is `netd_mK` or `sigma` of an image.
    """
