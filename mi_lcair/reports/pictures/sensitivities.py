"""Picture of derivatives of an intensity: a bar and a standard error for each parameter."""

import numpy as np

from mi_lcair.drawing import new_figure, plain, styled
from mi_lcair.sensitivity.sensitivities import Sensitivities

MOST_BARS = 20  # bars of one unit, those with the largest derivatives


@styled
def figure(sensitivities: Sensitivities):
    """Figure with one panel for each unit, because derivatives per kelvin and per 1 differ."""
    columns = sensitivities.columns()
    kinds = list(dict.fromkeys(columns["unit"])) or ["W/sr"]
    rows = {unit: np.flatnonzero(columns["unit"] == unit) for unit in kinds}
    for unit, of_unit in rows.items():
        largest = np.argsort(-np.abs(columns["derivative"][of_unit]), kind="stable")
        rows[unit] = of_unit[largest[:MOST_BARS]]
    heights = [1.1 + 0.3 * max(len(of_unit), 1) for of_unit in rows.values()]
    figure = new_figure((8, 0.7 + sum(heights)), layout="constrained")
    panels = figure.subplots(len(rows), 1, squeeze=False, height_ratios=heights)[:, 0]
    for panel, (unit, of_unit) in zip(panels, rows.items()):
        places = np.arange(len(of_unit))
        panel.barh(
            places,
            columns["derivative"][of_unit],
            xerr=columns["standard_error"][of_unit],
            height=0.65,
            color=["C3" if columns["derivative"][k] > 0 else "C0" for k in of_unit],
        )
        panel.set_yticks(places, [plain(columns["parameter"][k]) for k in of_unit], fontsize=8)
        panel.invert_yaxis()
        panel.axvline(0, color="black", linewidth=0.8)
        panel.set_xlabel(f"derivative of the intensity ({plain(unit)})")
    figure.suptitle(
        plain(
            f"{sensitivities.scene_name}, {sensitivities.band}: intensity "
            f"{sensitivities.value:.6g} ± {sensitivities.error[0]:.2g} W/sr (standard error)"
        )
    )
    return figure
