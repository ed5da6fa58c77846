"""Pictures of temperatures: of an image with its budget, of groups, and of a calibration."""

from itertools import cycle

import numpy as np

from mi_lcair.drawing import new_figure, plain, styled
from mi_lcair.laboratory.thermography import Temperature
from mi_lcair.show.line_charts import draw_with_band
from mi_lcair.show.pictures.image_channels import draw_pixels, limits_of

# The object's temperature, its uncertainty, and the budget
# ---------------------------------------------------------


@styled
def of_image(temperature: Temperature):
    """Figure of the temperatures and their standard uncertainty, and what contributes to it."""
    is_image = temperature.kelvin.ndim == 2
    figure = new_figure((11, 3.6) if is_image else (4.6, 3.6), layout="constrained")
    *panels, bars = np.atleast_1d(figure.subplots(1, 3 if is_image else 1))
    for axes, values, title, cmap in zip(
        panels,
        (temperature.kelvin, np.where(np.isfinite(temperature.kelvin), temperature.sigma, np.nan)),
        ("temperature of the object (K)", "standard uncertainty (K)"),
        ("gray", "viridis"),
    ):
        _panel(figure, axes, values, title, cmap)
    from matplotlib.patches import Rectangle

    headline = temperature.headline
    for k, place in enumerate(temperature.places[:-1] if is_image else ()):  # not the whole image
        corner = place.x - 0.5, place.y - 0.5
        style = {"edgecolor": f"C{k}", "facecolor": "none", "linewidth": 1.5, "label": place.name}
        panels[0].add_patch(Rectangle(corner, place.width, place.height, **style))
    if is_image:
        panels[0].legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), ncol=2, fontsize=7)
    rows = headline.contributions[::-1]
    bars.barh(
        [row.quantity.replace("_", " ") for row in rows],
        [abs(row.contribution) for row in rows],
        color="0.55",
    )
    total = headline.standard_error
    bars.axvline(total, color="C3")
    bars.set(title=f"total {total:.3g} K (line)", xlabel="contribution (K)")
    figure.suptitle(plain(temperature.summary()), fontsize=10)
    return figure


def _panel(figure, axes, values, title, cmap) -> None:
    """Draw an image with the limits of all pictures, and pixels without a value in blue."""
    scale = limits_of([values[np.isfinite(values)]], log=False)
    axes.set_facecolor("steelblue")
    drawn = draw_pixels(axes, values, scale, cmap=cmap)
    figure.colorbar(drawn, ax=axes, extend=scale.extend, shrink=0.9)
    axes.set(title=title, xlabel="column (pixel)", ylabel="row (pixel)")


# Temperatures of groups over a day, and the intensity
# ----------------------------------------------------


@styled
def of_heat(heat):
    """Figure of the mean temperature of each group, and of the intensity if it is known."""
    figure = new_figure((9 if heat.intensity else 6, 3.8), layout="constrained")
    left, *rest = np.atleast_1d(figure.subplots(1, 2 if heat.intensity else 1))
    mean, error = heat.means.value, heat.means.standard_error
    if heat.is_steady:
        places = np.arange(len(heat.facets.groups))
        left.errorbar(mean[0], places, xerr=2 * error[0], fmt="o", capsize=3)
        left.set(xlabel="mean temperature (K), k = 2", yticks=places)
        left.set_yticklabels([plain(group) for group in heat.facets.groups])
    else:
        for g, group in enumerate(heat.facets.groups):
            draw_with_band(left, heat.hours, mean[:, g], 2 * error[:, g], label=plain(group))
        left.set(xlabel="hour", xticks=hours(heat), ylabel="mean temperature (K), k = 2")
        left.legend()
    for axes in rest:
        value, sigma = heat.intensity.value, heat.intensity.standard_error
        if heat.is_steady:
            axes.errorbar([0], value, 2 * sigma, fmt="o", capsize=3)
            axes.set(xticks=[])
        else:
            draw_with_band(axes, heat.hours, value, 2 * sigma)
            axes.set(xlabel="hour", xticks=hours(heat))
        axes.set(ylabel=f"intensity, {plain(heat.band)} (W/sr), k = 2")
    figure.suptitle(plain(heat.summary()), fontsize=10)
    return figure


def hours(heat) -> np.ndarray:
    """Ticks of the hours: quarters of a day, or days."""
    step = 6 if max(heat.hours) <= 48 else 24
    return np.arange(0, max(heat.hours) + step, step)


# A series of measured temperatures, and what a calibrated balance predicts
# -------------------------------------------------------------------------


@styled
def of_calibration(found):
    """Figure of the measured and predicted temperatures, and of their differences."""
    from matplotlib import colormaps

    figure = new_figure((9, 3.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    labels, of = list(dict.fromkeys(found.of)), np.array(found.of)
    colours = colormaps["tab20" if len(labels) > 10 else "tab10"].colors
    for colour, label in zip(cycle(colours), labels):
        mine = np.flatnonzero(of == label)
        mine = mine[np.argsort(found.hours[mine], kind="stable")]
        style = {"color": colour, "marker": "."}
        left.plot(found.hours[mine], found.predicted[mine], color=colour, label=plain(label))
        left.plot(found.hours[mine], found.measured[mine], linestyle="", **style)
        right.plot(found.hours[mine], (found.measured - found.predicted)[mine], **style)
    right.axhline(0, color="0.5", linewidth=0.8)
    left.set(xlabel="hour", ylabel="measured (dots), predicted (K)", xticks=hours(found))
    right.set(xlabel="hour", ylabel="measured - predicted (K)", xticks=hours(found))
    figure.legend(loc="outside lower center", ncols=4, fontsize=8)
    figure.suptitle(plain(found.summary()), fontsize=10)
    return figure
