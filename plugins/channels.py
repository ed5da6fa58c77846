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

    def meet(self, first, si, label):
        """Notes what a ray meets first."""
        self.range = dr.select(first & si.is_valid(), si.t, self.range)
        self.seen = dr.select(first, label, self.seen)

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

    def add_tail(self) -> tuple[mi.Float, float]:
        """Continues the last two bounce counts geometrically, with the ratio of their sums over all samples.

        Returns the tail per sample and the factor by which it would change with the ratio of the two counts before.
        """
        before, last, newest = (float(dr.sum(channel)[0]) for channel in self.last)
        def continuation(a, b):
            ratio = b / a if a > 0 else 0.0
            return ratio / (1 - ratio) if ratio < 1 else 0.0
        factor = continuation(last, newest)
        self.closure = self.last[2] * factor
        return self.closure, abs(factor - continuation(before, last))


@dataclass
class Pixels:
    """Statistics of one pass over a run of pixels; NumPy, Float64, one value per pixel.

    count: finite samples; mean and squares (sum of squared deviations from the mean) of the radiance; channels: means,
    rows in the order of `names`; invalid: NaN or infinite samples, left out.
    """
    count: np.ndarray
    mean: np.ndarray
    squares: np.ndarray
    channels: np.ndarray
    invalid: int


def pixel_statistics(L, channels: "Channels | None", labels: int, spp: int) -> Pixels:
    """Reduces samples (`spp` consecutive ones per pixel) to pixels. Deviations are taken from the pixel's own mean, so
    that the variance survives in Float32 where it is tiny beside the square of the mean."""
    finite = dr.isfinite(L)
    dr.schedule(finite)
    samples = [L]
    if channels is not None:
        samples += channels.by_bounce + [channels.closure] + channels.by_group
        samples += [dr.select(channels.seen == k, L, 0) for k in range(labels)]
        samples += [channels.range]
    samples = [dr.select(finite, value, 0) for value in samples]
    samples.append(dr.select(finite, mi.Float(1), 0))
    if channels is not None:
        samples.append(dr.select(finite & (channels.range > 0), mi.Float(1), 0))
    dr.eval(samples)                        # one kernel: each reduction would otherwise trace the paths again
    sums = [dr.block_sum(value, spp) for value in samples]
    hits = sums.pop() if channels is not None else None
    count = sums.pop()
    mean = sums[0] / dr.maximum(count, 1)
    deviation = dr.select(finite, samples[0] - dr.repeat(mean, spp), 0)
    squares = dr.block_sum(dr.square(deviation), spp)
    n = np.maximum(count.numpy().astype(np.float64), 1)
    means = [total.numpy() / n for total in sums[1:]]
    if channels is not None:
        means[-1] *= n / np.maximum(hits.numpy(), 1)        # range: over the hits alone
    invalid = dr.width(L) - int(count.numpy().astype(np.float64).sum())
    return Pixels(count.numpy().astype(np.float64), mean.numpy().astype(np.float64), squares.numpy().astype(np.float64),
                  np.reshape(means, (len(means), len(n))), invalid)
