"""What one pass of `bounce_path` records beside the radiance, and how samples become pixels."""
from dataclasses import dataclass, field

import drjit as dr
import mitsuba as mi
import numpy as np

MAX_BOUNCE_CHANNELS = 65        # the last one holds every bounce count from 64 on


@dataclass
class Channels:
    """Radiance per sample, split by bounce count, by emitting group and by the group first seen [W m^-2 sr^-1].

    `last`: the last three bounce counts, kept apart for the geometric tail. `range`: distance of the first hit [m], 0 for
    an escape. `seen`: the label of what the ray met first.
    """
    by_bounce: list
    by_group: list
    last: list = field(default_factory=list)
    closure: mi.Float | None = None
    range: mi.Float | None = None
    seen: mi.UInt32 | None = None

    @staticmethod
    def empty(groups: int, max_bounces: int, closure: str) -> "Channels":
        zeros = lambda count: [mi.Float(0) for _ in range(count)]
        return Channels(zeros(min(max_bounces + 1, MAX_BOUNCE_CHANNELS)), zeros(groups),
                        zeros(3 if closure == "tail" else 0), mi.Float(0), mi.Float(0), mi.UInt32(0))

    def meet(self, first, label):
        """Notes what a ray meets first: a surface interaction and the label of its emitter."""
        self.range = dr.select(first.is_valid(), first.t, 0)
        self.seen = label

    def add(self, value, bounce, label, max_bounces: int):
        """Adds radiance that was reflected `bounce` times and emitted by the group `label`."""
        beyond = bounce > max_bounces
        self.closure += dr.select(beyond, value, 0)
        value = dr.select(beyond, 0, value)
        channel = dr.minimum(bounce, len(self.by_bounce) - 1)
        for k in range(len(self.by_bounce)):
            self.by_bounce[k] += dr.select(channel == k, value, 0)
        for k in range(len(self.by_group)):
            self.by_group[k] += dr.select(label == k, value, 0)
        for k in range(len(self.last)):
            self.last[k] += dr.select(bounce == max_bounces - 2 + k, value, 0)

    def samples(self, L) -> list:
        """All channels in the order of the image: bounces, closure, groups, seen, and range and hit (1 or 0)."""
        seen = [dr.select(self.seen == k, L, 0) for k in range(len(self.by_group))]
        hit = dr.select(self.range > 0, mi.Float(1), 0)
        return [*self.by_bounce, self.closure, *self.by_group, *seen, self.range, hit]

    def add_tail(self) -> tuple[mi.Float, float]:
        """Continues the last two bounce counts geometrically, with the ratio of their sums over all samples.

        Returns the tail per sample, and as its error what the ratio of the two counts before would have made of its mean.
        """
        def continuation(a, b):
            ratio = b / a if a > 0 else 0.0
            return ratio / (1 - ratio) if ratio < 1 else 0.0

        dr.eval(self.last)
        before, last, newest = (float(dr.sum(channel)[0]) for channel in self.last)
        factor = continuation(last, newest)
        self.closure = self.last[2] * factor
        return self.closure, abs(factor - continuation(before, last)) * newest / dr.width(self.closure)


@dataclass
class Pixels:
    """Statistics of one pass over a run of pixels; NumPy, Float64, one value per pixel.

    count: finite samples; mean and squares (sum of squared deviations from the mean) of the radiance; channels: means of
    the channels, rows as `Channels.samples` lists them; invalid: NaN or infinite samples, left out.
    """
    count: np.ndarray
    mean: np.ndarray
    squares: np.ndarray
    channels: np.ndarray
    invalid: int


def pixel_statistics(L, channels: "Channels | None", spp: int) -> Pixels:
    """Reduces samples (`spp` consecutive ones per pixel) to pixels.

    Deviations are taken from the pixel's own mean: in Float32 the variance would drown in the square of the mean.
    """
    finite = dr.isfinite(L)
    samples = [L] if channels is None else [L, *channels.samples(L)]
    samples = [dr.select(finite, value, 0) for value in samples] + [dr.select(finite, mi.Float(1), 0)]
    dr.eval(finite, samples)                # one kernel: each reduction would otherwise trace the paths again
    total, *sums, count = (dr.block_sum(value, spp) for value in samples)
    mean = total / dr.maximum(count, 1)
    squares = dr.block_sum(dr.square(dr.select(finite, samples[0] - dr.repeat(mean, spp), 0)), spp)
    count, mean, squares, *sums = (values.numpy().astype(np.float64) for values in (count, mean, squares, *sums))
    means = np.reshape(sums, (len(sums), len(count))) / np.maximum(count, 1)
    return Pixels(count, mean, squares, means, dr.width(L) - int(count.sum()))
