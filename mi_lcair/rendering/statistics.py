"""Statistics of a render: means over windows, and their errors from randomisations."""

from copy import copy
from functools import lru_cache, reduce, wraps
from math import hypot

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.physics.estimation.verdicts import student_factor
from mi_lcair.plugins.emission.draw_table import UnmetSources
from mi_lcair.plugins.paths.launch import Aim, Launch
from mi_lcair.plugins.paths.sums import Sums
from mi_lcair.plugins.recorders.radiance import LARGEST, SUMMED, in_all_windows, up_to_prefix

# Largest fraction of NaN or infinite samples in a result. Such samples are left out or count as 0,
# which changes a mean by about their fraction. The limit is a tenth of the usual tolerance of 1 %.
MOST_INVALID = 1e-3
# Bound of the number of paths that hit a source in similar renders, if none has hit it in this one.
# A source that 2.5 paths hit on average is missed by all paths with a probability of 8 %.
UNSEEN = 2.5
# Points of a randomisation from which on they divide a window evenly; fewer are like random ones.
EVEN_POINTS = 8
WHOLES = (None, "target")  # channels that have an interval; all others are parts of these
# Name of a channel, or names of several, whose results have one more axis ahead; None: the radiance
ChannelNames = str | None | list[str | None]


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
    return [f"{invalid} of {paths} samples were NaN or infinite and are ignored"]


class Totals:
    """Sums over launches, and the means and errors that they give, in Float64.

    The points of one randomisation are not independent, so their scatter says nothing about the
    error of their mean. The randomisations of a window are independent: the scatter of their means
    gives the standard error. It has R - 1 degrees of freedom for R randomisations, so that an
    interval is Student's factor times the standard error, see `student_factor`. All numbers are
    given for one channel, (windows,), or for a list of channels at once, (channels, windows).

    windows, randomisations: sizes of the arrays. traced: number of paths of each window.
    by_randomisation: whether channels are kept for each randomisation. Otherwise only their means
    are known, which needs less memory. unmet: bound of the radiance of sources that no path has
    hit; None: there are none. systematic: relative error that more samples do not reduce. It is
    part of every standard error. aim: where in the windows the paths begin; None for anywhere.
    emitters: `EmitterTable` of the scene. excess: ratio of the error to the allowed error of each
    window, (windows,); None without a criterion. bins: the bins of wavelength in words; empty
    without spectral materials. followed: what the paths follow, in words.
    """

    def __init__(
        self,
        windows: int,
        randomisations: int,
        by_randomisation: bool = False,
        unmet: UnmetSources | None = None,
        systematic: float = 0.0,
        aim: Aim | None = None,
        emitters=None,
    ):
        self.by_randomisation, self.systematic = by_randomisation, systematic
        self.aim, self.emitters, self.excess, self.bins = aim, emitters, None, ""
        self.followed = ""
        self.valid, self.radiance = (np.zeros((windows, randomisations)) for _ in range(2))
        self.sums = {}
        self.unmet, self.unmet_sums = unmet, {name: np.zeros(windows) for name in SUMMED + LARGEST}
        self.lowest, self.highest = {}, {}
        self.traced, self.invalid, self.tail = np.zeros(windows), 0, None

    @property
    def randomisations(self) -> int:
        return self.valid.shape[1]

    def add(self, launch: Launch, sums: Sums) -> None:
        """Add the `Sums` of a launch to its windows."""
        run = launch.window_numbers
        if len(run) == len(self.valid):
            run = slice(None)  # which NumPy adds faster
        self.valid[run] += sums.valid
        self.traced[run] += launch.randomisations * launch.points
        self.radiance[run] += sums.radiance
        for name, values in sums.channels.items():
            if not self.by_randomisation:
                values = values.sum(axis=1, keepdims=True)
            if name not in self.sums:
                self.sums[name] = np.zeros((len(self.valid), values.shape[1]), values.dtype)
            self.sums[name][run] += values
        for name, values in sums.lowest.items():
            lowest = self.lowest.setdefault(name, np.full(len(self.valid), np.inf))
            lowest[run] = np.minimum(lowest[run], values)
        for name, values in sums.highest.items():
            highest = self.highest.setdefault(name, np.full(len(self.valid), -np.inf))
            highest[run] = np.maximum(highest[run], values)
        for name, values in sums.unmet.items():
            so_far = self.unmet_sums[name]
            added = name in SUMMED
            so_far[run] = so_far[run] + values if added else np.maximum(so_far[run], values)
        self.invalid += launch.paths - int(sums.valid.sum())
        if sums.tail is not None:
            self.tail = sums.tail if self.tail is None else self.tail + sums.tail

    def up_to(self, most: int) -> "Totals":
        """The totals of at most so many reflections, one of `Channels.up_to`.

        They have no parts by the group that is hit first. Their bounds are those of all paths.
        """
        part = copy(self)
        part.sums = {
            name: values
            for name, values in self.sums.items()
            if "seen." not in name and "upto." not in name
        }
        for prefix in ("", "target."):
            beginning = f"{prefix}{up_to_prefix(most)}"
            part.sums |= {
                prefix + name.removeprefix(beginning): values
                for name, values in self.sums.items()
                if name.startswith(beginning)
            }
            bounces = [name for name in part.sums if name.startswith(f"{prefix}bounce.")]
            for name in bounces[most + 1 :]:
                del part.sums[name]
            whole = sum(part.sums[name] for name in bounces[: most + 1])
            if prefix:
                part.sums["target"] = whole
            else:
                part.radiance = whole
        return part

    @property
    def reached(self) -> bool | None:
        """Whether the criterion was met in all windows; None without one."""
        return None if self.excess is None else bool(np.all(self.excess <= 1))

    @property
    def reached_by_window(self) -> np.ndarray:
        """Whether the criterion was met in each window, (windows,); True without one."""
        return np.broadcast_to(0 if self.excess is None else self.excess, self.traced.shape) <= 1

    @property
    def paths(self) -> np.ndarray:
        """Number of valid paths of each window, (windows,)."""
        return self.valid.sum(axis=1)

    def sums_of(self, name: ChannelNames = None) -> np.ndarray:
        """Sums of the randomisations, (..., windows, randomisations)."""
        if isinstance(name, list):
            return np.array([self.radiance if one is None else self.sums[one] for one in name])
        return self.radiance if name is None else self.sums[name]

    def mean(self, name: ChannelNames = None) -> np.ndarray:
        """Mean of a channel over the paths of each window, (..., windows)."""
        return self.sums_of(name).sum(axis=-1) / np.maximum(self.paths, 1)

    def deviations(self, name: ChannelNames = None) -> np.ndarray:
        """Deviations of the randomisations from the mean, (..., windows, randomisations).

        They are scaled so that the sum of their squares is the squared standard error of the mean,
        and the sum of the products of two channels their covariance. They are infinite for a single
        randomisation.
        """
        R, sums = self.randomisations, self.sums_of(name)
        if R < 2:
            return np.full(sums.shape, np.inf)
        means = sums / np.maximum(self.valid, 1)
        return (means - means.mean(axis=-1, keepdims=True)) / np.sqrt(R * (R - 1))

    def scatter_error(self, name: ChannelNames = None) -> np.ndarray:
        """Standard error of each window's mean from the scatter of its randomisations."""
        return np.sqrt(np.sum(self.deviations(name) ** 2, axis=-1))

    def edge_error(self, name: ChannelNames = None) -> np.ndarray:
        """Smallest standard error of each window's mean, because of edges.

        The points of a randomisation divide the window evenly. All randomisations may therefore
        agree on how many of them lie on one side of an edge, see `edge_share`. The edge is one
        between the darkest and the brightest path. The channels of the target and of the whole
        window have the same edge, in proportion to their means.
        """
        of_target, points = is_of_target(name), self.paths / self.randomisations
        contrast = {key: np.maximum(self.highest[key] - self.lowest[key], 0) for key in self.lowest}
        of_edges = contrast.get("radiance", 0.0)
        of_edges = np.where(of_target, contrast.get("target", of_edges), of_edges)
        of_edges = edge_share(self.randomisations) * of_edges / np.maximum(points, 1)
        if np.any(is_part(name)):
            of_model = self.mean("target" if "target" in contrast else None)
            whole = np.where(of_target, of_model, self.mean())
            share = np.abs(self.mean(name)) / np.where(whole > 0, whole, np.inf)
            of_edges = of_edges * np.where(is_part(name), share, 1)
        return np.where(points >= EVEN_POINTS, of_edges, 0)

    def random_error(self, name: ChannelNames = None) -> np.ndarray:
        """Standard error of each window's mean without what more samples do not reduce."""
        return np.maximum(self.scatter_error(name), self.edge_error(name))

    def standard_error(self, name: ChannelNames = None) -> np.ndarray:
        """Standard error of each window's mean, (..., windows); infinite for one randomisation.

        For a part of the whole, and for a channel that no path has met, it includes sources that no
        path has hit.
        """
        mean = self.mean(name)
        error = np.hypot(self.random_error(name), self.systematic * mean)
        if name is None:
            return error
        has_missed = is_part(name) | ((mean == 0) & is_channel(name))
        return np.where(has_missed, np.hypot(error, self.missed_error(name)), error)

    def missed_error(self, name: ChannelNames = None) -> np.ndarray:
        """Standard error of each window's mean from sources that no path has hit."""
        return self.missed(name) / student_factor(np.inf)

    def unscattered_error(self, name: ChannelNames = None) -> np.ndarray:
        """The part of each window's standard error that the scatter of the means does not show.

        These are edges, and sources that no path has hit.
        """
        of_edges = np.maximum(self.edge_error(name) ** 2 - self.scatter_error(name) ** 2, 0)
        return np.sqrt(of_edges + self.missed_error(name) ** 2)

    def missed(self, name: ChannelNames = None) -> np.ndarray:
        """What a source that no path has hit adds to a window's mean, at most, with 95 %.

        The scatter cannot see such a source. Without emitter sampling this is the radiance of the
        brightest source on UNSEEN paths, or of the brightest of a channel's group. With emitter
        sampling it is less for a source that is out of view and drawn often enough
        (`EmitterTable.by_chance`).
        """
        return UNSEEN * self.largest_unmet(name) / np.maximum(self.paths, 1)

    def largest_unmet(
        self, name: ChannelNames = None, draws: np.ndarray | None = None, times: float = 1.0
    ) -> np.ndarray:
        """Largest contribution of a path to a source that no path has hit, (..., windows).

        It is at least the mean, because a shadow that no path has hit removes a path's radiance.

        draws: numbers of draws of parts of the only window, in place of those of the windows.
        times: for so many times as many paths, if the others are like these.
        """
        recorded = dict(zip(self.sums, self.sums))
        is_one = not isinstance(name, list)
        mean = self.mean(recorded.get(name) if is_one else [*map(recorded.get, name)])
        if self.unmet is None:
            return np.zeros_like(mean)
        weight, starts, aim = 1.0, None, self.aim
        if aim is not None:
            weight = np.where(is_of_target(name), aim.largest_on_model, aim.largest_weight)
            starts = aim.direct
        brightest = self.brightest_of(name)
        sums = {name: v * times if name in SUMMED else v for name, v in self.unmet_sums.items()}
        reflected = self.unmet.after_reflection(sums, weight)
        if draws is not None:
            reflected = np.maximum(self.unmet.rare(draws), self.unmet_sums["largest"])
        # Where no facet is in view, the weights are 0, and the brightest source may be unknown
        brightest_path = brightest * np.maximum(weight, np.finfo(float).tiny)
        bounds = [np.minimum(np.maximum(self.unmet.in_view * weight, reflected), brightest_path)]
        bounds.append(mean)
        if starts is not None:
            of_starts = np.minimum(starts.largest_direct, brightest * starts.largest_weight)
            bounds.append(starts.every * of_starts)
        return reduce(np.maximum, bounds)

    def brightest_of(self, name: ChannelNames) -> float | np.ndarray:
        """Radiance of the brightest source of a channel's group; infinite without a group."""
        known = {} if self.emitters is None else self.emitters.brightest_of
        groups = group_of(name)
        if isinstance(name, list):
            return np.array([[known.get(group, np.inf)] for group in groups[:, 0].tolist()])
        return known.get(groups, np.inf)

    def half_width(self, name: ChannelNames = None) -> np.ndarray:
        """Half of the 95 % interval of each window's mean, (..., windows).

        It includes the contribution of sources that no path has hit.
        """
        of_scatter = student_factor(self.randomisations - 1) * self.scatter_error(name)
        of_edges = student_factor(np.inf) * self.edge_error(name)
        systematic = student_factor(np.inf) * self.systematic * self.mean(name)
        random = np.maximum(of_scatter, of_edges)
        return np.sqrt(random**2 + systematic**2 + self.missed(name) ** 2)

    def missed_by_all(self) -> float:
        """Standard error of the mean over all windows from sources that no path has hit.

        It is largest if such a source is in the window with the fewest paths.
        """
        most = 0.0
        if self.unmet is not None:
            sums = in_all_windows(self.unmet_sums)
            reflected = float(self.unmet.after_reflection(sums))
            most = max(self.unmet.in_view, reflected, self.mean().mean())
        most *= UNSEEN / student_factor(np.inf)
        return most / (len(self.traced) * max(self.traced.min(), 1))

    def mean_error(self) -> float | None:
        """Standard error of the mean over all windows; None for one randomisation."""
        if self.randomisations < 2:
            return None
        random = np.sqrt(np.sum(self.random_error() ** 2)) / len(self.valid)
        return hypot(random, self.systematic * self.mean().mean(), self.missed_by_all())

    def rms_error(self) -> float | None:
        """Rms standard error over the windows as a fraction of the mean of all windows.

        None for one randomisation, and where paths have met nothing but may have missed something.
        """
        if self.randomisations < 2:
            return None
        missed = len(self.valid) * self.missed_by_all() ** 2
        mean, rms = self.mean().mean(), np.sqrt(np.mean(self.standard_error() ** 2) + missed)
        if mean > 0:
            return float(rms / mean)
        return None if rms > 0 else 0.0


def each(of):
    """Decorator: a function of a channel's name; for several names an array (channels, 1)."""

    @lru_cache(64)
    def of_names(*names: str | None) -> np.ndarray:
        return np.array([[of(name)] for name in names])

    @wraps(of)
    def of_one_or_all(name: ChannelNames):
        return of_names(*name) if isinstance(name, list) else of(name)

    return of_one_or_all


@each
def is_channel(name: str | None) -> bool:
    """Whether a name is that of a channel, not of the radiance."""
    return name is not None


@each
def is_of_target(name: str | None) -> bool:
    """Whether a channel holds the target, or a part of it."""
    return (name or "").startswith("target")


@each
def is_part(name: str | None) -> bool:
    """Whether a channel is a part of the whole radiance, or of the target's."""
    return name not in WHOLES


@each
def group_of(name: str | None) -> str:
    """Name of the group that emitted what a channel holds; any other text for other channels."""
    return "" if name is None else name.rpartition("group.")[2]


def edge_share(randomisations: int) -> float:
    """Standard error of the number of a randomisation's points on one side of an edge.

    The true number may be larger by q than the whole number on which all R randomisations agree.
    They do so with a probability of (1 - q)^R. It is 5 % for the q of which this is the standard
    error.
    """
    return (1 - 0.05 ** (1 / randomisations)) / student_factor(np.inf)
