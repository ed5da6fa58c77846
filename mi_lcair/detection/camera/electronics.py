"""Frames of a camera: electrons with noise, the full well, and counts."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from mi_lcair.detection.camera.bolometer import Bolometer, housing_changes, signal_per_kelvin
from mi_lcair.detection.camera.exposure import detector_mean
from mi_lcair.detection.camera.optics import Optics, Turbulence
from mi_lcair.detection.irradiance import Backdrop
from mi_lcair.detection.scenario import Scenario
from mi_lcair.errors import InputError
from mi_lcair.laboratory.noise import NoiseComponents
from mi_lcair.physics import blackbody
from mi_lcair.physics.bands import Band
from mi_lcair.physics.imager import DRIFTS, FIXED, TEMPORAL, Detector, Imager

# First numbers of the seeds of independent random numbers
PATTERN, FRAME, RESIDUAL, ROWS_AND_COLUMNS = range(4)


@dataclass(frozen=True)
class Pattern:
    """Fixed pattern of a detector array, and what rows, columns and the housing add to it.

    gain: gains of the pixels, mean 1, (H, W). offset: their offsets, electrons, (H, W). drift:
    change of the offsets for each kelvin of the housing, (H, W). temporal: standard deviations of
    the whole frame, its rows and its columns. fixed: those of pixels, rows and columns that are in
    `offset` beside the offset nonuniformity.
    """

    gain: np.ndarray
    offset: np.ndarray
    drift: np.ndarray | float = 0.0
    temporal: tuple[float, ...] = (0.0, 0.0, 0.0)
    fixed: tuple[float, ...] = (0.0, 0.0, 0.0)

    @staticmethod
    def of(imager: Imager, seed: int, per_kelvin: float = 0.0) -> "Pattern":
        """The pattern of the camera with this seed. Gains are not negative.

        per_kelvin: signal of a kelvin, for what the camera states in mK. 0 leaves that out.
        """
        random = np.random.default_rng([PATTERN, seed])
        shape = imager.height, imager.width
        pattern = Pattern(
            np.maximum(1 + imager.gain_nonuniformity * random.standard_normal(shape), 0),
            imager.offset_nonuniformity_e * random.standard_normal(shape),
        )
        stated = *FIXED, *TEMPORAL, *DRIFTS
        if not per_kelvin or not any(getattr(imager, name) for name in stated):
            return pattern
        random, per_mK = np.random.default_rng([RESIDUAL, seed]), 1e-3 * per_kelvin
        pixels, rows, columns, drift = (
            random.standard_normal(n) for n in (shape, *sides(shape), shape)
        )
        fixed = tuple(per_mK * getattr(imager, name) for name in FIXED)
        return replace(
            pattern,
            offset=pattern.offset + (fixed[0] * pixels + fixed[1] * rows + fixed[2] * columns),
            drift=per_mK * (imager.drift_mK_K + imager.drift_spread_mK_K * drift),
            temporal=tuple(per_mK * getattr(imager, name) for name in TEMPORAL),
            fixed=fixed,
        )

    @property
    def total(self) -> float:
        """Standard deviation of what rows, columns, frames and the residual pattern add."""
        return float(np.linalg.norm([*self.fixed, *self.temporal]))

    @property
    def shared(self) -> tuple[float, float, float]:
        """Variances that pixels share: in a frame, a row and a column."""
        frame, rows, columns = np.square(self.temporal)
        _, fixed_rows, fixed_columns = np.square(self.fixed)
        return frame, rows + fixed_rows, columns + fixed_columns

    def products(self, images: np.ndarray, magnified: float = 1.0) -> np.ndarray:
        """What the shared variances add to the sums of products of images (K, h, w), (K, K).

        For a matched filter D the sum over the pixels of D^2 times a variance of its own is the
        variance of the filter's output; one that pixels share adds the square of the sum of D over
        them. Here it is less what it would add if the pixels did not share it. magnified: factor by
        which the images are larger than given.
        """
        if not any(self.shared):
            return np.zeros((len(images), len(images)))
        flat = images.reshape(len(images), -1)
        alone = magnified**2 * flat @ flat.T
        sums = (images.sum(axis=axes).reshape(len(images), -1) for axes in ((1, 2), 2, 1))
        return sum(
            variance * (magnified**power * of @ of.T - alone)
            for variance, power, of in zip(self.shared, (4, 3, 3), sums)
        )

    def offsets(self, seed: int, number: int, averaged: int, warmer_K: float) -> np.ndarray:
        """Offsets of a frame, in which the housing is warmer than at the last shutter event."""
        if not any(self.temporal) and warmer_K == 0:
            return self.offset
        random = np.random.default_rng([ROWS_AND_COLUMNS, seed, number, averaged])
        new = sum(
            sigma * random.standard_normal(side)
            for sigma, side in zip(self.temporal, ((1, 1), *sides(self.gain.shape)))
        )
        return self.offset + new / np.sqrt(averaged) + warmer_K * self.drift


def sides(shape: tuple[int, int]) -> tuple[tuple[int, int], tuple[int, int]]:
    """Shapes of a number for each row, and of one for each column."""
    return (shape[0], 1), (1, shape[1])


def frame(
    imager: Imager,
    pattern: Pattern,
    signal,
    seed: int,
    number: int = 0,
    averaged: int = 1,
    warmer_K: float = 0.0,
) -> np.ndarray:
    """Electrons of a frame with noise, before quantisation.

    Signal and dark current have Poisson noise, the electronics Gaussian noise. The electrons of the
    signal are multiplied with the gains. A pixel holds no more than the full well. A bolometer's
    signal is its power, W, with Gaussian noise; the converter limits it.

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
    warmer_K : float
        By how much the housing is warmer than at the last shutter event, K.

    Returns
    -------
    ndarray, shape (H, W)
    """
    random = np.random.default_rng([FRAME, seed, number, averaged])
    mean = np.clip(signal, 0, None) * pattern.gain + imager.dark
    if isinstance(imager, Bolometer):
        collected, sigma = mean, imager.nep
    else:
        # More than this fills the well for certain, and might be too much for the random numbers
        mean = np.minimum(mean, imager.well + 100 * np.sqrt(imager.well) + 1000)
        collected = np.minimum(random.poisson(averaged * mean) / averaged, imager.well)
        sigma = imager.read_noise_e
    noise = sigma / np.sqrt(averaged) * random.standard_normal(mean.shape)
    return collected + pattern.offsets(seed, number, averaged, warmer_K) + noise


def counts(imager: Imager, electrons) -> np.ndarray:
    """Counts of the electrons, whole numbers from 0 to the largest count, uint16."""
    raw = np.rint(electrons / imager.electrons_per_count + imager.pedestal)
    return np.clip(raw, 0, imager.largest_count).astype(np.uint16)


def signal_of(imager: Imager, counts) -> np.ndarray:
    """Electrons of the signal that the counts stand for, without the mean dark current."""
    return (counts - imager.pedestal) * imager.electrons_per_count - imager.dark


def is_saturated(imager: Imager, signal) -> np.ndarray:
    """Whether the well or the converter does not hold the mean signal of each pixel."""
    collected = np.asarray(signal) + imager.dark
    return (collected >= imager.well) | (collected <= imager.floor)


def saturated(imager: Imager, signal) -> float:
    """Share of the pixels whose mean signal the well or the converter does not hold."""
    return float(np.mean(is_saturated(imager, signal)))


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
    response of `band` multiplies the camera's quantum efficiency. A bolometer's signal is a power,
    W, the integral of L(x) R(x) times transmittance, solid angle and area, with the response R.

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
        optics_transmittance * imager.quantum_efficiency * imager.solid_angle * imager.pixel_area
    )
    counts_photons = imager.detector == "photon"
    if counts_photons:
        per_um = per_um * imager.seconds / energy
    rows = np.array([band.lower_um, band.upper_um])
    if band.response is not None:
        x = band.response[0]
        rows = np.interp(np.arange(BETWEEN * (len(x) - 1) + 1) / BETWEEN, np.arange(len(x)), x)
    return replace(
        band,
        weights_um=band.weights_um * per_um * band.wavelengths_um**counts_photons,
        response=np.array([rows, per_um * rows**counts_photons * band.response_at(rows)]),
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


MOST_LEFT_OUT = 0.01  # share of saturated pixels beyond which the noise of frames is not stated

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
        If a blackbody saturates the camera, or the noise hides the difference of both.
    """
    cold, warm = temperature - SPAN_K, temperature + SPAN_K
    low, high = (float(electrons(electron_band, T)) for T in (cold, warm))
    most = float(np.max(design.undone(high)))
    noise = float(imager.noise(most))
    longer, shorter = "lengthen integration_time_ms", "shorten integration_time_ms"
    if imager.detector == "bolometer":
        longer, shorter = "lower netd_mK", "widen span_K"
    if not high - low > DISTINCT * noise:
        raise InputError(
            f"[camera]: nuc looks at blackbodies of {cold:.4g} and {warm:.4g} K, which differ by "
            f"{high - low:.3g} {imager.unit} with a noise of {noise:.3g}; {longer}, or leave nuc "
            "out"
        )
    if most * pattern.gain.max() + imager.dark >= imager.well:
        raise InputError(
            f"[camera]: nuc looks at a blackbody of {warm:.4g} K, which gives "
            f"{imager.amount(most)} and saturates the well of {imager.amount(imager.well)}; "
            f"{shorter}"
        )
    least = float(np.min(design.undone(low) * pattern.gain))
    if least <= imager.floor:
        raise InputError(
            f"[camera]: nuc looks at a blackbody of {cold:.4g} K, which gives "
            f"{imager.amount(least)}, less than the {imager.amount(imager.floor)} of the lowest "
            f"count; {shorter}, or leave nuc out"
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
        emitted = glow(imager, detector)
        imager = Bolometer.of(imager, band, emitted)
        background = detector_mean(behind, band)
        temperature = max(float(apparent_temperature(band, background)), COLDEST_K)
        design = correction = Correction(imager.illumination, emitted)
        pattern = Pattern.of(imager, seed, signal_per_kelvin(imager, band))
        if imager.nuc:
            correction = two_point(imager, pattern, design, band, temperature, seed)
        thermal = partial(blackbody.spectral_radiance, temperature=DIFFRACTION_K)
        optics = Optics(imager, band, thermal, turbulence)
        optics.check_spread()
        return Camera(
            imager, band, optics, design, background, temperature, pattern, correction, seed
        )

    def noise(self, signal: ArrayLike, with_pattern: bool = False) -> np.ndarray | float:
        """Standard deviation of a pixel with what it shares with others, see `Imager.noise`."""
        return np.hypot(self.imager.noise(signal, with_pattern), self.pattern.total)

    def kept_contrast(self, background: ArrayLike, contrast: np.ndarray) -> np.ndarray:
        """What a full well keeps of the electrons by which pixels differ from a background."""
        behind, most = background + self.design.offset, self.imager.well - self.imager.dark
        least = self.imager.floor
        return np.clip(behind + contrast, least, most) - np.clip(behind, least, most)

    def frames(self, signal: np.ndarray, count: int) -> np.ndarray:
        """Counts of frames of a scene with these mean electrons (H, W), (count, H, W).

        Raises InputError if the housing's temperature in the frames is not known.
        """
        if self.imager.drifts and count > 1 and self.imager.frame_rate_hz is None:
            raise InputError(
                "[camera]: frame_rate_hz is missing; offsets drift from one frame to the next"
            )
        warmer_K = self.warmer_K(np.arange(count) / (self.imager.frame_rate_hz or 1))
        return np.array([self.frame(signal, *frame) for frame in enumerate(warmer_K)])

    def warmer_K(self, time_s: np.ndarray) -> np.ndarray:
        """By how much the housing is warmer than at the last shutter event, K, (n,)."""
        if not self.imager.drifts:
            return np.zeros(len(time_s))
        return housing_changes(self.imager, time_s, self.seed)

    def frame(self, signal: np.ndarray, number: int, warmer_K: float = 0.0) -> np.ndarray:
        """Counts of one frame of a scene with these mean electrons (H, W)."""
        made = self.imager, self.pattern, signal, self.seed, number, 1, warmer_K
        return counts(self.imager, frame(*made))

    def temperatures(self, frame_counts: np.ndarray) -> np.ndarray:
        """Apparent temperatures, K, of a corrected frame of counts."""
        recorded = signal_of(self.imager, frame_counts.astype(float))
        return apparent_temperature(self.band, self.correction.applied(recorded))

    def components(self, frames: np.ndarray, signal: np.ndarray) -> NoiseComponents | None:
        """Noise of frames of counts of a scene with these mean electrons (H, W), K.

        It is that of the corrected signals at the background's temperature. A few saturated pixels
        count as ones without noise. None for one frame, and if MOST_LEFT_OUT are saturated.
        """
        if len(frames) < 2 or saturated(self.imager, signal) > MOST_LEFT_OUT:
            return None
        held = ~is_saturated(self.imager, signal)
        slope = electrons_per_kelvin(self.band, self.temperature)
        scene = self.design.applied(signal)
        recorded = (signal_of(self.imager, counted.astype(float)) for counted in frames)
        corrected = (self.correction.applied(values) - scene for values in recorded)
        return NoiseComponents.of(held * values / slope for values in corrected)

    def mean_temperatures(self, signal: np.ndarray, error: np.ndarray) -> dict[str, np.ndarray]:
        """Channels, K, of the mean electrons of pixels, and of their standard error.

        They are the apparent temperature, the rendering's standard error, and the noise in time.
        Both arguments are of the scene, before the optics' illumination and emission.
        """
        noise = self.imager.noise(self.design.undone(signal)) / self.design.gain
        noise = np.hypot(noise, np.linalg.norm(self.pattern.temporal) / self.design.gain)
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
