"""Sums over the paths of a launch, for each window and randomisation."""

from dataclasses import dataclass, replace
from math import gcd

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.plugins.paths.tail import Tail

# Consecutive values summed in Float32, before sums in Float64. A Float32 sum of 16,000 equal
# numbers has an error of 1e-5.
SUMMED_IN_FLOAT32 = 8


@dataclass(frozen=True)
class Sums:
    """Sums over the points of each randomisation, (windows, randomisations), NumPy Float64.

    All but `valid` are weighted sums. NaN and infinite samples are left out. valid: number of the
    other samples. radiance: their sum [W m^-2 sr^-1]. channels: sums of the channels by name, see
    `Channels.samples`. chance: largest contribution of a source that a path of the window could
    have hit but did not hit, (windows,) [W m^-2 sr^-1]. tail: sums for closure = tail; None for
    another closure.
    """

    valid: np.ndarray
    radiance: np.ndarray
    channels: dict[str, np.ndarray]
    chance: np.ndarray
    tail: Tail | None

    @staticmethod
    def of(L, channels: dict, weight, chance, tail: Tail | None, launch: Launch) -> "Sums":
        """Sums of samples.

        Parameters
        ----------
        L : mi.Float
            Radiance of each path [W m^-2 sr^-1].
        channels : dict of str to mi.Float
        weight : mi.Float
            Weight of each path, see `Aim`.
        chance : mi.Float or None
            Contribution of a source that the path did not hit; None for 0 [W m^-2 sr^-1].
        tail : Tail or None
        launch : Launch
        """
        finite = dr.isfinite(L)
        values = [mi.Float(1), *(value * weight for value in (L, *channels.values()))]
        values = [dr.select(finite, value, 0) for value in values]
        # One array for all sums: a transfer for each would cost more than a small launch
        table = dr.empty(mi.Float, len(values) * launch.paths)
        # An opaque number of paths, so that one kernel serves launches of all sizes
        lane, paths = dr.arange(mi.UInt32, launch.paths), dr.opaque(mi.UInt32, launch.paths)
        for row, value in enumerate(values):
            dr.scatter(table, value, lane + row * paths, mode=dr.ReduceMode.Permute)
        largest = 0.0
        if chance is not None:
            # One kernel for both arrays, which would otherwise trace the paths twice
            chance *= weight
            dr.eval(table, chance)
            largest = dr.block_reduce(
                dr.ReduceOp.Max, chance, launch.randomisations * launch.points
            ).numpy()
        few = gcd(launch.points, SUMMED_IN_FLOAT32)
        parts = dr.block_sum(table, few).numpy()
        shape = (len(values), launch.windows, launch.randomisations, launch.points // few)
        valid, radiance, *rest = parts.reshape(shape).sum(axis=-1, dtype=np.float64)
        return Sums(
            valid=valid,
            radiance=radiance,
            channels=dict(zip(channels, rest)),
            chance=np.broadcast_to(np.asarray(largest, dtype=np.float64), launch.windows),
            tail=tail,
        )

    def without(self, names) -> "Sums":
        """These sums without the channels of these names, and without their parts on the model."""
        unwanted = {prefix + name for name in names for prefix in ("", "target.")}
        kept = {name: value for name, value in self.channels.items() if name not in unwanted}
        return replace(self, channels=kept)
