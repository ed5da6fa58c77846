"""Frames of a camera: electrons with noise, the full well, and counts."""

from dataclasses import dataclass

import numpy as np

from mi_lcair.physics.imager import Imager

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
