"""Picture of an inversion: measured, predicted, residuals, correlations, and the iteration."""

from operator import attrgetter
from pathlib import Path

import numpy as np

from mi_lcair.drawing import new_figure, plain, styled
from mi_lcair.formats import RADIANCE
from mi_lcair.sections import typeset_unit
from mi_lcair.show.pictures.image_channels import limits_of

SIDE = 2.9  # width of a panel, inches
MOST_ROWS = 12  # data that are drawn
MOST_UNKNOWNS = 40  # unknowns up to which correlations are drawn
SQUARE = 0.24  # side of a correlation's square, inches
ITERATION_HEIGHT = 2.6  # height of the panels of the iteration, inches
LINEAR_TO = {"step_sigmas": 0.01, "chi_square": 1.0}  # values up to which the axis is linear
SIGMAS = 4.0  # end of the scale of residuals, standard deviations
TALLEST = 2.0  # largest ratio of a panel's height to its width


@styled
def figure(solution):
    """Figure with one row for each datum of a `Solution`, the first MOST_ROWS.

    An image has the panels measured, predicted and residual. Numbers and trends are drawn against
    their number or azimuth. Below them are how the unknowns came to their values, the correlations
    of their errors, and the iteration. A solution that was read from its file has no pixels of
    images.
    """
    data = [fitted for fitted in solution.data if fitted.measured is not None][:MOST_ROWS]
    heights = [_height(fitted) for fitted in data]
    count = len(solution.answers)
    if is_listed := count <= MOST_UNKNOWNS:
        heights.append(1.2 + SQUARE * max(count, 6))
    heights.append(ITERATION_HEIGHT)
    figure = new_figure((3 * SIDE + 1.6, sum(heights)), layout="constrained")
    parts = np.atleast_1d(figure.subfigures(len(heights), 1, height_ratios=heights))
    for part, fitted in zip(parts, data):
        words = fitted.name, fitted.scene, fitted.band, fitted.state
        part.suptitle(plain(", ".join(filter(None, words))))
        (_draw_image if fitted.is_image else _draw_numbers)(part, fitted)
    if is_listed:
        _draw_unknowns(parts[len(data)], solution)
    _draw_iteration(parts[-1], solution.trace)
    return figure


def _draw_unknowns(part, solution) -> None:
    """Distances of the unknowns from their values over the iteration, and correlations."""
    part.suptitle(plain(f"unknowns of {Path(solution.problem).name}"))
    distances, matrix = part.subplots(1, 2)
    labels = [plain(f"{k + 1} {answer.label}") for k, answer in enumerate(solution.answers)]
    steps = [(k + 1, step) for k, step in enumerate(solution.trace) if step.is_kept]
    for k, answer in enumerate(solution.answers):
        away = np.array([step.values[k] - answer.value for _, step in steps])
        away = away / (answer.standard_error or 1.0)
        distances.plot([number for number, _ in steps], away, f"o-C{k % 10}", markersize=3)
    distances.set_yscale("symlog", linthresh=1)
    distances.set(xlabel="values tried", ylabel="from the solution (standard errors)")
    distances.locator_params(axis="x", nbins=6, integer=True)
    drawn = matrix.imshow(solution.correlation, vmin=-1, vmax=1, cmap="RdBu_r")
    matrix.set_yticks(range(len(labels)), labels, fontsize=7)
    for k, text in enumerate(matrix.get_yticklabels()):
        text.set_color(f"C{k % 10}")  # that of the unknown's curve
    matrix.set_xticks(range(len(labels)), [str(k + 1) for k in range(len(labels))], fontsize=7)
    matrix.set_xlabel("number of the unknown")
    part.colorbar(drawn, ax=matrix, shrink=0.85, pad=0.02).set_label("correlation of the errors")


def _draw_iteration(part, trace) -> None:
    """What is left of the step, and chi-square, over the values that were tried."""
    last = max(trace, key=attrgetter("renders"), default=None)
    of_trace = f": renders of each datum {last.renders}, paths {last.paths:.3g}" if last else ""
    part.suptitle(f"iteration{of_trace}")
    left, chi_square = part.subplots(1, 2)
    numbered = list(enumerate(trace, 1))
    kept = [(number, step) for number, step in numbered if step.is_kept]
    refused = [(number, step) for number, step in numbered if not step.is_kept]
    for panel, name, label in (
        (left, "step_sigmas", "step to the solution (standard errors)"),
        (chi_square, "chi_square", "chi-square"),
    ):
        for steps, style, word in ((kept, "o-C0", "kept"), (refused, "xC3", "refused")):
            if not steps:
                continue
            numbers, values = zip(*((number, getattr(step, name)) for number, step in steps))
            panel.plot(numbers, values, style, markersize=4, label=word)
        panel.set_yscale("symlog", linthresh=LINEAR_TO[name])
        panel.set(xlabel="values tried", ylabel=label)
        panel.locator_params(axis="x", nbins=6, integer=True)
    if trace:
        chi_square.legend()


def _height(fitted) -> float:
    if not fitted.is_image:
        return 2.8
    height, width = fitted.measured.shape
    return SIDE * min(height / width, TALLEST) + 0.8


def _draw_image(part, fitted) -> None:
    """Three panels: measured and predicted with the same scale, and the residual."""
    measured, predicted, residual = part.subplots(1, 3)
    images = fitted.measured, fitted.predicted
    scale = limits_of([values[np.isfinite(values)] for values in images], log=False)
    for panel, image, title in (
        (measured, fitted.measured, "measured"),
        (predicted, fitted.predicted, "predicted"),
    ):
        drawn = panel.imshow(image, vmin=scale.lower, vmax=scale.upper, cmap="inferno")
        panel.set_title(title, fontsize=9)
    bar = part.colorbar(drawn, ax=[measured, predicted], shrink=0.85, extend=scale.extend, pad=0.01)
    is_radiance = fitted.quantity.startswith("radiance")
    bar.set_label(f"radiance ({typeset_unit(RADIANCE)})" if is_radiance else fitted.quantity)
    drawn = residual.imshow(fitted.residual, vmin=-SIGMAS, vmax=SIGMAS, cmap="RdBu_r")
    rms = np.sqrt(np.nanmean(fitted.residual**2))
    title = f"measured - predicted, rms {rms:.2f}"
    if fitted.bad_pixels:
        rows, columns = zip(*fitted.bad_pixels)
        residual.plot(columns, rows, "xk", markersize=4)
        title += f", x: {len(rows)} left out"
    residual.set_title(title, fontsize=8)
    of_residual = part.colorbar(drawn, ax=residual, shrink=0.85, extend="both", pad=0.02)
    of_residual.set_label("standard deviations")
    for panel in (measured, predicted, residual):
        panel.set(facecolor="0.6", xlabel="column (pixel)")
        panel.locator_params(nbins=4, integer=True)
    measured.set_ylabel("row (pixel)")


def _draw_numbers(part, fitted) -> None:
    """Measured and predicted numbers, and their differences in standard deviations."""
    values, residual = part.subplots(1, 2, width_ratios=(2, 1))
    x, label = np.arange(len(fitted.measured)), "number"
    if len({elevation for _, elevation in fitted.aspects}) == 1:
        x, label = np.array([azimuth for azimuth, _ in fitted.aspects]), "azimuth (degrees)"
    values.plot(x, fitted.measured, "o", color="C3", markersize=4, label="measured")
    values.plot(x, fitted.predicted, "x", color="black", markersize=5, label="predicted")
    values.set_ylabel(plain(fitted.quantity))
    values.legend()
    residual.axhline(0, color="black", linewidth=0.5)
    residual.plot(x, fitted.residual, "o", color="C0", markersize=4)
    residual.set_ylabel("measured - predicted (standard deviations)")
    for panel in (values, residual):
        panel.set_xlabel(label)
