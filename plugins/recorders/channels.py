"""Channels: what is recorded along paths beside their radiance, and under which names."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from mi_lcair.plugins.columns.tables import CELLS, ColumnTables
from mi_lcair.plugins.paths.launch import Paths
from mi_lcair.plugins.paths.sums import COUNTS, Tail, add_tail
from mi_lcair.plugins.recorders.columns import Columns, Incoming
from mi_lcair.plugins.recorders.radiance import ByBounce, BySource, FirstHit, Segments, UnmetSource
from mi_lcair.plugins.recorders.recorder import (
    Emission,
    Recorder,
    Recorders,
    add_to,
    entries,
    zeros,
)

# Recorder of the radiance after the last numbers of reflections, for the geometric tail
# --------------------------------------------------------------------------------------


@dataclass
class LastCounts(Recorder):
    """Radiance after N - 4, ..., N reflections, for N = `max_bounces` [W m^-2 sr^-1]."""

    max_bounces: mi.UInt32
    sums: dr.Local

    @staticmethod
    def of(max_bounces: int) -> "LastCounts":
        return LastCounts(dr.opaque(mi.UInt32, max_bounces), zeros(COUNTS))

    def emission(self, emission: Emission) -> None:
        place = mi.Int32(emission.bounce) + (COUNTS - 1) - mi.Int32(self.max_bounces)
        counts = (place >= 0) & ~emission.beyond
        radiance = dr.select(counts, emission.radiance, 0)
        add_to(self.sums, mi.UInt32(dr.maximum(place, 0)), radiance)

    def tail(self, of_model: mi.Float) -> tuple[mi.Float, Tail]:
        """The geometric tail of each path, and the sums that give its error; evaluates arrays."""
        last = entries(self.sums)
        dr.eval(last, of_model)
        return add_tail(last, of_model)


# Radiance is split by number of reflections (bounce.N, closure), by emitting group (group.LABEL),
# and by the group that is hit first (seen.LABEL)
PARTS = ("bounce", "group", "seen")


@dataclass
class Channels:
    """What is recorded beside the radiance of paths.

    split: whose radiance is recorded. None: that of all paths alone. "image": also range, hit (1 or
    0), target (the radiance of paths that first hit the model), the `parts`, and source.N and
    wavelength.N where the tracer has sources by spectrum. "target": also, for each channel NAME,
    the part of paths that first hit the model, target.NAME. "model": that part alone, as NAME,
    without seen.LABEL; paths that first hit something else are not followed.
    parts: those of PARTS by which the radiance is split.
    counts_segments: whether the number of rays of each path is recorded, as `segments`.
    up_to: numbers of reflections up to which source.N, wavelength.N and group.LABEL are recorded as
    well, as upto.COUNT.NAME.
    tables: parameters with respect to which the radiance is differentiated, see `Columns`. With
    `split` = "target" and "model" it is the radiance of the model's part.
    """

    split: str | None = "image"
    parts: tuple[str, ...] = PARTS
    counts_segments: bool = False
    tables: ColumnTables | None = None
    up_to: tuple[int, ...] = ()

    def recorders(self, tracer, facets, cell, guides: bool = False) -> Recorders:
        """Recorders of these channels, and of what a tracer needs itself.

        facets: numbering of the facets that paths hit first, see `FirstHit`; or None. cell: cell of
        the film in which each path begins, see `Columns`. guides: whether rays are guided.
        """
        parts, is_tailed = [], tracer.closure == "tail"
        if self.tables is not None:
            tables, explores = self.tables, tracer.paths.explored is not None
            incoming = tables.incoming is None
            parts.append(Incoming.of(tables) if incoming else Columns.of(tables, cell, explores))
        if facets or (self.split and "bounce" in self.parts):
            parts.append(ByBounce.up_to(tracer.max_bounces))
        sources = tracer.emitters.sources
        if self.split and ("group" in self.parts or (sources.by_spectrum and not sources.by_bin)):
            for most in (None, *self.up_to):
                parts.append(BySource.of(sources, tracer.emitters.labels, most))
        parts += [Segments(mi.Float(0))] if self.counts_segments else []
        if self.split or facets or is_tailed:
            parts.append(FirstHit.of(tracer.scene, tracer.emitters, facets, self.split == "model"))
        parts += [LastCounts.of(tracer.max_bounces)] if is_tailed else []
        # Without it, a path is taken to bring all of a source that it meets by chance
        if tracer.emitters.draws or (self.split and self.tables is None and tracer.max_bounces):
            parts.append(UnmetSource.of(tracer.emitters, guides))
        return Recorders(parts)

    def by_name(self, L: mi.Float, recorders: Recorders) -> dict:
        """The channels of each path by name; L: its radiance [W m^-2 sr^-1]."""
        segments = recorders.of(Segments).samples(L) if self.counts_segments else {}
        if not self.split:
            return segments
        # Facets need the numbers of reflections, too
        others = (Columns, Incoming, Segments, *(() if "bounce" in self.parts else (ByBounce,)))
        channels = {
            name: value
            for name, value in recorders.without(others).samples(L).items()
            if name.partition(".")[0] not in set(PARTS).difference(self.parts)
        }
        of_model = recorders.of(FirstHit).of_model
        if self.split != "image":
            on_model = {name: value * of_model for name, value in channels.items()}
            if self.split == "model":
                channels = on_model
            else:
                channels |= {f"target.{name}": value for name, value in on_model.items()}
        return channels | {"target": L * of_model} | segments

    def columns(self, L: mi.Float, recorders: Recorders) -> dict:
        """The derivatives of each path by name, and what a control variate needs."""
        recorder = recorders.of((Columns, Incoming))
        if recorder is None:
            return {}
        columns = recorder.samples(L)
        if self.split == "target":
            of_model = recorders.of(FirstHit).of_model
            columns = {name: value * of_model for name, value in columns.items()}
        return columns


def cell_of(paths: Paths, column, row, position) -> mi.UInt32:
    """Cell of the film in which each path begins, see `Columns`.

    column, row, position: the path's window and its position in it, as `Paths.begin` gives them.
    """
    x = mi.UInt32((mi.Float(column) + position.x) * (CELLS / mi.Float(paths.columns)))
    y = mi.UInt32((mi.Float(row) + position.y) * (CELLS / mi.Float(paths.rows)))
    return dr.minimum(y, CELLS - 1) * CELLS + dr.minimum(x, CELLS - 1)
