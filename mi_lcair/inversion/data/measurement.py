"""Measurements of an inverse problem and candidates for further ones: [[data]], [[candidates]]."""

import re
from dataclasses import dataclass, field

from mi_lcair.declared import check_fields, fraction, within
from mi_lcair.errors import InputError, check_known
from mi_lcair.inversion.tables import check_prior
from mi_lcair.toml_table import texts

QUANTITIES = ("radiance", "apparent_temperature")
CAMERA_QUANTITIES = ("counts", "apparent_temperature")
NAME_KEY = re.compile(r"[^\[\],]{1,64}")


@dataclass(frozen=True)
class Observation:
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

    scene: str
    name: str = ""
    parameters: dict = field(default_factory=dict)
    sensor: int = field(default=0, metadata=within(lower=0))
    state: str = ""
    netd_mK: float | None = field(default=None, metadata=within(is_positive=True))
    sigma: float | None = field(default=None, metadata=within(is_positive=True))

    def __post_init__(self):
        check_fields(self)
        self.scene_parameters()
        for key in ("name", "state"):
            if (text := getattr(self, key)) and not NAME_KEY.fullmatch(text):
                raise InputError(
                    f"{key} = '{text}'; must have 1 to 64 characters, without brackets and commas"
                )

    def scene_parameters(self) -> dict[str, str]:
        """The scene's $-parameters as text."""
        return texts("parameters", self.parameters)

    def noises(self) -> list[str]:
        """Names of the entries that state the noise."""
        return [key for key in ("netd_mK", "sigma") if getattr(self, key) is not None]


@dataclass(frozen=True)
class Measurement(Observation):
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

    image: str | None = None
    channel: str | None = None
    quantity: str | None = None
    scale: float = 1.0
    mask: str | None = None
    saturation: float | None = None
    sigma_image: str | None = None
    gain: bool = False
    offset: bool = False
    gain_prior: tuple[float, ...] | None = None
    offset_prior: tuple[float, ...] | None = None
    model_sigma: str | None = None
    row_noise: float = field(default=0.0, metadata=within(lower=0))
    column_noise: float = field(default=0.0, metadata=within(lower=0))
    frame_noise: float = field(default=0.0, metadata=within(lower=0))
    intensity: float | None = None
    contrast: float | None = None
    trend: str | None = None
    spectrum: str | None = None

    def __post_init__(self):
        super().__post_init__()
        kinds = [
            key
            for key in ("image", "intensity", "contrast", "trend", "spectrum")
            if getattr(self, key) is not None
        ]
        if len(kinds) != 1:
            raise InputError(
                f"has {' and '.join(kinds) or 'no measurement'}; give one of image, "
                "intensity, contrast, trend and spectrum"
            )
        if self.contrast is not None and self.sensor:
            raise InputError(f"sensor = {self.sensor}: a scenario has its observer; leave it out")
        self._check_camera()
        self._check_noise()
        quantities = CAMERA_QUANTITIES if self.is_of_camera else QUANTITIES
        check_known("quantity", quantities, self.quantity)
        if self.scale == 0:
            raise InputError("scale = 0; must not be zero")
        if self.model_error and not self.image:
            raise InputError("model_sigma belongs to an image, and this is a number; raise sigma")
        for key in ("row_noise", "column_noise", "frame_noise", "gain", "offset"):
            if getattr(self, key) and not self.image:
                raise InputError(f"{key} belongs to an image, and this is a number; raise sigma")
        for key in ("gain", "offset"):
            prior = getattr(self, f"{key}_prior")
            if prior is not None and not getattr(self, key):
                raise InputError(f"{key}_prior is given without {key} = true")
            check_prior(prior, f"{key}_prior")

    @property
    def is_of_camera(self) -> bool:
        """Whether the image is that of a scenario's camera."""
        return self.image is not None and self.scene.endswith(".toml")

    def _check_camera(self):
        if not self.is_of_camera:
            return
        for key in ("model_sigma", "sensor", "sigma_image"):
            if getattr(self, key):
                raise InputError(f"{key} does not go with the image of a scenario's camera")
        if self.offset and self.offset_prior is None:
            raise InputError("offset of a camera's image needs offset_prior, in electrons")

    def _check_noise(self):
        noises = self.noises()
        if self.is_of_camera:
            if noises:
                raise InputError(
                    f"states its noise by {' and '.join(noises)}, but the [camera] of "
                    f"{self.scene} has its own; leave it out"
                )
            return
        allowed = ("netd_mK", "sigma", "sigma_image") if self.image else ("sigma",)
        if (self.trend or self.spectrum) and not noises:
            return  # the file states it
        if len(noises) != 1 or noises[0] not in allowed:
            raise InputError(
                f"states its noise by {' and '.join(noises) or 'nothing'}; "
                f"give {'one of ' if len(allowed) > 1 else ''}{', '.join(allowed)}"
            )

    @property
    def model_error(self) -> float:
        """model_sigma as a number; 0 without it."""
        return fraction(self.model_sigma) or 0.0

    def noises(self) -> list[str]:
        return [*super().noises(), *(["sigma_image"] if self.sigma_image is not None else [])]


@dataclass(frozen=True)
class Candidate(Observation):
    """Table [[candidates]]: a measurement that could be made; what it would bring is computed.

    Its noise is `netd_mK` or `sigma` of an image.
    """

    def __post_init__(self):
        super().__post_init__()
        if len(self.noises()) != 1:
            raise InputError("needs its noise; give one of netd_mK, sigma")
