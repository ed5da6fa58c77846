"""Parameters of a staring infrared camera with optics, a detector array and electronics."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from mi_lcair.declared import Described, Rule, entry, excludes, needs, rule, together
from mi_lcair.errors import InputError, check_known
from mi_lcair.files import parse_toml, read_text
from mi_lcair.physics.bands import Band
from mi_lcair.physics.bands import band as band_of

MOST_PIXELS = 8192  # pixels along each side of a frame
MOST_IN_FRAME = 2**24  # pixels of a frame
# Smallest f-number, for a cone of light with a half angle of 90 degrees (Abbe's sine condition).
FASTEST = 0.5
SLOWEST = 1e4  # largest f-number; that of a pinhole is some hundred
NARROWEST_DEG, WIDEST_DEG = 1e-4, 150.0  # width and height of a frame, degrees
# Counts below zero signal, as a fraction of the largest count. Read noise would be clipped at 0.
PEDESTAL = 1 / 64
POSITIVE, NOT_NEGATIVE = {"is_positive": True}, {"lower": 0}
MILLIKELVIN = {"lower": 0, "upper": 1e5}
SHARE, ASIDE = {"is_positive": True, "upper": 1}, {"lower": -45, "upper": 45}
BOLOMETER = {"detector": "bolometer"}
# Numbers of a photon detector that a bolometer has not
OF_ELECTRONS = (
    "well_Me",
    "quantum_efficiency",
    "read_noise_e",
    "dark_current_e_s",
    "offset_nonuniformity_e",
)
# Standard deviations that are the same in all frames: of pixels, rows and columns; and those that
# are new in each frame: of the whole frame, its rows and its columns.
FIXED = ("sigma_vh_mK", "sigma_v_mK", "sigma_h_mK")
TEMPORAL = ("sigma_t_mK", "sigma_tv_mK", "sigma_th_mK")
DRIFTS = ("drift_mK_K", "drift_spread_mK_K")


def of_a_view(name: str) -> Rule:
    """The rule that the frame's width or height is a possible angle of view."""

    def message(camera: "Imager"):
        angle = camera.angle_deg(getattr(camera, name))
        if not NARROWEST_DEG <= angle <= WIDEST_DEG:
            return (
                f"the {name} of the frame is {angle:.3g} degrees; must lie in "
                f"{NARROWEST_DEG:g}..{WIDEST_DEG:g}; change focal_length_mm, pitch_um or {name}"
            )
        return None

    return Rule(message)


RULES = (
    rule(
        lambda t: t.width * t.height <= MOST_IN_FRAME,
        f"{{t.width}} x {{t.height}} pixels; a frame has at most {MOST_IN_FRAME:.2g}",
    ),
    of_a_view("width"),
    of_a_view("height"),
    needs(
        "cos4",
        projection="perspective",
        why="all rays of an orthographic camera are parallel to its axis",
    ),
    needs("optics_emissivity", "optics_temperature"),
    together("integration_time_ms", "well_Me", unless='detector = "bolometer"'),
    Rule(
        excludes("detector", *OF_ELECTRONS, why="a bolometer counts no electrons").message,
        {"detector": OF_ELECTRONS},
    ),
    needs("detector", "netd_mK", "span_K", why="they are its noise and its saturation"),
    *(needs(name, **BOLOMETER) for name in ("netd_mK", "span_K", "time_constant_ms")),
    rule(
        lambda t: t.span_K is None or t.span_K[0] < t.span_K[1],
        "span_K = {t.span_K[0]:g}, {t.span_K[1]:g}; give the lower temperature first",
    ),
    excludes("housing", "housing_walk_K", "housing_walk_s"),
    together("housing_walk_K", "housing_walk_s"),
    *(needs(name, "housing", "housing_walk_K", any_of=True) for name in DRIFTS),
    excludes("shutter_s", "shutter_every_s"),
)


@dataclass(frozen=True)
class Imager(Described, where="[camera]", rules=RULES):
    """Parameters of a staring camera. It is table [camera] of a scenario.

    Attributes
    ----------
    focal_length_mm, f_number : float
        Focal length, mm, and its ratio to the diameter of the entrance pupil.
    pitch_um : float
        Distance between the centres of neighbouring pixels, um.
    width, height : int
        Number of pixels.
    integration_time_ms : float
        Time during which the electrons of a frame are collected, ms.
    well_Me : float
        Largest number of electrons of a pixel, in millions.
    quantum_efficiency : float
        Electrons per photon, in (0, 1]. A response of [sensor] multiplies it.
    lens : str
        What the f-number N means: "aplanatic" for optics that obey Abbe's sine condition, with the
        solid angle pi / (4 N^2), or "thin" with pi / (4 N^2 + 1).
    cos4 : bool
        Whether the irradiance decreases as cos^4 of the angle from the optical axis.
    vignetting : float
        Share of the light that is blocked in the frame's corner, 0..0.99. It increases with the
        square of the distance from the optical axis.
    optics_temperature : float, optional
        Temperature of the optics, K. Their emission reaches the detector. None for cold optics.
    optics_emissivity : float, optional
        Emissivity of the optics, by default 1 - optics_transmittance of [sensor].
    fill_factor : float
        Share of the pixel's square that is sensitive, in (0, 1].
    read_noise_e : float
        Standard deviation of the electronics' noise, electrons.
    dark_current_e_s : float
        Dark current of a pixel, electrons per second.
    bits : int
        Bits of a count, 1..16.
    jitter_urad : float
        Standard deviation of the line of sight during the integration along each axis, microrad.
    defocus_um : float
        Distance of the detector from the focal plane, um.
    gain_nonuniformity : float
        Standard deviation of the pixels' gains, as a fraction of their mean.
    offset_nonuniformity_e : float
        Standard deviation of the pixels' offsets, electrons.
    nuc : bool
        Whether the camera corrects its non-uniformity with two uniform scenes.
    right_deg, up_deg : float
        Angle of the optical axis to the right of the target's middle and above it, degrees.
    roll_deg : float
        Rotation of the camera about its optical axis, clockwise as seen from behind it, degrees.
    projection : str
        "perspective", or "orthographic" with the scale of the target's range.
    least_pixels : float
        Number of pixels on the target that a detection needs.
    preset : str, optional
        Class of camera that gives all values that are not in the file: "insb_mwir" (cooled) or
        "microbolometer_12um". Their sources are in `mi_lcair/physics/cameras.toml`.
    detector : str
        "photon", which counts electrons, or "bolometer", whose signal is the power on a pixel.
    netd_mK, netd_f_number, netd_temperature : float, optional
        Temporal noise of a bolometer: its noise-equivalent temperature difference `netd_mK`, mK,
        given for the f-number `netd_f_number` (by default that of the camera) and the scene
        temperature `netd_temperature`, K.
    span_K : tuple of float, optional
        Temperatures of uniform scenes, K, for a bolometer's lowest and largest count.
    time_constant_ms : float
        Thermal time constant of a bolometer, ms. The frames of a flight lag by this time.
    frame_rate_hz : float, optional
        Frames per second of `image`. A flight has its own times.
    sigma_vh_mK, sigma_v_mK, sigma_h_mK : float
        Fixed pattern that remains after the correction: standard deviation of pixels (vh), rows (v)
        and columns (h), mK at the f-number and temperature of the netd.
    sigma_tv_mK, sigma_th_mK, sigma_t_mK : float
        Noise that changes from frame to frame: standard deviation of rows (tv), columns (th) and
        the whole frame (t), mK.
    housing : str, optional
        CSV of the housing's temperature with the columns time_s and temperature_K.
    housing_walk_K, housing_walk_s : float, optional
        Random walk of the housing's temperature: standard deviation `housing_walk_K` of its change,
        K, during the time `housing_walk_s`, s.
    drift_mK_K, drift_spread_mK_K : float
        Change of the apparent temperature, mK, for each kelvin that the housing is warmer than at
        the last shutter event: mean over the pixels (drift) and standard deviation (spread).
    shutter_s : tuple of float, optional
        Times after the first frame, s, at which the shutter closes and the offsets are measured
        again. At the first frame the offsets are corrected.
    shutter_every_s : float, optional
        Time between shutter events, s.

    Raises
    ------
    InputError
        If a value is out of its range.
    """

    focal_length_mm: float = entry(**POSITIVE)
    f_number: float = entry(lower=FASTEST, upper=SLOWEST)
    pitch_um: float = entry(**POSITIVE)
    width: int = entry(lower=1, upper=MOST_PIXELS)
    height: int = entry(lower=1, upper=MOST_PIXELS)
    integration_time_ms: float | None = entry(None, is_positive=True, upper=1e6)
    well_Me: float | None = entry(None, is_positive=True, upper=1e6)
    quantum_efficiency: float = entry(1.0, **SHARE)
    lens: Literal["aplanatic", "thin"] = "aplanatic"
    cos4: bool = False
    vignetting: float = entry(0.0, lower=0, upper=0.99)
    optics_temperature: float | None = entry(None, is_positive=True, upper=5000, unit="K")
    optics_emissivity: float | None = entry(None, lower=0, upper=1)
    fill_factor: float = entry(1.0, **SHARE)
    read_noise_e: float = entry(0.0, lower=0, upper=1e9)
    dark_current_e_s: float = entry(0.0, **NOT_NEGATIVE)
    bits: int = entry(14, lower=1, upper=16)
    jitter_urad: float = entry(0.0, **NOT_NEGATIVE)
    defocus_um: float = 0.0
    gain_nonuniformity: float = entry(0.0, lower=0, upper=10)
    offset_nonuniformity_e: float = entry(0.0, **NOT_NEGATIVE)
    nuc: bool = False
    right_deg: float = entry(0.0, **ASIDE)
    up_deg: float = entry(0.0, **ASIDE)
    roll_deg: float = entry(0.0, lower=-180, upper=180)
    projection: Literal["perspective", "orthographic"] = "perspective"
    least_pixels: float = entry(1.0, **NOT_NEGATIVE)
    preset: str | None = None
    detector: Literal["photon", "bolometer"] = "photon"
    netd_mK: float | None = entry(None, is_positive=True, upper=MILLIKELVIN["upper"])
    netd_f_number: float | None = entry(None, lower=FASTEST, upper=SLOWEST)
    netd_temperature: float = entry(300.0, lower=100, upper=1000, unit="K")
    span_K: tuple[float, float] | None = entry(None, is_positive=True, upper=5000)
    time_constant_ms: float = entry(0.0, lower=0, upper=1e4)
    frame_rate_hz: float | None = entry(None, is_positive=True, upper=1e6)
    sigma_vh_mK: float = entry(0.0, **MILLIKELVIN)
    sigma_v_mK: float = entry(0.0, **MILLIKELVIN)
    sigma_h_mK: float = entry(0.0, **MILLIKELVIN)
    sigma_tv_mK: float = entry(0.0, **MILLIKELVIN)
    sigma_th_mK: float = entry(0.0, **MILLIKELVIN)
    sigma_t_mK: float = entry(0.0, **MILLIKELVIN)
    housing: str | None = entry(None, is_file=True)
    housing_walk_K: float | None = entry(None, lower=0, upper=1e3)
    housing_walk_s: float | None = entry(None, **POSITIVE)
    drift_mK_K: float = entry(0.0, lower=-1e5, upper=1e5)
    drift_spread_mK_K: float = entry(0.0, **MILLIKELVIN)
    shutter_s: tuple[float, ...] | None = entry(None, lower=0)
    shutter_every_s: float | None = entry(None, **POSITIVE)

    @property
    def drifts(self) -> bool:
        """Whether offsets change with the temperature of the housing."""
        return any(getattr(self, name) for name in DRIFTS)

    @property
    def solid_angle(self) -> float:
        """Projected solid angle of the exit pupil seen from a pixel on the axis, sr.

        It is pi sin^2 of the cone's half angle. The f-number is 1 / (2 sin) for optics that obey
        Abbe's sine condition, and 1 / (2 tan) for a thin lens without it. The latter has 3.8 % less
        at f/2.5, and 1.5 % less at f/4.
        """
        return float(np.pi / (4 * self.f_number**2 + (self.lens == "thin")))

    @property
    def illumination(self) -> np.ndarray:
        """Light of an even scene in each pixel, relative to the optical axis, (height, width)."""
        columns, rows = (
            (np.arange(n) + 0.5 - n / 2) * self.pixel_angle for n in (self.width, self.height)
        )
        squared = columns**2 + rows[:, None] ** 2  # of the angle's tangent
        corner = (self.width**2 + self.height**2) * self.pixel_angle**2 / 4
        by_angle = (1 + squared) ** -2 if self.cos4 else 1.0
        return by_angle * (1 - self.vignetting * squared / corner)

    def emissivity_of_optics(self, transmittance: float) -> float:
        """Emissivity of optics with this transmittance; 0 for cold optics.

        Raises InputError if it and the transmittance are more than 1.
        """
        if self.optics_temperature is None:
            return 0.0
        if self.optics_emissivity is None:
            return 1 - transmittance
        if self.optics_emissivity + transmittance > 1 + 1e-9:
            raise InputError(
                f"[camera]: optics_emissivity = {self.optics_emissivity:g} and optics_transmittance"
                f" = {transmittance:g} of [sensor] add up to more than 1"
            )
        return self.optics_emissivity

    @property
    def pixel_area(self) -> float:
        """Sensitive area of a pixel, m^2."""
        return self.fill_factor * (1e-6 * self.pitch_um) ** 2

    @property
    def seconds(self) -> float:
        """Integration time, s; 0 if a bolometer has none."""
        return 1e-3 * (self.integration_time_ms or 0)

    @property
    def well(self) -> float:
        """Largest number of electrons of a pixel."""
        return 1e6 * self.well_Me

    @property
    def floor(self) -> float:
        """Signal below which a pixel is saturated, too."""
        return -np.inf

    @property
    def dark(self) -> float:
        """Mean number of electrons of the dark current in a frame."""
        return self.dark_current_e_s * self.seconds

    @property
    def pixel_angle(self) -> float:
        """Angle between the lines of sight of neighbouring pixels at the optical axis, rad."""
        return 1e-3 * self.pitch_um / self.focal_length_mm

    def angle_deg(self, pixels: int) -> float:
        """Angle of view of a row of pixels in the middle of the frame, degrees."""
        return float(np.degrees(2 * np.arctan(pixels * self.pixel_angle / 2)))

    @property
    def largest_count(self) -> int:
        """Largest count."""
        return 2**self.bits - 1

    @property
    def pedestal(self) -> float:
        """Count without any electron."""
        return PEDESTAL * self.largest_count

    @property
    def electrons_per_count(self) -> float:
        """Electrons of one count. The full well has the largest count."""
        return self.well / (self.largest_count - self.pedestal)

    unit, channel = "electrons", "electrons"  # of the signal

    def amount(self, signal: float) -> str:
        """A signal in words."""
        return f"{1e-6 * signal:.4g} Me"

    def noise(self, electrons: ArrayLike, with_pattern: bool = False) -> np.ndarray | float:
        """Standard deviation of a pixel in time, electrons, for this mean number of electrons.

        It is the quadratic sum of the shot noise of signal and dark current, of the electronics'
        noise, and of the quantisation, a twelfth of the squared count.

        with_pattern: adds the fixed pattern, by which uncorrected pixels differ from each other.
        """
        of_counts = self.electrons_per_count**2 / 12
        in_time = np.sqrt(np.maximum(electrons, 0) + self.dark + self.read_noise_e**2 + of_counts)
        if not with_pattern:
            return in_time
        pattern = np.hypot(self.gain_nonuniformity * electrons, self.offset_nonuniformity_e)
        return np.hypot(in_time, pattern)


# Values of classes of cameras by name: value and source of each key
PRESETS = Path(__file__).with_name("cameras.toml")
ASSUMED = "assumed"  # beginning of the source of a value that no publication states


def with_preset(values):
    """The values of a table [camera], with those of its preset where none is given."""
    name = values.get("preset") if isinstance(values, dict) else None
    if name is None:
        return values
    known = parse_toml(read_text(PRESETS, str(PRESETS)), str(PRESETS))
    check_known("preset of [camera]", known, str(name))
    replaced = set(values).union(*map(Imager.replaced, values))
    return {key: row[0] for key, row in known[name].items() if key not in replaced} | values


def assumed(imager: Imager) -> list[str]:
    """The values that a preset assumes, as no publication states them, such as "well_Me = 7"."""
    values = parse_toml(read_text(PRESETS, str(PRESETS)), str(PRESETS)).get(imager.preset, {})
    return [
        f"{key} = {value:g}"
        for key, (value, source) in values.items()
        if source.startswith(ASSUMED) and value == getattr(imager, key)
    ]


# A detector with a single pixel, which integrates its whole field of view (thesis 3.8)
# -------------------------------------------------------------------------------------

LOCK_ON = 10.0  # signal-to-noise ratio that a lock-on requires (thesis 3.8)


@dataclass(frozen=True)
class Detector(Described, where="sensor"):
    """Spectral band, optics and noise of a detector.

    The signal is the contrast irradiance at the aperture times optics_transmittance. It is detected
    if its absolute value is at least snr * nei. Irradiances are weighted by the band's response.

    Attributes
    ----------
    band
        Band with the detector's response, in any form that `mi_lcair.physics.bands.band` reads.
    optics_transmittance
        Transmittance of the optics, in (0, 1].
    field_of_view_deg
        Full angle of the conical field of view, in (0, 180] [degrees]; None if it is not limited.
    nei
        Noise-equivalent irradiance behind the optics [W m^-2]. A value stated at the aperture, as
        in the thesis, includes the optics; optics_transmittance is then left at 1.
    snr
        Required signal-to-noise ratio.

    Raises
    ------
    InputError
        If a value is out of its range.
    """

    band: Band
    optics_transmittance: float = entry(1.0, is_positive=True, upper=1)
    field_of_view_deg: float | None = entry(None, is_positive=True, upper=180)
    nei: float | None = entry(None, is_positive=True, upper=1e4, unit="W m^-2")
    snr: float = entry(LOCK_ON, is_positive=True)

    def complete(self) -> None:
        self.derive(band=band_of(self.band))

    @property
    def solid_angle(self) -> float | None:
        """Solid angle of the field of view [sr]; None if field_of_view_deg is None."""
        if self.field_of_view_deg is None:
            return None
        return 4 * np.pi * np.sin(np.radians(self.field_of_view_deg) / 4) ** 2

    def signal(self, irradiance: ArrayLike) -> np.ndarray | float:
        """Signal behind the optics [W m^-2] for a contrast irradiance at the aperture [W m^-2].

        The contrast may be positive or negative.
        """
        return self.optics_transmittance * np.asarray(irradiance)[()]

    def detects(self, irradiance: ArrayLike) -> np.ndarray | bool:
        """Whether a contrast irradiance at the aperture [W m^-2] is detected.

        Raises InputError if nei is None.
        """
        if self.nei is None:
            raise InputError(
                "sensor: nei is missing; give the noise-equivalent irradiance in W m^-2"
            )
        return np.abs(self.signal(irradiance)) >= self.snr * self.nei

    def nei_max(self, irradiance: ArrayLike) -> np.ndarray | float:
        """Largest nei [W m^-2] at which a contrast irradiance is detected (thesis Eq 3.14).

        irradiance: contrast irradiance at the aperture [W m^-2].
        """
        return np.abs(self.signal(irradiance)) / self.snr
