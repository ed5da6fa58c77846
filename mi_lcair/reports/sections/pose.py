"""Section of the pose of a camera."""

import numpy as np

from mi_lcair.results.result import summary_of
from mi_lcair.results.sections import Facts, Remarks, Section, Table


def sections(result) -> list[Section]:
    """The pose with its errors, and the residuals of the points."""
    observer, half = result.observer, result.factor * result.turn_error_deg
    turns = ", ".join(
        f"{value:.2g} about {side}" for value, side in zip(half, ("right", "up", "axis"))
    )
    rows = [
        ("range", f"{observer.range_m:.6g} m from the model's middle"),
        (
            "direction",
            f"azimuth {observer.azimuth_deg:.5g}, elevation {observer.elevation_deg:.5g}",
        ),
        ("pointing", ", ".join(f"{name} = {x:.4g}" for name, x in result.pointing.items())),
        ("turns, 95 %", f"{turns} [degrees]"),
    ]
    head = ["point", "x m", "y m", "z m", "column", "row", "residual px", "residual px"]
    table = [
        (f"{number}", *(f"{value:.5g}" for value in values))
        for number, values in enumerate(np.column_stack(list(result.columns().values())), 1)
    ]
    parts = [summary_of(result), Facts(rows), Table(head, table), Remarks(list(result.remarks))]
    return [Section("Pose", parts)]
