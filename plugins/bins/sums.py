"""Recorder of the radiance by source and bin of wavelength, in scenes with spectral materials."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins.bins.by_bin import ByBin
from mi_lcair.plugins.emission.emitter_table import EmitterTable
from mi_lcair.plugins.paths.launch import Launch, Paths
from mi_lcair.plugins.recorders.recorder import Emission, Recorder

MOST_SUMS = 2**27  # sums of one launch, of 8 bytes each


class BinSums:
    """Sums over the paths of a launch for each source, bin, window and randomisation.

    There is one array for all paths, outside of what the loop carries. It has separate sums for the
    paths that first hit the model, and for the others.

    by_bin: the scene's tables. launch: the launch.
    """

    def __init__(self, by_bin: ByBin, launch: Launch):
        self.count, self.sources, self.shares = by_bin.count, len(by_bin.sources), by_bin.shares
        self.shape = launch.windows, launch.randomisations, 2, self.sources * self.count
        if np.prod(self.shape, dtype=float) > MOST_SUMS:
            raise InputError(
                f"{launch.windows} pixels or views with {self.shape[-1]} sources by bin are too "
                "many at once for materials that depend on wavelength; use fewer pixels, or give "
                "the materials `average_K`"
            )
        self.array = dr.zeros(dr.float64_array_t(mi.Float), int(np.prod(self.shape)))
        dr.make_opaque(self.array)

    def add(self, row, source, k, value) -> None:
        """Add radiance of bin k of a source to a row, see `rows`."""
        index = (row * self.sources + source) * self.count + k
        active = (value != 0) & dr.isfinite(value)
        value = dr.float64_array_t(mi.Float)(value)
        dr.scatter_add(self.array, value, index, active, mode=dr.ReduceMode.Local)

    def channels(self, split: str) -> dict[str, np.ndarray]:
        """Sums by the names of channels, (windows, randomisations) each; split: see `Channels`."""
        sums = self.array.numpy().reshape(self.shape)
        of_model, whole = sums[:, :, 1], sums.sum(axis=2)
        parts = {"": of_model} if split == "model" else {"": whole, "target.": of_model}
        return {
            f"{prefix}source.{k}": values[:, :, k]
            for prefix, values in parts.items()
            for k in range(self.shape[-1])
        }


@dataclass
class BySourceAndBin(Recorder):
    """Adds the radiance of each source in each bin to the `BinSums` of a launch.

    row: row of each path's window and randomisation in the sums, one for paths that first hit the
    model and one for others. weight: of each path.
    """

    scene: mi.Scene
    emitters: EmitterTable
    sums: BinSums
    row: mi.UInt32
    weight: mi.Float

    @staticmethod
    def of(scene, emitters, sums: BinSums, paths: Paths, weight) -> "BySourceAndBin":
        return BySourceAndBin(scene, emitters, sums, 2 * (paths.lane // paths.points), weight)

    def begin(self, first, ray, active) -> mi.Bool:
        si = first.compute_surface_interaction(ray, mi.RayFlags.Minimal, active)
        of_model = si.is_valid() & self.emitters.is_model(si.emitter(self.scene, active))
        self.row += dr.select(of_model, mi.UInt32(1), 0)
        return active

    def emission(self, emission: Emission) -> None:
        by_bin = emission.by_bin
        base = dr.select(emission.beyond, 0, by_bin.base * self.weight)
        self.add(base, by_bin.sources, by_bin.factors, self.row)

    @dr.syntax
    def add(self, base, sources, factors, row):
        """Add `base` times the factors of the bins, divided among the sources."""
        k = mi.UInt32(0)
        while k < self.sums.count:
            value = base * factors.read(k)
            self.add_parts(row, sources, k, value)
            k += 1

    def add_parts(self, row, sources, k, value) -> None:
        """Add the radiance of one bin to the sums of the sources; sources: with their shares."""
        for source, share in sources:
            of_bin = dr.gather(mi.Float, self.sums.shares, source * self.sums.count + k)
            self.sums.add(row, source, k, value * share * of_bin)
