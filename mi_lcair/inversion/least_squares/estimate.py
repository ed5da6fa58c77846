"""The estimate of unknowns from data, with the checks of the first render."""

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.inversion.data.datum import Datum
from mi_lcair.inversion.data.loader import check_units
from mi_lcair.inversion.least_squares.prediction import DatumBlock
from mi_lcair.inversion.least_squares.solve import State, solve
from mi_lcair.inversion.tables import RenderSettings
from mi_lcair.inversion.unknowns import Unknown


def estimate(
    everything: list[Unknown], data: list[Datum], sampling: RenderSettings, progress
) -> State:
    """The estimate of the unknowns from the data."""
    is_checked = False

    def render(x) -> list[DatumBlock]:
        nonlocal is_checked
        blocks = [datum.block(everything, x, sampling) for datum in data]
        if not is_checked:
            check_units(data, blocks)
            check_seen(everything, blocks)
            is_checked = True
        return blocks

    def weigh(x) -> list[np.ndarray]:
        return [datum.weight(everything, x, sampling) for datum in data]

    is_exact = all(
        datum.follows(everything[k]) for datum in data for k in datum.numbers(everything)
    )
    return solve(everything, render, weigh, is_exact, sampling.iterations, progress)


def check_seen(everything: list[Unknown], blocks: list[DatumBlock]) -> None:
    """Raise InputError for an unknown, not a facet's, on which no measured value depends."""
    depends = np.zeros(len(everything), dtype=bool)
    for block in blocks:
        of = [abs(columns).sum(axis=0) > 0 for columns in block.columns]
        depends[block.unknown] |= np.any(of, axis=0)
        depends[[k for k in (block.gain, block.offset) if k is not None]] = True
    for unknown, is_seen in zip(everything, depends):
        if not is_seen and unknown.kind != "facet" and unknown.prior is None:
            raise InputError(
                f"'{unknown.label}' is an unknown without any data: no measured value depends on it"
            )
