"""Running statistics of a render's pixels over its passes: means, standard errors, covariances."""

import numpy as np

from mi_lcair.errors import InputError

# beginnings of the names of what a sum may be made of
COVARYING = ("source.", "target.source.", "target.hit")
# share of NaN or infinite samples above which a result is refused. They are left out (or count as
# 0), which changes a mean by their share or more: a tenth of the usual tolerance of 1 %
MOST_INVALID = 1e-3


def check_valid(invalid: int, paths: int, name: str) -> None:
    """Raises InputError if too many of the samples of a scene of that name are NaN or infinite."""
    if invalid > MOST_INVALID * paths:
        raise InputError(
            f"{name}: {invalid} of {paths} samples are NaN or infinite, more than can be left out; "
            "look for extreme values in the scene: clip distances, scales, radiances"
        )


def invalid_remark(invalid: int, paths: int) -> list[str]:
    """What a user should know of samples that were left out, if there were any."""
    if not invalid:
        return []
    return [f"{invalid} of {paths} samples were NaN or infinite and do not count"]


class Accumulator:
    """Running mean and variance per pixel, and mean channels, over passes (Chan, Golub and LeVeque
    1983); Float64.

    A channel's variance is that of its sum over the pixels alone, from the scatter of the parts of
    each pixel's samples: an image of variances for every channel would double the memory.

    chance: what a source that no path has met may add to one path. systematic: relative error that
    no number of samples lowers; it is part of every standard error.
    """

    def __init__(self, pixels: int, chance: float = 0.0, systematic: float = 0.0):
        self.chance, self.systematic = chance, systematic
        self.count, self.mean, self.squares, self.parts = (np.zeros(pixels) for _ in range(4))
        self.channels, self.scatter = {}, {}
        self.covariance = 0.0
        self.invalid = 0
        self.tail = None

    def add(self, first: int, part) -> None:
        """Adds the statistics of a run of pixels that starts at pixel `first`."""
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
        """What turns scatter into the variance of a mean over all pixels; None where no pixel has
        two parts.
        """
        freedom = np.sum(np.maximum(self.parts - 1, 0))
        return (
            np.mean(1 / np.maximum(self.count, 1)) / freedom / len(self.count)
            if freedom > 0
            else None
        )

    def means(self) -> dict[str, tuple[float, float | None]]:
        """Of each channel: its mean over the pixels, and the standard error of that."""
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
        """Standard error of each pixel's mean from its samples alone; infinite below two."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(
                self.count > 1, np.sqrt(self.squares / (self.count * (self.count - 1))), np.inf
            )

    def standard_error(self) -> np.ndarray:
        """Standard error of each pixel's mean; infinite below two samples."""
        return np.hypot(self.scatter_error(), self.systematic * self.mean)

    def mean_error(self) -> float | None:
        """Standard error of the mean over the pixels, whose samples are independent; None below two
        samples.
        """
        if self.count.min() < 2:
            return None
        scatter = np.sqrt(np.sum(self.scatter_error() ** 2)) / len(self.mean)
        return float(np.hypot(scatter, self.systematic * self.mean.mean()))

    def rms_error(self) -> float | None:
        """Rms standard error over the pixels as a fraction of the mean; None below two samples.

        The sample variance cannot see a source that no path has met. The error therefore includes
        the contribution of one path that meets the brightest source. That is the source's radiance
        where paths meet it by chance, and less where emitters are drawn and it is out of the
        camera's sight (`EmitterTable.by_chance`).
        """
        if self.count.min() < 2:
            return None
        missed = self.chance**2 / (self.count.mean() * self.count.sum())
        mean, rms = self.mean.mean(), np.sqrt(np.mean(self.standard_error() ** 2) + missed)
        return float(rms / mean) if mean > 0 else 0.0
