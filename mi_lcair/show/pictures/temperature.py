"""Picture of a temperature: the object's temperature, its uncertainty, and the budget."""

import numpy as np

from mi_lcair.drawing import new_figure, plain, styled
from mi_lcair.laboratory.thermography import Temperature
from mi_lcair.show.pictures.image_channels import draw_pixels, limits_of


@styled
def figure(temperature: Temperature):
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
