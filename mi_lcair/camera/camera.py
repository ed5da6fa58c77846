"""A camera that looks at a background: its electrons, optics, fixed pattern and correction."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from mi_lcair.camera.electronics.calibration import Correction, two_point
from mi_lcair.camera.electronics.frames import Pattern, counts, frame, signal_of
from mi_lcair.camera.electronics.response import (
    apparent_temperature,
    electron_band,
    electrons,
    in_kelvin,
)
from mi_lcair.camera.exposure import detector_mean
from mi_lcair.camera.optics import Optics, Turbulence
from mi_lcair.detection.irradiance import Backdrop
from mi_lcair.detection.scenario import Scenario
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import spectral_radiance
from mi_lcair.physics.detector import Detector
from mi_lcair.physics.imager import Imager

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
        thermal = partial(spectral_radiance, temperature=DIFFRACTION_K)
        optics = Optics(imager, band, thermal, turbulence)
        optics.check_spread()
        return Camera(
            imager, band, optics, design, background, temperature, pattern, correction, seed
        )

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
