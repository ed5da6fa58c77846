"""Running statistics of a render's pixels over passes: means, standard errors, covariances."""

import numpy as np

from mi_lcair.errors import InputError

# Prefixes of the channels whose covariances are recorded, for the error of sums of them.
COVARYING = ("source.", "target.source.", "target.hit")
# Largest fraction of NaN or infinite samples in a result. Such samples are left out or count as 0,
# which changes a mean by about their fraction. The limit is a tenth of the usual tolerance of 1 %.
MOST_INVALID = 1e-3


def check_valid(invalid: int, paths: int, name: str) -> None:
    """Raise InputError if too many samples of the scene `name` are NaN or infinite."""
    if invalid > MOST_INVALID * paths:
        raise InputError(
            f"{name}: {invalid} of {paths} samples are NaN or infinite, more than can be left out; "
            "look for extreme values in the scene: clip distances, scales, radiances"
        )


def invalid_remark(invalid: int, paths: int) -> list[str]:
    """Remark on samples that were left out, in a list; empty if there are none."""
    if not invalid:
        return []
    return [f"{invalid} of {paths} samples were NaN or infinite and do not count"]


class Accumulator:
    """Running mean and variance of each pixel, and mean channels, over passes, in Float64.

    The algorithm is that of Chan, Golub and LeVeque, 1983. For channels, only the variance of the
    mean over all pixels is recorded, from the scatter of the parts of each pixel's samples. An
    image of variances for every channel would double the memory.

    chance: radiance that a source which no path has hit may add to one path [W m^-2 sr^-1].
    systematic: relative error that more samples do not reduce. It is part of every standard error.
    """

    def __init__(self, pixels: int, chance: float = 0.0, systematic: float = 0.0):
        self.chance, self.systematic = chance, systematic
        self.count, self.mean, self.squares, self.parts = (np.zeros(pixels) for _ in range(4))
        self.channels, self.scatter = {}, {}
        self.covariance = 0.0
        self.invalid = 0
        self.tail = None

    def add(self, first: int, part) -> None:
        """Add the statistics `part` (`Pixels`) of consecutive pixels, from pixel `first` on."""
        run = slice(first, first + len(part.count))
        before, count = self.count[run], self.count[run] + part.count
        share = part.count / np.maximum(count, 1)
        difference = part.mean - self.mean[run]
        self.squares[run] += part.squares + difference**2 * before * share
        self.mean[run] += difference * share
        self.invalid += part.invalid
        self.chance = max(self.chance, part.chance)
        if part.tail is not None:
            self.tail = part.tail if self.tail is None else self.tail + part.tail
        for k, part_count in enumerate(part.part_count):
            after = before + part_count
            share = part_count / np.maximum(after, 1)
            by_source = []
            for name, values in part.channels.items():
                mean = self.channels.setdefault(name, np.zeros(len(self.count)))
                difference = values[k] - mean[run]
                mean[run] += difference * share
                self.scatter[name] = self.scatter.get(name, 0.0) + np.sum(
                    difference**2 * before * share
                )
                if name.startswith(COVARYING):
                    by_source.append(difference * np.sqrt(before * share))
            if by_source:
                self.covariance += np.array(by_source) @ np.array(by_source).T
            before = after
            self.parts[run] += part_count > 0
        self.count[run] = count

    def error_scale(self) -> float | None:
        """Factor from scatter to the variance of a mean over all pixels.

        None if no pixel has samples in two parts.
        """
        freedom = np.sum(np.maximum(self.parts - 1, 0))
        return (
            np.mean(1 / np.maximum(self.count, 1)) / freedom / len(self.count)
            if freedom > 0
            else None
        )

    def means(self) -> dict[str, tuple[float, float | None]]:
        """Mean of each channel over the pixels, and its standard error (or None), by name."""
        scale = self.error_scale()
        return {
            name: (
                float(values.mean()),
                None
                if scale is None
                else float(
                    np.hypot(np.sqrt(self.scatter[name] * scale), self.systematic * values.mean())
                ),
            )
            for name, values in self.channels.items()
        }

    def scatter_error(self) -> np.ndarray:
        """Standard error of each pixel's mean from its scatter; infinite below two samples."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(
                self.count > 1, np.sqrt(self.squares / (self.count * (self.count - 1))), np.inf
            )

    def standard_error(self) -> np.ndarray:
        """Standard error of each pixel's mean, (P,) [W m^-2 sr^-1]; infinite below two samples."""
        return np.hypot(self.scatter_error(), self.systematic * self.mean)

    def mean_error(self) -> float | None:
        """Standard error of the mean over the pixels; None below two samples per pixel."""
        if self.count.min() < 2:
            return None
        scatter = np.sqrt(np.sum(self.scatter_error() ** 2)) / len(self.mean)
        return float(np.hypot(scatter, self.systematic * self.mean.mean()))

    def rms_error(self) -> float | None:
        """Rms standard error over the pixels as a fraction of the mean; None below two samples.

        The sample variance cannot see a source that no path has hit. The error therefore includes
        the contribution of one path that hits the brightest source. Without emitter sampling this
        is the radiance of the source. With emitter sampling it is less for a source outside the
        field of view (`EmitterTable.by_chance`).
        """
        if self.count.min() < 2:
            return None
        missed = self.chance**2 / (self.count.mean() * self.count.sum())
        mean, rms = self.mean.mean(), np.sqrt(np.mean(self.standard_error() ** 2) + missed)
        return float(rms / mean) if mean > 0 else 0.0
