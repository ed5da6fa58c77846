"""Sums by bin of wavelength over the paths of a launch, and the recorder that adds to them."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.bins.by_bin import NEIGHBOURS, SIZE, ByBin, gathered, in_blocks
from mi_lcair.plugins.emission.emitter_table import EmitterTable
from mi_lcair.plugins.paths.launch import Launch, Paths
from mi_lcair.plugins.recorders.recorder import Emission, Recorder, zeros

MOST_SUMS = 2**24  # sums of one launch, of 8 bytes each


class BinSums:
    """Sums for each window, randomisation and bin of wavelength.

    There is one array for all paths, outside of what the loop carries. A subclass sets `table`,
    the factors of the radiance of the scene's sources, by blocks.

    by_bin: the scene's tables. launch: the launch. shape: of the sums.
    """

    table: mi.Float
    counts_closure = False  # whether the radiance beyond the last reflection counts

    def __init__(self, by_bin: ByBin, launch: Launch, shape: tuple[int, ...]):
        self.count, self.blocks, self.shape = by_bin.count, by_bin.blocks, shape
        self.array = dr.zeros(dr.float64_array_t(mi.Float), int(np.prod(self.shape)))
        dr.make_opaque(self.array)

    @staticmethod
    def of_row(by_bin: ByBin) -> int:
        """Number of sums of a window and randomisation."""
        return by_bin.count

    def add(self, index, values, block) -> None:
        """Add radiance in the bins of a block to sums; index: function of a bin's number."""
        for place, value in enumerate(values):
            k = SIZE * block + place
            active = (k < self.count) & (value != 0) & dr.isfinite(value)
            value = dr.float64_array_t(mi.Float)(value)
            dr.scatter_add(self.array, value, index(k), active, mode=dr.ReduceMode.Local)

    def of_path(self) -> dr.Local | None:
        """Sums of one path; None where all that a path brings is added to those of the launch."""
        return None

    def sums(self) -> np.ndarray:
        """The sums in their shape."""
        return self.array.numpy().reshape(self.shape)


class SourceSums(BinSums):
    """Sums of the in-band radiance of each source in each bin.

    There are separate sums for the paths that first hit the model: (windows, randomisations, 2,
    sources and bins), of which the second part is the model.
    """

    def __init__(self, by_bin: ByBin, launch: Launch):
        self.sources, self.table = len(by_bin.sources), by_bin.shares
        shape = launch.windows, launch.randomisations, 2, self.sources * by_bin.count
        super().__init__(by_bin, launch, shape)

    @staticmethod
    def of_row(by_bin: ByBin) -> int:
        return 2 * len(by_bin.sources) * by_bin.count

    def add_parts(self, row, parts, block, base, factors, of_path) -> None:
        """Add the radiance of a block of bins to a row, see `ByBinOfPath`."""
        factor = factors.read(block)
        for source, share in parts:
            values = base * share * factor * gathered(self.table, source * self.blocks + block)
            first = (row * self.sources + source) * self.count
            self.add(lambda k, first=first: first + k, values, block)

    def channels(self, split: str) -> dict[str, np.ndarray]:
        """Sums by the names of channels, (windows, randomisations) each; split: see `Channels`."""
        sums = self.sums()
        parts = {"": sums[:, :, 1]}
        if split == "target":
            parts = {"": sums.sum(axis=2), "target.": sums[:, :, 1]}
        return {
            f"{prefix}source.{k}": of_source.T
            for prefix, values in parts.items()
            # The sums of a source lie together in a copy without the paths beside the model
            for k, of_source in enumerate(np.ascontiguousarray(values.T))
        }


class SpectralSums(BinSums):
    """Sums of the spectral radiance of all sources in each bin [W m^-2 sr^-1 um^-1].

    The sums of a bin lie together, (bins, windows, randomisations), since they are added up later.
    """

    counts_closure = True

    def __init__(self, by_bin: ByBin, launch: Launch):
        super().__init__(by_bin, launch, (by_bin.count, launch.windows, launch.randomisations))
        self.table = in_blocks(by_bin.densities)
        self.rows = dr.opaque(mi.UInt32, launch.windows * launch.randomisations)

    def of_path(self) -> dr.Local:
        """Sums of one path, which are added to those of the launch at its end."""
        return zeros(self.blocks, mi.Vector4f)

    def add_parts(self, row, parts, block, base, factors, of_path) -> None:
        here = factors.read(block)
        # Beyond both ends the densities are 0
        before = factors.read(dr.maximum(block, 1) - 1).w
        after = factors.read(dr.minimum(block + 1, self.blocks - 1)).x
        bins = before, *here, after
        values = of_path.read(block)
        for source, share in parts:
            for column, step in enumerate(NEIGHBOURS):
                index = (source * len(NEIGHBOURS) + column) * self.blocks + block
                factor = mi.Vector4f(*bins[1 + step : 1 + step + SIZE])
                values += base * share * factor * gathered(self.table, index)
        of_path.write(values, block)

    def channels(self, split: str) -> dict[str, np.ndarray]:
        """Sums by the names of channels, (windows, randomisations) each."""
        return {f"bin.{k}": sums for k, sums in enumerate(self.sums())}


@dataclass
class ByBinOfPath(Recorder):
    """Adds the radiance of each path by bin to the `BinSums` of a launch.

    row: row of each path's window and randomisation in the sums, one for paths that first hit the
    model and one for others. weight: of each path. of_path: see `BinSums`.
    """

    scene: mi.Scene
    emitters: EmitterTable
    sums: BinSums
    row: mi.UInt32
    weight: mi.Float
    of_path: dr.Local | None

    @staticmethod
    def of(scene, emitters, sums: BinSums, paths: Paths, weight) -> "ByBinOfPath":
        row = 2 * (paths.lane // paths.points)
        return ByBinOfPath(scene, emitters, sums, row, weight, sums.of_path())

    def begin(self, first, ray, active) -> mi.Bool:
        si = first.compute_surface_interaction(ray, mi.RayFlags.Minimal, active)
        of_model = si.is_valid() & self.emitters.is_model(si.emitter(self.scene, active))
        self.row += dr.select(of_model, mi.UInt32(1), 0)
        return active

    def emission(self, emission: Emission) -> None:
        by_bin, base = emission.by_bin, emission.by_bin.base * self.weight
        if not self.sums.counts_closure:
            base = dr.select(emission.beyond, 0, base)
        self.add(base, by_bin.sources, by_bin.factors, self.row, self.of_path)

    @dr.syntax
    def add(self, base, sources, factors, row, of_path):
        """Add `base` times the factors of the bins, divided among the sources."""
        block = mi.UInt32(0)
        while block < self.sums.blocks:
            self.sums.add_parts(row, sources, block, base, factors, of_path)
            block += 1

    def end(self) -> None:
        """Add the sums of the path to those of the launch, after the path's end."""
        if self.of_path is not None:
            self.add_of_path(self.row, self.of_path)

    @dr.syntax
    def add_of_path(self, row, of_path):
        """Add each sum of a path to a row."""
        block = mi.UInt32(0)
        while block < self.sums.blocks:
            # The paths that first hit the model have odd rows
            self.sums.add(lambda k: k * self.sums.rows + row // 2, of_path.read(block), block)
            block += 1
