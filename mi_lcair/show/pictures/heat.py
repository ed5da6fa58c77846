"""Picture of temperatures from a heat balance: of groups over the day, and the intensity."""

import numpy as np

from mi_lcair.drawing import new_figure, plain, styled
from mi_lcair.show.line_charts import draw_with_band


@styled
def figure(heat):
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
    step = 6 if heat.hours[-1] <= 48 else 24
    return np.arange(0, heat.hours[-1] + step, step)
