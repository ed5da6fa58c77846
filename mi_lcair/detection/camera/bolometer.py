"""Bolometers: their scale in a band, their lag, and the drift of offsets with the housing."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mi_lcair.declared import Bounds
from mi_lcair.errors import InputError
from mi_lcair.physics import blackbody
from mi_lcair.physics.bands import Band
from mi_lcair.physics.imager import Imager
from mi_lcair.table import read_table

HOUSING = 4  # first number of the seeds of a housing's random walk
ROUNDING = 1e-9  # relative error of a frame's time, up to which it is that of a shutter event
HOUSINGS = Bounds(lower=100, upper=500, unit="K")


def signal_per_kelvin(imager: Imager, band: Band) -> float:
    """Change of the signal with the temperature of a scene in the conditions of `netd_mK`.

    band: the band in which the in-band value of a spectral radiance is the signal.
    """
    slope = float(blackbody.in_band_slope(band, imager.netd_temperature))
    if imager.netd_f_number is None:
        return slope
    stated = imager.netd_f_number
    thin = imager.lens == "thin"
    return slope * (4 * imager.f_number**2 + thin) / (4 * stated**2 + thin)


@dataclass(frozen=True)
class Bolometer(Imager):
    """A bolometer in its band, whose signal is the power on a pixel, W.

    Attributes
    ----------
    lowest, highest : float
        Signals of the converter's lowest and largest count, W.
    nep : float
        Standard deviation of a pixel in time, W.
    """

    lowest: float = 0.0
    highest: float = 1.0
    nep: float = 0.0

    @staticmethod
    def of(imager: Imager, band: Band, glow: float = 0.0) -> Imager:
        """The bolometer of a description in its band; a photon detector as it is.

        glow: signal of the optics' emission, which the even scenes of the span add to.
        """
        if imager.detector != "bolometer":
            return imager
        lowest, highest = (blackbody.in_band_radiance(band, T) + glow for T in imager.span_K)
        nep = 1e-3 * imager.netd_mK * signal_per_kelvin(imager, band)
        given = {name: getattr(imager, name) for name in Imager.__dataclass_fields__}
        return Bolometer(**given, lowest=float(lowest), highest=float(highest), nep=nep)

    unit, channel = "W", "power"

    @property
    def well(self) -> float:
        """Signal of the largest count."""
        return self.highest

    @property
    def floor(self) -> float:
        """Signal of the lowest count."""
        return self.lowest

    @property
    def electrons_per_count(self) -> float:
        """Signal of one count."""
        return (self.highest - self.lowest) / self.largest_count

    @property
    def pedestal(self) -> float:
        """Count without any signal, which is below the lowest one."""
        return -self.lowest / self.electrons_per_count

    def amount(self, signal: float) -> str:
        """A signal in words."""
        return f"{1e9 * signal:.4g} nW"

    def noise(self, electrons: ArrayLike, with_pattern: bool = False) -> np.ndarray | float:
        """Standard deviation of a pixel in time, W, see `Imager.noise`."""
        in_time = np.hypot(self.nep, self.electrons_per_count / np.sqrt(12)) + 0 * electrons
        return np.hypot(in_time, self.gain_nonuniformity * electrons) if with_pattern else in_time


def lagged(
    imager: Imager, time_s: np.ndarray, signals: Iterable[np.ndarray]
) -> Iterator[np.ndarray]:
    """Yield what a detector shows of signals at some times: the mean over its integration.

    Power changes linearly from one time to the next, and the temperature of a pixel follows it with
    the time constant. The integration ends at the time of the frame. At first the pixels are in
    balance with the scene.

    Parameters
    ----------
    imager : Imager
    time_s : ndarray, shape (n,)
        Times of the frames, s.
    signals : iterable of ndarray, shape (H, W)
        The signal of a detector without lag at each of them.
    """
    tau, held = 1e-3 * imager.time_constant_ms, None
    for step, signal in zip(np.diff(time_s, prepend=np.nan), signals):
        if held is None or tau == 0:
            held = before = signal
            yield signal
            continue
        window = min(imager.seconds, step)
        # Weights of what the pixel showed and of both signals: at a constant slope of the signal a
        # pixel is late by tau, and its distance from that line decays
        left = np.exp(-step / tau)
        mean = -np.expm1(-step / tau) * tau / step
        seen = left * held + (mean - left) * before + (1 - mean) * signal
        if window > 0:  # the mean over the window
            left = np.exp(-(step - window) / tau) * -np.expm1(-window / tau) * tau / window
            mean = (tau * (1 - left) + window / 2) / step
            yield left * held + (mean - left) * before + (1 - mean) * signal
        else:
            yield seen
        held, before = seen, signal


def housing_changes(imager: Imager, time_s: np.ndarray, seed: int) -> np.ndarray:
    """By how much the housing is warmer than at the last shutter event, K, (n,).

    time_s: times of the frames, s. At the first of them the offsets are corrected. Raises
    InputError if the table of the housing cannot be used.
    """
    times = time_s - time_s[0]
    reached = times * (1 + ROUNDING)
    if imager.shutter_every_s is not None:
        last = np.floor(reached / imager.shutter_every_s) * imager.shutter_every_s
    else:
        events = np.array([0.0, *sorted(imager.shutter_s or ())])
        last = events[np.searchsorted(events, reached, side="right") - 1]
    last = np.minimum(last, times)
    if imager.housing is not None:
        table = read_table(imager.housing, ("time_s", "temperature_K"))
        rows = table.numbers(("time_s", "temperature_K"))
        table.check_range("temperature_K", rows["temperature_K"], HOUSINGS)
        known_s, kelvin = rows["time_s"], rows["temperature_K"]
        if np.any(np.diff(known_s) <= 0):
            raise InputError(f"{table.file}: time_s must rise from row to row")
        if known_s[0] > 0 or known_s[-1] < times[-1]:
            raise InputError(
                f"{table.file}: has the housing from {known_s[0]:g} to {known_s[-1]:g} s; the "
                f"frames last from 0 to {times[-1]:g} s"
            )
    else:
        random = np.random.default_rng([HOUSING, seed])
        known_s = np.union1d(times, last)
        steps = np.sqrt(np.diff(known_s, prepend=0.0) / (imager.housing_walk_s or 1.0))
        walk = (imager.housing_walk_K or 0.0) * steps * random.standard_normal(len(known_s))
        kelvin = np.cumsum(walk)
    return np.interp(times, known_s, kelvin) - np.interp(last, known_s, kelvin)
