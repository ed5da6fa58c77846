"""Picture of a fit: measured and fitted BRDF, residuals, emissivity, table of parameters."""

from textwrap import wrap

import numpy as np

from mi_lcair.drawing import new_figure, plain, styled, write_figure
from mi_lcair.fitting.model import directional, model_of, scans_of
from mi_lcair.fitting.scatterometer.reading import Measurements
from mi_lcair.physics import reflection

ANGLES = {"theta_i": r"$\theta_i$", "theta_r": r"$\theta_r$"}
TITLES = {
    "emissivity": ("emissivity", "theta_r"),
    "dhr": ("directional-hemispherical reflectance", "theta_i"),
}
INK, PALE = "0.15", "0.45"  # greys of main and of secondary text


def figure(fit):
    """Picture of one `Fit`: measured and fitted BRDF, residuals, emissivity, parameters, verdict.

    Returns a Matplotlib Figure.
    """
    return figure_of([(fit.measurements, fit, fit.directional)])


@styled
def figure_of(fits):
    """Figure with a row of panels for each of (Measurements, Fit, {quantity: DirectionalData})."""
    whole = new_figure((11, 6.2 * len(fits)), layout="constrained")
    for row, (measurements, *fitted) in zip(np.atleast_1d(whole.subfigures(len(fits), 1)), fits):
        draw_fit(row, measurements, *fitted)
        band = ", {:g}-{:g} um".format(*measurements.band_um) if measurements.band_um else ""
        row.suptitle(plain(f"{measurements.name}{band}: {model_of(fitted[0])}"))
    return whole


@styled
def curves(fit, measurements: Measurements | None, directional: dict):
    """Figure of a fit without its parameters; without measurements it has curves alone."""
    figure = new_figure((11, 6.2), layout="constrained")
    draw_fit(figure, measurements, fit, directional, has_table=False)
    return figure


def save_plot(path, fits) -> None:
    """Write the picture `figure_of` the fits to a PNG, SVG or PDF file."""
    write_figure(figure_of(fits), path)


def draw_fit(
    figure, measurements: Measurements | None, fit, directional: dict, has_table: bool = True
) -> None:
    """Draw the panels of one fit in a (sub)figure.

    `directional` is the measured emissivity or DHR by quantity.
    """
    left, right = figure.subfigures(1, 2, width_ratios=(1.8, 1))
    draw_brdf(*left.subplots(2, 1, sharex=True, height_ratios=(3, 1)), measurements, fit)
    quantities = directional or {"emissivity": None}
    heights = [1.25] * has_table + [1] * len(quantities)
    panels = [*right.subplots(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]]
    if has_table:
        draw_table(panels.pop(0), fit)
    for panel, (quantity, data) in zip(panels, quantities.items()):
        draw_directional(panel, fit, quantity, data)


def draw_brdf(axes, below, measurements: Measurements | None, fit) -> None:
    """Draw measured points and fitted curves on a logarithmic axis, and residuals below.

    The angle with more values is the abscissa. Each value of the other angle has its own colour.
    Points that the fit left out are hollow.
    """
    swept, fixed, scans = scans_of(fit, measurements)
    for scan, color in zip(scans, shades(len(scans))):
        axes.plot(*scan.curve, color=color, lw=1.2, label=f"{scan.setting:g}°")
        axes.fill_between(*scan.band, color=color, alpha=0.18, lw=0)
        for points, face in ((scan.fitted, color), (scan.left_out, "none")):
            axes.plot(*points, "o", ms=2.6, mew=0.5, color=color, mfc=face)
        below.plot(scan.fitted[0], scan.residuals, "o", ms=2.2, mew=0, color=color)
    lowest, highest = ([end(scan.curve[1]) for scan in scans] for end in (np.min, np.max))
    fitted = np.concatenate([scan.fitted[1] for scan in scans])
    left_out = np.concatenate([scan.left_out[1] for scan in scans])
    least = fitted.min() if fitted.size else min(lowest)
    largest = max(fitted.max(initial=0), left_out.max(initial=0))
    axes.set_yscale("log")
    axes.set_ylim(max(min(*lowest, least), 0.03 * least) / 2, 4 * (largest or max(highest)))
    axes.set_ylabel("BRDF (1/sr)")
    words = "lines fitted,\nbands 95 %"
    if measurements is not None:
        words = f"dots measured\n(hollow: left out), {words}"
    axes.legend(
        title=f"{ANGLES[fixed]}: {words}",
        ncols=2,
        loc="upper left",
        handlelength=1.2,
        columnspacing=1,
        labelspacing=0.3,
        alignment="left",
    )
    below.axhline(0, color=INK, lw=0.8)
    residual = max(np.abs(scan.residuals).max(initial=0) for scan in scans)
    reach = max(0.1, 1.1 * residual)
    below.set_ylim(-reach, reach)
    below.set_ylabel("measured / fitted\n(decades)")
    below.set_xlabel(f"{ANGLES[swept]} (degrees)")
    for panel in (axes, below):
        panel.grid(color="0.9", lw=0.6)
        panel.set_axisbelow(True)


def draw_table(axes, fit) -> None:
    """Draw the parameters with standard errors and verdicts, and the quality of the fit."""
    axes.axis("off")
    lines = []
    for parameter in reflection.model(fit.model).parameters:
        name = parameter.name
        lines.append(
            (parameter.symbol, f"{fit.parameters[name]:.4g}", f"± {fit.standard_error[name]:.2g}")
        )
        lines += [("", text, None) for text in wrap(fit.verdict[name], 46)]
    left_out = sum((fit.measurements.dropped | fit.dropped).values())
    lines += [
        ("", "", None),
        ("rms", f"{fit.rms_dex:.4f} decades in BRDF", None),
        *(("", text, None) for text in wrap(fit.quality.verdict, 46)),
        ("points", f"{fit.used} used, {left_out} left out", None),
    ]
    if fit.emissivity_rms is not None:
        lines.append(("rms", f"{fit.emissivity_rms:.3f} in emissivity", None))
    place = 1.0
    for symbol, value, error in lines:
        place -= 0.085 if symbol else 0.055
        size, color = (10 if error else 9, INK) if symbol else (7.5, PALE)
        axes.text(0.0, place, symbol, fontsize=11 if error else 9, color=INK)
        axes.text(0.17, place, plain(value), fontsize=size, color=color)
        axes.text(0.45, place, error or "", fontsize=10, color=INK)


def draw_directional(axes, fit, quantity: str, data) -> None:
    """Draw the fitted emissivity 1 - HDR, or DHR, and the measured one with its deviations.

    `quantity` is "emissivity" or "dhr". `data` are the measurements, or None.
    """
    title, angle = TITLES[quantity]
    theta = np.linspace(0, 89, 179)
    axes.plot(theta, directional(fit, quantity, np.radians(theta)), "C3", lw=1.5, label="fitted")
    if quantity == "emissivity" and fit.emissivity_interval is not None:
        at, ends = np.degrees(fit.emissivity[0]), np.transpose(fit.emissivity_interval)
        axes.fill_between(at, *ends, color="C3", alpha=0.2, lw=0, label="95 % interval")
    if data is not None:
        points = {"fmt": "o", "ms": 3.5, "color": INK, "lw": 1, "capsize": 2, "label": "measured"}
        axes.errorbar(np.degrees(data.theta), data.value, data.std, **points)
    axes.legend()
    axes.set(ylim=(0, 1), xlim=(0, 90), xlabel=f"{ANGLES[angle]} (degrees)", ylabel=title)
    axes.grid(color="0.9", lw=0.6)
    axes.set_axisbelow(True)


def shades(count: int):
    """Colours for `count` curves, from dark to light."""
    from matplotlib import colormaps

    return colormaps["viridis"](np.linspace(0, 0.88, count))
