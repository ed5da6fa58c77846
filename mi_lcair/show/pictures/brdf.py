"""Picture of a BRDF over the hemisphere of reflection (thesis Figures 2.9, 3.14)."""

import numpy as np

from mi_lcair.drawing import new_figure, plain, styled
from mi_lcair.physics.brdf_view import BRDFView
from mi_lcair.show.pictures.image_channels import log_ticks

GRAZING = 80.0  # degrees; smaller values at larger angles do not extend the scale
PALE = "0.45"  # grey of secondary lines and text


@styled
def figure(view: BRDFView):
    """Figure of a BRDF over the hemisphere, and of its cut through the plane of incidence."""
    figure = new_figure((11, 4.8), layout="constrained")
    left, right = figure.subfigures(1, 2, width_ratios=(1, 1.15))
    figure.suptitle(
        f"{plain(f'{view.material.name}, {view.band.label}')}, incidence {view.theta_i:g}°: "
        f"DHR {view.dhr:.4f}, emissivity at {view.theta_i:g}° {view.emissivity:.4f}"
    )
    draw_hemisphere(left, view, *scale(view))
    draw_cut(right.subplots(), view, *scale(view))
    return figure


def scale(view: BRDFView) -> tuple[float, float]:
    """Ends of the logarithmic scale: the range of values up to GRAZING, at least a decade."""
    values = view.brdf[view.theta_r <= GRAZING]
    values = values[values > 0]
    lower, upper = (values.min(), view.brdf.max()) if values.size else (1, 1)
    widen = max(1.0, (10 * lower / upper) ** 0.5)
    return lower / widen, upper * widen


def draw_hemisphere(figure, view: BRDFView, lower: float, upper: float) -> None:
    """Draw the BRDF over the hemisphere, seen from above.

    The normal is in the middle and the horizon on the rim. The mirror direction is on the right.
    `lower` and `upper` are the ends of the scale, 1/sr.
    """
    from matplotlib.colors import LogNorm

    axes = figure.subplots(subplot_kw={"projection": "polar"})
    axes.grid(False)
    picture = axes.pcolormesh(
        np.radians(view.azimuth),
        view.theta_r,
        np.ma.masked_less_equal(view.brdf, 0),
        norm=LogNorm(lower, upper),
        cmap="viridis",
        shading="gouraud",
        rasterized=True,
    )
    axes.set_facecolor("0.6")
    for azimuth, marker, size, label in (
        (np.pi, "x", 6, "source"),
        (0, "o", 9, "mirror direction"),
    ):
        place = azimuth, view.theta_i, marker
        axes.plot(*place, ms=size, mew=2, mfc="none", color="white")
        axes.plot(*place, ms=size, mew=0.8, mfc="none", color="black", label=label)
    axes.set_ylim(0, 90)
    axes.set_rgrids([30, 60], ["30°", "60°"], angle=90, fontsize=7, color="0.85")
    axes.yaxis.grid(color="0.85", lw=0.5, alpha=0.6)
    azimuths = [f"{angle}°" for angle in (0, 45, 90, 135, 180, -135, -90, -45)]
    axes.set_thetagrids(range(0, 360, 45), azimuths, fontsize=8)
    axes.xaxis.grid(False)
    axes.set_title(r"$\theta_r$ from the middle, azimuth from the mirror side", fontsize=8, pad=14)
    axes.legend(fontsize=7, loc="lower left", bbox_to_anchor=(-0.22, -0.1))
    extend = "min" if view.brdf.min() < lower else "neither"
    bar = figure.colorbar(picture, ax=axes, shrink=0.8, pad=0.1, extend=extend)
    bar.set_label("BRDF (1/sr)")
    log_ticks(bar, lower, upper)


def draw_cut(axes, view: BRDFView, lower: float, upper: float) -> None:
    """Draw the BRDF in the plane of incidence on a logarithmic axis, `lower` to `upper`, 1/sr."""
    axes.plot(view.cut_theta_r, np.ma.masked_less_equal(view.cut, 0), color="C3", lw=1.4)
    axes.axvline(-view.theta_i, color=PALE, lw=0.8, ls=":")
    place = {"ha": "right", "va": "top", "transform": axes.get_xaxis_transform()}
    axes.text(-view.theta_i, 1.0, "source ", color=PALE, fontsize=8, rotation=90, **place)
    axes.set_yscale("log")
    axes.set_ylim(lower / 1.5, upper * 2)
    axes.set_xlim(-90, 90)
    axes.set_xticks(range(-90, 91, 30))
    axes.set_xlabel(
        r"$\theta_r$ in the plane of incidence (degrees, positive on the mirror direction's side)"
    )
    axes.set_ylabel("BRDF (1/sr)")
    axes.grid(color="0.9", lw=0.6)
    axes.set_axisbelow(True)
    if not view.cut.any():
        axes.text(0.5, 0.5, "reflects nothing", transform=axes.transAxes, ha="center", color=PALE)
