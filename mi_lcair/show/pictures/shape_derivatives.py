"""Picture of derivatives with respect to a shape, on the surface as the sensor sees it."""

import numpy as np

from mi_lcair.derivatives.shape import ShapeDerivatives
from mi_lcair.drawing import new_figure, plain, styled

FULL = 99.0  # percentile of the facets that is at the end of the colour scale
PANELS = {"derivative": "RdBu_r", "standard_error": "viridis"}


@styled
def figure(shape: ShapeDerivatives):
    """Figure with the derivative of each facet on the left, and its standard error on the right."""
    from matplotlib.collections import PolyCollection

    corners = shape.triangles @ shape.axes.T
    order = np.argsort(corners[:, :, 2].mean(axis=1), kind="stable")
    rows = np.searchsorted(shape.table["facet"], shape.triangle_facet)[order]
    width, height = np.ptp(corners[:, :, :2].reshape(-1, 2), axis=0)
    rows_and_columns = (2, 1) if width > 2 * height else (1, 2)
    drawn = new_figure((11, 6), layout="constrained")
    for panel, (name, colours) in zip(drawn.subplots(*rows_and_columns), PANELS.items()):
        values = shape.table[f"{name}_W_sr_m3"]
        end = max(float(np.nanpercentile(np.append(np.abs(values), 0), FULL)), 1e-300)
        facets = PolyCollection(
            corners[order, :, :2], array=values[rows], cmap=colours, edgecolors="face"
        )
        facets.set_clim(-end if name == "derivative" else 0, end)
        panel.add_collection(facets)
        panel.autoscale_view()
        panel.set_aspect("equal")
        panel.set_xlabel("to the right as the sensor sees it (m)")
        panel.set_ylabel("up (m)")
        panel.set_title(name.replace("_", " "))
        drawn.colorbar(
            facets,
            ax=panel,
            label=r"W sr$^{-1}$ per m outward and per m$^2$",
            extend="both" if name == "derivative" else "max",
        )
    drawn.suptitle(plain(shape.summary()), fontsize=9)
    return drawn
