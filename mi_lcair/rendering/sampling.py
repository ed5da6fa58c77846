"""How a measurement is sampled."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from mi_lcair.declared import Described, entry, rule
from mi_lcair.progress import Progress

if TYPE_CHECKING:
    import mitsuba as mi

TWO_CHOICES = "spp sets a fixed number of samples; tolerance and max_spp cannot be combined with it"
ONE_CHOICE = rule(lambda t: t.spp is None or t.tolerance is t.max_spp is None, TWO_CHOICES)
MOST_SPP = 2**32 - 1  # paths per pixel, which are numbered by 32-bit integers
DEFAULT_MAX_SPP = 2**16  # largest number of samples per pixel for a tolerance


@dataclass(frozen=True, kw_only=True)
class Sampling(Described, rules=(ONE_CHOICE,)):
    """How a render is sampled. A public function makes it once and hands it on whole.

    Raises InputError for numbers out of bounds, and for both a number of samples and a tolerance.

    Attributes
    ----------
    spp : int or None
        Samples per pixel. None: as many as the tolerance needs or, without one, as the sensor
        states.
    paths : int or None
        Paths of each window in place of `spp`, or of each emitter or facet.
    tolerance : float or None
        Allowed error as a fraction. The function that measures says of what.
    max_spp : int or None
        Largest number of samples per pixel for a tolerance (65536).
    seed : int
        The same seed gives the same result.
    sensor : int
        Number of the scene's sensor, counted from 0.
    progress : callable or None
        Called with the work that is done and the work that is expected.
    """

    spp: int | None = entry(None, is_positive=True, upper=MOST_SPP)
    paths: int | None = entry(None, is_positive=True)
    tolerance: float | None = entry(None, is_positive=True)
    max_spp: int | None = entry(None, is_positive=True, upper=MOST_SPP)
    seed: int = entry(0, lower=0, upper=2**32 - 1)
    sensor: int = entry(0, lower=0)
    progress: Progress | None = None

    @property
    def limit(self) -> int:
        """Largest number of samples per pixel for a tolerance."""
        return self.max_spp or DEFAULT_MAX_SPP

    def part(self, number: int, count: int) -> "Sampling":
        """The sampling of one of several equal renders, with the progress of all of them."""
        if self.progress is None:
            return self
        report = self.progress
        return replace(self, progress=lambda done, all_: report(number * all_ + done, count * all_))

    def settled(self, sensor: "mi.Sensor") -> "Sampling":
        """This sampling, with the sensor's own number of samples where nothing chooses one."""
        if (self.spp, self.paths, self.tolerance) != (None, None, None):
            return self
        return replace(self, spp=sensor.sampler().sample_count())
