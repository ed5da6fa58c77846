"""Measurements of an inverse problem and candidates for further ones: [[data]], [[candidates]]."""

import re
from dataclasses import dataclass

from mi_lcair.declared import (
    Rule,
    Table,
    entry,
    excludes,
    fraction,
    needs,
    one_of,
    rule,
    texts,
)
from mi_lcair.errors import check_known
from mi_lcair.inversion.tables import prior_of

QUANTITIES = ("radiance", "apparent_temperature")
CAMERA_QUANTITIES = ("counts", "apparent_temperature")
NOISES = ("netd_mK", "sigma", "sigma_image")
OF_AN_IMAGE = ("model_sigma", "row_noise", "column_noise", "frame_noise", "gain", "offset")
NAME_KEY = re.compile(r"[^\[\],]{1,64}")


def named(key: str) -> Rule:
    return rule(
        lambda t: not getattr(t, key) or NAME_KEY.fullmatch(getattr(t, key)),
        f"{key} = '{{t.{key}}}'; must have 1 to 64 characters, without brackets and commas",
    )


@dataclass(frozen=True)
class Observation(Table, rules=(named("name"), named("state"))):
    """Where a measurement looks: a scene, a view and a heating state.

    Attributes
    ----------
    scene : str
        Bundled scene or Mitsuba XML file. Of a camera's image and of a contrast, the TOML file of a
        scenario (`detection.scenario`); `parameters` are then changes of its entries, such as
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
        Colder pixels have the same noise in radiance, hotter ones the shot noise in addition.
    sigma : float, optional
        Standard deviation of the noise: W m^-2 sr^-1 for an image, W/sr for an intensity, W m^-2
        for a contrast.
    """

    scene: str = entry(is_file=True)
    name: str = ""
    parameters: dict = entry(dict, is_file=True)
    sensor: int = entry(0, lower=0)
    state: str = ""
    netd_mK: float | None = entry(None, is_positive=True)
    sigma: float | None = entry(None, is_positive=True)

    def scene_parameters(self) -> dict[str, str]:
        """The scene's $-parameters as text."""
        return texts("parameters", self.parameters)

    def noises(self) -> list[str]:
        """Names of the entries that state the noise."""
        return [key for key in NOISES if getattr(self, key, None) is not None]


def without_camera(key: str) -> Rule:
    return rule(
        lambda t: not (t.is_of_camera and getattr(t, key)),
        f"{key} does not go with the image of a scenario's camera",
    )


def noise_once(data: "Measurement") -> str | None:
    """What is wrong with the noise, which a camera and some files state themselves."""
    noises, allowed = data.noises(), NOISES if data.image else ("sigma",)
    if data.is_of_camera:
        return noises and (
            f"states its noise by {' and '.join(noises)}, but the [camera] of {data.scene} has its "
            "own; leave it out"
        )
    if len(noises) == 1 and noises[0] in allowed or (data.trend or data.spectrum) and not noises:
        return None
    return (
        f"states its noise by {' and '.join(noises) or 'nothing'}; "
        f"give {'one of ' if len(allowed) > 1 else ''}{', '.join(allowed)}"
    )


def known_quantity(data: "Measurement") -> None:
    known = CAMERA_QUANTITIES if data.is_of_camera else QUANTITIES
    check_known("quantity", known, data.quantity)


OF_A_MEASUREMENT = (
    one_of("image", "intensity", "contrast", "trend", "spectrum"),
    excludes("contrast", "sensor", why="a scenario has its observer"),
    *map(without_camera, ("model_sigma", "sensor", "sigma_image")),
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
        EXR, TIFF, CSV or NPY file of the size of the scene's film. With a scenario as its scene,
        the image of the scenario's camera, whose model of noise counts.
    channel : str, optional
        Channel of an EXR file ("Y").
    quantity : str, optional
        "radiance" [W m^-2 sr^-1] or "apparent_temperature" [K]; of a camera's image "counts" or
        "apparent_temperature". Needed except for EXR.
    scale : float
        Number by which the values of the file are multiplied, such as 0.01 for centikelvin.
    mask : str, optional
        PNG, TIFF, CSV or NPY file; pixels that are 0 do not count.
    saturation : float, optional
        Pixels of this value and above do not count. In the unit of `quantity`.
    sigma_image : str, optional
        Image of the noise's standard deviation in the unit of `quantity`.
    gain, offset : bool
        Whether measured = gain x radiance + offset, with an unknown gain or offset.
    gain_prior, offset_prior : tuple of float, optional
        Mean and standard deviation that are known beforehand.
    model_sigma : str, optional
        Standard deviation of the error of the predicted radiance itself, such as "1%", for a
        geometry or a material that is slightly wrong. There is one such error for each group that
        an image shows, common to all pixels that see the group, and one for each pixel.
    row_noise, column_noise, frame_noise : float
        Standard deviation of an error that all pixels of a row, of a column, or of the image share,
        relative to the noise that each pixel has for itself.
    intensity : float, optional
        Intensity of the target, W/sr, in place of an image.
    contrast : float, optional
        Contrast irradiance of the target at the sensor, W m^-2, in place of an image.
    spectrum : str, optional
        CSV with the columns wavelength_um, radiance_W_m2_sr_um and, without `sigma`,
        sigma_W_m2_sr_um: mean spectral radiance of all that the scene's sensor sees, at even
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
    model_sigma: str | None = None
    row_noise: float = entry(0.0, lower=0)
    column_noise: float = entry(0.0, lower=0)
    frame_noise: float = entry(0.0, lower=0)
    intensity: float | None = None
    contrast: float | None = None
    trend: str | None = entry(None, is_file=True)
    spectrum: str | None = entry(None, is_file=True)

    def complete(self) -> None:
        fraction(self.model_sigma)  # raises InputError for what is none

    @property
    def is_of_camera(self) -> bool:
        """Whether the image is that of a scenario's camera."""
        return self.image is not None and self.scene.endswith(".toml")

    @property
    def model_error(self) -> float:
        """model_sigma as a number; 0 without it."""
        return fraction(self.model_sigma) or 0.0


@dataclass(frozen=True)
class Candidate(Observation, rules=(one_of("netd_mK", "sigma"),)):
    """Table [[candidates]]: a measurement that could be made; what it would bring is computed.

    Its noise is `netd_mK` or `sigma` of an image.
    """
