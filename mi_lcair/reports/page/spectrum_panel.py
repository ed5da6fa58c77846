"""Panel of the spectral intensity of a signature."""

import numpy as np

from mi_lcair.reports.page.figures import INK, LINE, colour, figure_panel, graph_objects, subplots
from mi_lcair.reports.page.figures import name as plain_name
from mi_lcair.reports.page.panel import Panel

WAVELENGTH = "wavelength (µm)"
INTENSITY = "spectral intensity (W sr⁻¹ µm⁻¹)"
PARTS = ("target", "scene")


def spectrum_panel(wavelengths_um, curves: dict[str, np.ndarray]) -> Panel:
    """The panel of a spectral intensity.

    wavelengths_um: (n,). curves: spectral intensity, W sr^-1 um^-1, (n,), of "target" and "scene",
    and of their groups "target.GROUP" and "scene.GROUP".
    """
    go, parts = graph_objects(), [part for part in PARTS if part in curves]
    figure = subplots(rows=1, cols=len(parts), subplot_titles=parts, horizontal_spacing=0.1)
    groups = list(dict.fromkeys(name.partition(".")[2] for name in curves if "." in name))
    named = set()  # groups that are in the legend
    for place, part in enumerate(parts, 1):
        of_part = {"total": curves[part]} | {
            group: curves[f"{part}.{group}"] for group in groups if f"{part}.{group}" in curves
        }
        for group, values in of_part.items():
            if not np.any(values):
                continue
            line = (
                {"color": INK, "width": 2.2}
                if group == "total"
                else LINE | {"color": colour(groups.index(group))}
            )
            figure.add_trace(
                go.Scatter(
                    x=np.asarray(wavelengths_um, float),
                    y=np.asarray(values, float),
                    name=plain_name(group),
                    legendgroup=group,
                    showlegend=group not in named,
                    line=line,
                    hovertemplate="%{x:.4g} µm: %{y:.5g} W sr⁻¹ µm⁻¹",
                ),
                row=1,
                col=place,
            )
            named.add(group)
    figure.update_xaxes(title_text=WAVELENGTH)
    figure.update_yaxes(title_text=INTENSITY, rangemode="tozero")
    figure.update_layout(
        legend={"orientation": "h", "y": -0.22, "yanchor": "top"},
        margin={"l": 70, "r": 20, "t": 40, "b": 60},
        hovermode="closest",
    )
    return figure_panel(figure, 430)
