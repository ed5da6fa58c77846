"""mi-lcair invert: unknown parameters of scenes from measurements."""

from pathlib import Path

import click

import mi_lcair
from mi_lcair.cli.options import json_option, prepare_renderer, progress_bar, renderer_options
from mi_lcair.cli.output import (
    check_outputs,
    note,
    print_columns,
    print_json,
    print_written,
)
from mi_lcair.cli.usage.examples import examples
from mi_lcair.drawing import PICTURES
from mi_lcair.files import together

MOST_ROWS = 40  # unknowns in the table; of more, the facets are summed up
MOST_LINES = 5  # sentences of advice


@click.command(
    "invert",
    epilog=examples(
        "mi-lcair render box/scene.xml -D azimuth_deg=30 -D elevation_deg=30 -D resolution=64 "
        "-o camera.exr",
        "mi-lcair invert problem.toml --no-advice -o solution.json",
    ),
)
@click.argument("problem", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    help="Write the solution, FILE.json. Commands with a SCENE take it with --solution.",
)
@click.option(
    "--plot",
    type=click.Path(path_type=Path),
    help="Draw measured, predicted and their difference in standard deviations, FILE.png, "
    ".svg or .pdf.",
)
@click.option("--no-advice", is_flag=True, help="Do not compute what to measure next.")
@renderer_options
@json_option
def command(problem, output, plot, no_advice, variant, threads, json):
    """Estimate unknown parameters from measurements.

    PROBLEM is a TOML file. It names the measurements with their scenes and their noise, and the
    unknowns: temperatures of groups or facets, parameters of materials, radiances. The command
    prints the values with their standard errors (temperatures in K, radiances in W m^-2 sr^-1),
    what the data do not determine, and which further measurement would help most. With [goal] in
    place of measurements, it looks for the values that give a wanted intensity or contrast.
    """
    check_outputs((output, ".json"), (plot, PICTURES))
    prepare_renderer(variant, threads)
    with progress_bar("renders") as progress:
        solution = mi_lcair.invert(problem, advise=not no_advice, progress=progress)
    for remark in solution.remarks:
        note(remark)
    with together():
        if plot:
            solution.plot(plot)
        if output:
            solution.write(output)
    if json:
        print_json(solution.as_dict())
    else:
        _print(solution)
    print_written(output, plot)


def _print(solution):
    """Print the fit, the unknowns, the directions that the data cannot tell apart, and advice."""
    print_columns(
        [
            ("problem", solution.problem),
            *(
                (fitted.name, f"{fitted.scene}, {fitted.band}{_state(fitted)}: {_residual(fitted)}")
                for fitted in solution.data
            ),
            *_chi_square(solution),
            ("renders", f"{solution.renders} of each, {solution.seconds:.2f} s"),
        ]
    )
    rows = [answer for answer in solution.answers if answer.is_sought]
    facets = [answer for answer in rows if answer.kind == "facet"]
    if len(rows) > MOST_ROWS:
        rows = [answer for answer in rows if answer.kind != "facet"]
    click.echo()
    print_columns([("unknown", "value", "standard error", "verdict"), *map(_row, rows)])
    if facets and not any(answer.kind == "facet" for answer in rows):
        click.echo()
        print_columns(_facets(facets))
    nuisance = [answer for answer in solution.answers if not answer.is_sought]
    if nuisance:
        click.echo()
        print_columns([("carried along", "value", "standard error", ""), *map(_row, nuisance)])
    for title, lines in (
        ("the data cannot tell apart", [direction.words for direction in solution.directions]),
        ("what would help", [advice.words for advice in solution.advice]),
    ):
        if lines:
            click.echo()
            click.echo(f"{title}:")
            for line in lines[:MOST_LINES]:
                click.echo(f"  {line}")


def _row(answer):
    """Cells of the table of unknowns."""
    unit = answer.unit.removesuffix("1")
    digits = f"{answer.value:.7g}" if answer.unit == "K" else f"{answer.value:.5g}"
    return answer.label, f"{digits} {unit}".rstrip(), f"{answer.standard_error:.2g}", answer.verdict


def _facets(facets):
    """Rows that sum up many facets: number, temperatures and errors by verdict."""
    by_verdict = {}
    for answer in facets:
        by_verdict.setdefault(answer.verdict.partition(":")[0], []).append(answer)
    yield "facets", "number", "temperatures", "standard errors"
    for verdict, own in by_verdict.items():
        values, errors = ([getattr(a, key) for a in own] for key in ("value", "standard_error"))
        yield (
            verdict,
            len(own),
            f"{min(values):.5g} to {max(values):.5g} K",
            f"{min(errors):.2g} to {max(errors):.2g} K",
        )


def _state(fitted):
    return f", {fitted.state}" if fitted.state else ""


def _residual(fitted):
    rms = fitted.as_dict()["residual_rms_sigmas"]
    size = fitted.residual.size
    count = f"{fitted.points} of {size} values" if fitted.points < size else f"{size} values"
    return f"{count}, rms residual {rms:.3g} standard deviations of measurement and render together"


def _chi_square(solution):
    """Row about chi-square; none without degrees of freedom."""
    if solution.p_value is not None:
        yield (
            "chi-square",
            f"{solution.chi_square:.5g} for {solution.degrees_of_freedom:.5g} degrees of freedom "
            f"in the measurement's noise alone, p = {solution.p_value:.2g}",
        )
