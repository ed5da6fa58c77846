"""Frames of a camera: electrons with noise, the full well, and counts."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from mi_lcair.detection.camera.exposure import detector_mean
from mi_lcair.detection.camera.optics import Optics, Turbulence
from mi_lcair.detection.irradiance import Backdrop
from mi_lcair.detection.scenario import Scenario
from mi_lcair.errors import InputError
from mi_lcair.physics import blackbody
from mi_lcair.physics.bands import Band
from mi_lcair.physics.imager import Detector, Imager

PATTERN, FRAME = 0, 1  # first number of the seeds of independent random numbers


@dataclass(frozen=True)
class Pattern:
    """Fixed pattern of a detector array.

    gain: gains of the pixels, mean 1, (H, W). offset: their offsets, electrons, (H, W).
    """

    gain: np.ndarray
    offset: np.ndarray

    @staticmethod
    def of(imager: Imager, seed: int) -> "Pattern":
        """The pattern of the camera with this seed. Gains are not negative."""
        random = np.random.default_rng([PATTERN, seed])
        shape = imager.height, imager.width
        return Pattern(
            np.maximum(1 + imager.gain_nonuniformity * random.standard_normal(shape), 0),
            imager.offset_nonuniformity_e * random.standard_normal(shape),
        )


def frame(
    imager: Imager, pattern: Pattern, signal, seed: int, number: int = 0, averaged: int = 1
) -> np.ndarray:
    """Electrons of a frame with noise, before quantisation.

    Signal and dark current have Poisson noise, the electronics Gaussian noise. The electrons of the
    signal are multiplied with the gains. A pixel holds no more than the full well.

    Parameters
    ----------
    imager : Imager
    pattern : Pattern
        Fixed pattern of the camera.
    signal : float or ndarray, shape (H, W)
        Mean number of electrons of a pixel without non-uniformity.
    seed, number : int
        Seed, and number of the frame. The same numbers give the same frame.
    averaged : int
        Number of frames whose mean is returned.

    Returns
    -------
    ndarray, shape (H, W)
    """
    random = np.random.default_rng([FRAME, seed, number, averaged])
    mean = np.clip(signal, 0, None) * pattern.gain + imager.dark
    # More than this fills the well for certain, and might be too much for the random numbers
    mean = np.minimum(mean, imager.well + 100 * np.sqrt(imager.well) + 1000)
    collected = random.poisson(averaged * mean) / averaged
    noise = imager.read_noise_e / np.sqrt(averaged) * random.standard_normal(mean.shape)
    return np.minimum(collected, imager.well) + pattern.offset + noise


def counts(imager: Imager, electrons) -> np.ndarray:
    """Counts of the electrons, whole numbers from 0 to the largest count, uint16."""
    raw = np.rint(electrons / imager.electrons_per_count + imager.pedestal)
    return np.clip(raw, 0, imager.largest_count).astype(np.uint16)


def signal_of(imager: Imager, counts) -> np.ndarray:
    """Electrons of the signal that the counts stand for, without the mean dark current."""
    return (counts - imager.pedestal) * imager.electrons_per_count - imager.dark


def saturated(imager: Imager, signal) -> float:
    """Share of the pixels whose mean number of electrons is the full well or more."""
    return float(np.mean(np.asarray(signal) + imager.dark >= imager.well))


# Electrons of a pixel for a spectral radiance at the aperture
# ------------------------------------------------------------
# The camera counts photons, and a photon carries the energy h c / wavelength. Its response to a
# radiance in watts is therefore proportional to the wavelength.

# Points between two rows of a response. The product of two straight lines is a parabola, which the
# points replace by straight lines.
BETWEEN = 8


def electron_band(band: Band, imager: Imager, optics_transmittance: float = 1.0) -> Band:
    """The band in which the in-band value of a spectral radiance is a number of electrons.

    The electrons of a pixel are the integral of L(x) x / (h c) QE(x) over the wavelength x, times
    the optics' transmittance, the solid angle of the pupil, the pixel's area and the time. The
    response of `band` multiplies the camera's quantum efficiency.

    Parameters
    ----------
    band : Band
        Band of the detector with its response, not `total`.
    imager : Imager
    optics_transmittance : float
        Transmittance of the optics.

    Returns
    -------
    Band
        `in_band_radiance` of it gives the electrons of a blackbody that fills the pixel.
    """
    energy = blackbody.PLANCK * blackbody.LIGHT_SPEED * 1e6  # J um
    per_um = (
        optics_transmittance
        * imager.quantum_efficiency
        * imager.solid_angle
        * imager.pixel_area
        * imager.seconds
        / energy
    )
    rows = np.array([band.lower_um, band.upper_um])
    if band.response is not None:
        x = band.response[0]
        rows = np.interp(np.arange(BETWEEN * (len(x) - 1) + 1) / BETWEEN, np.arange(len(x)), x)
    return replace(
        band,
        weights_um=band.weights_um * per_um * band.wavelengths_um,
        response=np.array([rows, per_um * rows * band.response_at(rows)]),
    )


def electrons(electron_band: Band, temperature):
    """Electrons of a pixel that a blackbody of this temperature, K, fills."""
    return blackbody.in_band_radiance(electron_band, temperature)


def electrons_per_kelvin(electron_band: Band, temperature: float) -> float:
    """Change of the electrons with the temperature of a blackbody, at `temperature`, K."""
    return float(blackbody.in_band_slope(electron_band, temperature))


def in_kelvin(electron_band: Band, electrons, deviation) -> np.ndarray:
    """Change of the apparent temperature, K, that a deviation of the electrons makes.

    The deviation is added. It stays finite where a pixel has no electrons.
    """
    return apparent_temperature(electron_band, electrons + deviation) - apparent_temperature(
        electron_band, electrons
    )


def apparent_temperature(electron_band: Band, electrons) -> np.ndarray:
    """Temperature, K, of the blackbody that gives these electrons; 0 where they are not positive.

    It is the inverse of `electrons`.
    """
    return blackbody.brightness_temperature(electron_band, np.maximum(electrons, 0))


# Two-point non-uniformity correction, and the camera's calibration to apparent temperature
# -----------------------------------------------------------------------------------------

AVERAGED = 64  # frames of each uniform scene of the correction
# First numbers of the frames of the uniform scenes. Frames of images have smaller ones.
SCENES = 2**31
DISTINCT = 10  # smallest difference of the uniform scenes, in standard deviations of a frame
SMALLEST_GAIN = 1e-3  # relative gain below which a pixel counts as dead
SPAN_K = 10.0  # distance of the uniform scenes' temperatures from the middle one, K


@dataclass(frozen=True)
class Correction:
    """Linear correction of each pixel: (electrons - offset) / gain.

    gain, offset: (H, W) or numbers; offset in electrons.
    """

    gain: np.ndarray | float = 1.0
    offset: np.ndarray | float = 0.0

    def applied(self, signal: np.ndarray) -> np.ndarray:
        """Corrected electrons of the signal."""
        return (signal - self.offset) / self.gain

    def undone(self, corrected: np.ndarray) -> np.ndarray:
        """The signal of which these are the corrected electrons."""
        return corrected * self.gain + self.offset


def two_point(
    imager: Imager,
    pattern: Pattern,
    design: Correction,
    electron_band: Band,
    temperature: float,
    seed: int,
) -> Correction:
    """Correction from two uniform blackbodies SPAN_K below and above `temperature`, K.

    Each is the mean of AVERAGED frames. What is left of the fixed pattern is their noise. The
    correction holds that of the optics' `design`, too.

    Raises
    ------
    InputError
        If the warmer blackbody saturates the camera, or the noise hides the difference of both.
    """
    cold, warm = temperature - SPAN_K, temperature + SPAN_K
    low, high = (float(electrons(electron_band, T)) for T in (cold, warm))
    most = float(np.max(design.undone(high)))
    noise = float(imager.noise(most))
    if not high - low > DISTINCT * noise:
        raise InputError(
            f"[camera]: nuc looks at blackbodies of {cold:.4g} and {warm:.4g} K, which differ by "
            f"{high - low:.3g} electrons with a noise of {noise:.3g}; lengthen "
            "integration_time_ms, or leave nuc out"
        )
    if most * pattern.gain.max() + imager.dark >= imager.well:
        raise InputError(
            f"[camera]: nuc looks at a blackbody of {warm:.4g} K, which gives "
            f"{1e-6 * most:.4g} Me and saturates the well of {imager.well_Me:g} Me; shorten "
            "integration_time_ms"
        )
    first, second = (
        frame(imager, pattern, design.undone(level), seed, SCENES + k, AVERAGED) - imager.dark
        for k, level in enumerate((low, high))
    )
    gain = (second - first) / (high - low)
    # A pixel without a gain cannot be corrected; it keeps the colder scene
    gain = np.where(gain > SMALLEST_GAIN, gain, 1.0)
    return Correction(gain, first - gain * low)


# A camera that looks at a background: its electrons, optics, fixed pattern and correction
# ----------------------------------------------------------------------------------------

# Temperature of the blackbody whose spectrum weights the diffraction, K.
DIFFRACTION_K = 300.0
# Smallest temperature, K, at which the NETD is stated and the non-uniformity is corrected. It
# stands for the background where that is colder, such as space.
COLDEST_K = 100.0


@dataclass(frozen=True)
class Camera:
    """A camera that looks at a background.

    Attributes
    ----------
    imager : Imager
    band : Band
        Band of the detector. Its in-band value of a spectral radiance is a number of electrons.
    optics : Optics
    design : Correction
        Relative illumination of the pixels, and electrons of the optics' own emission in each.
    background : float
        Electrons of the background in a pixel on the optical axis, without the optics' emission.
    temperature : float
        Apparent temperature of the background, K, or COLDEST_K if that is more.
    pattern : Pattern
        Fixed pattern of the detector array.
    correction : Correction
        Non-uniformity correction; that of the `design` without `nuc`.
    seed : int
        Seed of the noise and of the fixed pattern.
    """

    imager: Imager
    band: Band
    optics: Optics
    design: Correction
    background: float
    temperature: float
    pattern: Pattern
    correction: Correction
    seed: int

    @staticmethod
    def of(scenario: Scenario, detector: Detector, behind: Backdrop, seed: int) -> "Camera":
        """The camera of a scenario with this detector in front of a background.

        Raises InputError if the camera cannot be corrected, or spreads light too far.
        """
        imager, air, turbulence = scenario.camera, scenario.atmosphere, None
        if air.cn2:
            turbulence = Turbulence(air.cn2, air.wave, scenario.observer.range_m)
        band = electron_band(detector.band, imager, detector.optics_transmittance)
        background = detector_mean(behind, band)
        temperature = max(float(apparent_temperature(band, background)), COLDEST_K)
        design = correction = Correction(imager.illumination, glow(imager, detector))
        pattern = Pattern.of(imager, seed)
        if imager.nuc:
            correction = two_point(imager, pattern, design, band, temperature, seed)
        thermal = partial(blackbody.spectral_radiance, temperature=DIFFRACTION_K)
        optics = Optics(imager, band, thermal, turbulence)
        optics.check_spread()
        return Camera(
            imager, band, optics, design, background, temperature, pattern, correction, seed
        )

    def kept_contrast(self, background: ArrayLike, contrast: np.ndarray) -> np.ndarray:
        """What a full well keeps of the electrons by which pixels differ from a background."""
        behind, most = background + self.design.offset, self.imager.well - self.imager.dark
        return np.minimum(behind + contrast, most) - np.minimum(behind, most)

    def frames(self, signal: np.ndarray, count: int) -> np.ndarray:
        """Counts of frames of a scene with these mean electrons (H, W), (count, H, W)."""
        return np.array([self.frame(signal, number) for number in range(count)])

    def frame(self, signal: np.ndarray, number: int) -> np.ndarray:
        """Counts of one frame of a scene with these mean electrons (H, W)."""
        return counts(self.imager, frame(self.imager, self.pattern, signal, self.seed, number))

    def temperatures(self, frame_counts: np.ndarray) -> np.ndarray:
        """Apparent temperatures, K, of a corrected frame of counts."""
        recorded = signal_of(self.imager, frame_counts.astype(float))
        return apparent_temperature(self.band, self.correction.applied(recorded))

    def mean_temperatures(self, signal: np.ndarray, error: np.ndarray) -> dict[str, np.ndarray]:
        """Channels, K, of the mean electrons of pixels, and of their standard error.

        They are the apparent temperature, the rendering's standard error, and the noise in time.
        Both arguments are of the scene, before the optics' illumination and emission.
        """
        noise = self.imager.noise(self.design.undone(signal)) / self.design.gain
        return {
            "mean_temperature.Y": apparent_temperature(self.band, signal),
            "stderr_K.Y": in_kelvin(self.band, signal, error),
            "noise_K.Y": in_kelvin(self.band, signal, noise),
        }


def glow(imager: Imager, detector: Detector) -> float:
    """Electrons in a pixel of what the optics emit, which fills the cone of the f-number.

    Raises InputError if emissivity and transmittance of the optics add up to more than 1.
    """
    emissivity = imager.emissivity_of_optics(detector.optics_transmittance)
    if emissivity == 0:
        return 0.0
    return float(
        electrons(electron_band(detector.band, imager, emissivity), imager.optics_temperature)
    )
