"""Sums that each path keeps for itself while it is followed."""

import drjit as dr
import mitsuba as mi


def zeros(count: int) -> dr.Local | None:
    """A path's own array of zeros; None for no entries."""
    return dr.alloc_local(mi.Float, count, value=mi.Float(0)) if count else None


def add_to(local: dr.Local, index: mi.UInt32, value: mi.Float) -> None:
    """Add a value to one entry of a path's own array."""
    local.write(local.read(index) + value, index)


def entries(local: dr.Local | None) -> list[mi.Float]:
    """All entries of a path's own array; none if it is None."""
    return [] if local is None else [local.read(mi.UInt32(k)) for k in range(len(local))]
