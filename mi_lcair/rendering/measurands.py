"""What is recorded of the paths of a measurement, and the error at which it has enough of them."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.physics.spectra.bins import OF_TOLERANCE, SMALL_ERROR, Binning
from mi_lcair.plugins.columns.tables import ColumnTables
from mi_lcair.plugins.emission.sources import WAVELENGTHS
from mi_lcair.plugins.paths.launch import Launch, ParallelRays
from mi_lcair.plugins.paths.sums import Sums
from mi_lcair.plugins.recorders.channels import PARTS, Channels
from mi_lcair.plugins.recorders.radiance import MAX_BOUNCE_CHANNELS
from mi_lcair.rendering.statistics import Totals, student_factor


@dataclass(frozen=True)
class Measurands:
    """What is recorded of the paths of a measurement.

    Attributes
    ----------
    channels : Channels
        Parts of the radiance, by name.
    facets : object or None
        Receiver of the samples by facet, see `PathTracer.trace`.
    by_spectrum : bool
        Whether emission is recorded for each spectrum of a group, not only for each group.
    explored : frozenset of mi.BSDF
        Surfaces at which paths of a weight of 0 go on for the derivatives.
    reduced : callable or None
        Gives the `Sums` that are kept from those of a launch.
    bins : int
        Number of bins of wavelength for which the spectral radiance is recorded; 0 for none.
    """

    channels: Channels
    facets: object = None
    by_spectrum: bool = False
    explored: frozenset = frozenset()
    reduced: Callable[[Sums], Sums] | None = None
    bins: int = 0

    @staticmethod
    def of(
        split: str | None, by_spectrum: bool = False, bins: int = 0, parts: Sequence[str] = PARTS
    ) -> "Measurands":
        """The channels of a split and its parts, see `Channels`."""
        return Measurands(Channels(split, tuple(parts)), by_spectrum=by_spectrum, bins=bins)

    def binning(self, tolerance: float | None) -> Binning:
        """What decides on the bins of wavelength, with the tolerance of the measurement.

        A spectrum is as fine as without a tolerance, or finer.
        """
        allowed = SMALL_ERROR if tolerance is None else OF_TOLERANCE * tolerance
        return Binning(self.bins, min(allowed, SMALL_ERROR) if self.by_spectrum else allowed)

    def with_columns(self, tables: ColumnTables | None) -> "Measurands":
        """These measurands, and the derivatives with respect to the parameters of the tables."""
        return replace(self, channels=replace(self.channels, tables=tables))

    def trace(self, tracer, sensor, launch: Launch, rays: ParallelRays | None = None) -> Sums:
        """The sums of a launch through a sensor; rays: those of the sensor, if they are known."""
        sums = tracer.trace(sensor, launch, self.channels, self.facets, rays)
        return sums if self.reduced is None else self.reduced(sums)


class Criterion(ABC):
    """What the error of a measurement must meet. `measure` adds paths until it is met."""

    def check(self, tracer, name: str) -> None:
        """Raise InputError if no number of paths can be shown to meet the criterion.

        Parameters
        ----------
        tracer : PathTracer
        name : str
            Name of the scene in messages.
        """
        check_bounded(tracer.emitters, name)

    @abstractmethod
    def excess(self, total: Totals) -> float | np.ndarray:
        """Ratio of the error to the allowed error.

        It is one number for the pixels of an image, and one for each window otherwise.
        """


@dataclass(frozen=True)
class IntensityInterval(Criterion):
    """Half of the 95 % interval of a window's mean radiance is below a fraction of the mean.

    channel: the part of the radiance that counts: "target" or None, which is the whole.
    or_whole: whether the whole radiance counts where there is no target.
    """

    tolerance: float
    channel: str | None = "target"
    or_whole: bool = True

    def check(self, tracer, name):
        check_reachable(self.tolerance, tracer, name, of_interval=True)

    def excess(self, total):
        channel = self.channel
        if self.or_whole and not total.mean(channel)[0] > 0:
            channel = None
        allowed = self.tolerance * total.mean(channel)[0]
        return float(total.half_width(channel)[0] / allowed) if allowed > 0 else np.inf


@dataclass(frozen=True)
class ExcessFunction(Criterion):
    """A function of the totals gives the ratio of the error to the allowed error."""

    function: Callable[[Totals], float]

    def excess(self, total):
        return self.function(total)


def check_reachable(tolerance: float, tracer, name: str, of_interval: bool = False) -> None:
    """Raise InputError if no number of samples reaches the tolerance, or none can confirm it.

    A tolerance cannot be confirmed if an emitter's radiance has no known bound.

    Parameters
    ----------
    tolerance : float
        Relative error.
    tracer : PathTracer
    name : str
        Name of the scene in messages.
    of_interval : bool
        Whether the tolerance is that of half of the 95 % interval, not of the standard error.
    """
    check_bounded(tracer.emitters, name)
    least = tracer.systematic_error * (student_factor(np.inf) if of_interval else 1.0)
    if tolerance <= least:
        raise InputError(
            f"{name}: tolerance = {tolerance:g} cannot be reached: Float32's rounding and "
            f"tabulated emissivities leave {'half a 95 % interval' if of_interval else 'an error'} "
            f"of {least:.2g}; ask for more than that"
        )


def check_bounded(emitters, name: str) -> None:
    """Raise InputError if the radiance of an emitter has no known bound."""
    if emitters.unbounded:
        raise InputError(
            f"{name}: no tolerance can be confirmed, as nothing bounds the radiance of "
            f"{', '.join(emitters.unbounded)}; give the number of samples (spp) instead"
        )


# Limits of a render that are known before it starts: memory and the number of paths
# ----------------------------------------------------------------------------------

MOST_PATHS = 2**40  # paths of one render; a processor traces about 10^7 paths in a second
# Memory for the radiance and statistics of a pixel, and for each channel in double and in single
# precision [bytes]. Measured with 4 samples per pixel on images of 1 to 2 million pixels: 433
# bytes per pixel in the scene two_plates with 10 channels, 955 in furnace with 43;
# two_plates with all parts has taken up to 10 % more since.
BYTES_PER_PIXEL, BYTES_PER_CHANNEL = 360, 15
# The same for a source in a camera's frame: 4.4 between 69,696 and 272,484 parts with 448 sources
BYTES_PER_SOURCE = 5
ANY_MACHINE_HAS = 2**20  # bytes for which the free memory, which is slow to read, is not looked up
GIB = 2**30


def check_paths(pixels: int, spp: int | None) -> None:
    """Raise InputError for more paths than can be rendered."""
    if spp is not None and spp * pixels > MOST_PATHS:
        raise InputError(
            f"spp = {spp} through {pixels} pixels are {spp * pixels:.2g} paths; at most "
            f"{MOST_PATHS:.2g} are rendered"
        )


def check_memory(pixels: int, channels: int = 0, sources: int = 0) -> None:
    """Raise InputError for an image that needs more memory than is free.

    channels: recorded in addition to the radiance. sources: those of which means are kept in single
    precision.
    """
    needed = pixels * (BYTES_PER_PIXEL + BYTES_PER_CHANNEL * channels + BYTES_PER_SOURCE * sources)
    if needed > ANY_MACHINE_HAS:
        check_free(needed, f"an image of {pixels} pixels", "lower the resolution")


def check_free(needed: float, what: str, remedy: str) -> None:
    """Raise InputError for something that needs more memory [bytes] than is free."""
    available = available_memory()
    if available is not None and needed > available:
        raise InputError(
            f"{what} needs {needed / GIB:.1f} GiB of memory, and "
            f"{available / GIB:.1f} GiB are free; {remedy}"
        )


def channel_count(tracer, channels: Channels) -> int:
    """Number of channels that a render records in addition to the radiance."""
    if channels.split is None:
        return 0
    of_parts = dict.fromkeys(PARTS, len(tracer.emitters.labels))
    of_parts["bounce"] = min(tracer.max_bounces + 1, MAX_BOUNCE_CHANNELS) + 1
    of_parts["group"] *= 1 + len(channels.up_to)
    sources = source_count(tracer, channels)
    count = 3 + sum(of_parts[part] for part in channels.parts) + sources
    return 2 * count if channels.split == "target" else count


def source_count(tracer, channels: Channels) -> int:
    """Number of channels of the sources that are recorded separately by spectrum."""
    sources = tracer.emitters.sources
    of_list = len(sources.list) if sources.by_spectrum else 0
    count = of_list + (WAVELENGTHS if sources.share is not None else 0)
    return count * (1 + len(channels.up_to))


def available_memory() -> int | None:
    """Free memory of the machine, or of the control group if that is less [bytes].

    None where the system does not report it.
    """
    limits = [_of_machine(), _of_control_group()]
    return min((limit for limit in limits if limit is not None), default=None)


def _of_machine() -> int | None:
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            name, _, value = line.partition(":")
            if name == "MemAvailable":
                return 1024 * int(value.split()[0])
    except (OSError, ValueError, IndexError):
        pass
    return None


def _of_control_group() -> int | None:
    group = Path("/sys/fs/cgroup")
    try:
        most, used = (int((group / f"memory.{name}").read_text()) for name in ("max", "current"))
    except (OSError, ValueError):  # no such group, or "max": without a limit
        return None
    return max(0, most - used)
