"""When a measurement has enough paths: the error that is allowed, compared with the present one."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.rendering.statistics import Totals, student_factor


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
class PixelError(Criterion):
    """The rms standard error over the pixels is below a fraction of the mean radiance."""

    tolerance: float

    def check(self, tracer, name):
        check_reachable(self.tolerance, tracer, name)

    def excess(self, total):
        error = total.rms_error()
        return np.inf if error is None else error / self.tolerance


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
