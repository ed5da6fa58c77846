"""Limits of a render that are known before it starts: memory and the number of paths."""

from pathlib import Path

from mi_lcair.errors import InputError
from mi_lcair.plugins.emission.sources import WAVELENGTHS
from mi_lcair.plugins.recorders.by_bounce import MAX_BOUNCE_CHANNELS

MOST_SPP = 2**32 - 1  # paths through a pixel, which are numbered by 32-bit integers
MOST_PATHS = 2**40  # paths of one render; a processor traces about 10^7 paths in a second
# Memory for the radiance and statistics of a pixel, and for each channel in double and in single
# precision [bytes]. Measured with 4 samples per pixel on images of 1 to 2 million pixels: 433
# bytes per pixel in the scene two_plates with 10 channels, 955 in furnace with 43.
BYTES_PER_PIXEL, BYTES_PER_CHANNEL = 320, 15
# The same for a source in a camera's frame: 4.4 between 69,696 and 272,484 parts with 448 sources
BYTES_PER_SOURCE = 5
GIB = 2**30


def check_paths(pixels: int, **counts: int | None) -> None:
    """Raise InputError for numbers of samples per pixel (spp, max_spp) that are too large."""
    for name, count in counts.items():
        if count is None:
            continue
        if count > MOST_SPP:
            raise InputError(f"{name} = {count} must be at most {MOST_SPP}")
        if name == "spp" and count * pixels > MOST_PATHS:
            raise InputError(
                f"spp = {count} through {pixels} pixels are {count * pixels:.2g} paths; at most "
                f"{MOST_PATHS:.2g} are rendered"
            )


def check_memory(pixels: int, channels: int = 0, sources: int = 0) -> None:
    """Raise InputError for an image that needs more memory than is free.

    channels: recorded in addition to the radiance. sources: those of which means are kept in single
    precision.
    """
    needed = pixels * (BYTES_PER_PIXEL + BYTES_PER_CHANNEL * channels + BYTES_PER_SOURCE * sources)
    check_free(needed, f"an image of {pixels} pixels", "lower the resolution")


def check_free(needed: float, what: str, remedy: str) -> None:
    """Raise InputError for something that needs more memory [bytes] than is free."""
    available = available_memory()
    if available is not None and needed > available:
        raise InputError(
            f"{what} needs {needed / GIB:.1f} GiB of memory, and "
            f"{available / GIB:.1f} GiB are free; {remedy}"
        )


def channel_count(tracer, split: str | None) -> int:
    """Number of channels that a render records in addition to the radiance, see `Channels`."""
    if split is None:
        return 0
    count = min(tracer.max_bounces + 1, MAX_BOUNCE_CHANNELS) + 2 * len(tracer.emitters.labels) + 4
    count += source_count(tracer)
    return 2 * count if split == "target" else count


def source_count(tracer) -> int:
    """Number of channels of the sources that are recorded separately by spectrum."""
    sources = tracer.emitters.sources
    of_list = len(sources.list) if sources.by_spectrum else 0
    return of_list + (WAVELENGTHS if sources.share is not None else 0)


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
