"""mi-lcair budget: how certain an intensity or a contrast is, and what that depends on."""

from pathlib import Path

import click

import mi_lcair
from mi_lcair.cli.options import (
    POSITIVE,
    changes_option,
    json_option,
    plot_option,
    prepare_renderer,
    progress_bar,
    renderer_options,
    sampling_options,
    seed_option,
    sensor_option,
    solution_option,
)
from mi_lcair.cli.output import (
    check_outputs,
    note,
    print_columns,
    print_json,
    print_written,
)
from mi_lcair.cli.usage import completion
from mi_lcair.cli.usage.examples import examples
from mi_lcair.drawing import PICTURES
from mi_lcair.errors import InputError
from mi_lcair.files import together
from mi_lcair.fraction import percent


@click.command(
    "budget",
    epilog=examples(
        "mi-lcair budget box.toml -u sigma.toml -D render.max_bounces=1 --spp 16",
    ),
)
@click.argument("what", shell_complete=completion.scenes_and_scenarios)
@click.option(
    "-u",
    "--uncertainties",
    type=click.Path(path_type=Path),
    required=True,
    help="The uncertainties, FILE.toml: standard deviations, covariances, reports of fits.",
)
@changes_option("Set a $-parameter of the scene, or an entry of the scenario")
@plot_option("Draw a tornado chart, FILE.png, .svg or .pdf.")
@click.option(
    "--image",
    type=click.Path(path_type=Path),
    help="Write the image of a scene with the derivatives d.NAME.Y and the uncertainty sigma.Y of "
    "each pixel, FILE.exr.",
)
@click.option(
    "--monte-carlo",
    "draws",
    type=POSITIVE,
    help="Also compute the distribution of the result from this number of random draws.",
)
@sampling_options(
    spp="Number of paths, divided by the number of pixels (default: that of the scene or the "
    "scenario).",
    tolerance="Trace paths until half of the 95 % interval of the result is at most this fraction "
    "of it. It is the error of the rendering alone.",
)
@seed_option()
@solution_option
@sensor_option
@renderer_options
@json_option
def command(
    what,
    uncertainties,
    changes,
    plot,
    image,
    draws,
    spp,
    tolerance,
    seed,
    sensor,
    solution,
    **common,
):
    """Uncertainty budget of WHAT.

    WHAT is a Mitsuba XML file or the name of a bundled scene, or a TOML file or the name of a
    bundled contrast scenario. The result is the intensity of the scene's target in W/sr, or the
    contrast in W/m^2. The command lists, in the same unit, what contributes to the standard
    uncertainty of the result, the largest share of the variance first. It checks the contributions
    that matter with renders at plus and minus one standard deviation.
    """
    from mi_lcair.uncertainty.uncertainties import Uncertainties

    check_outputs((plot, PICTURES), (image, ".exr"))
    stated = Uncertainties.read(uncertainties)
    sampling = {"spp": spp, "tolerance": tolerance}
    sampling = {name: value for name, value in sampling.items() if value is not None}
    subject, arguments = _subject(
        what, dict(changes), sampling, seed, sensor, image, solution, common
    )
    with progress_bar("draws") as progress:
        result = mi_lcair.budget(subject, stated, draws=draws, progress=progress, **arguments)
    for remark in result.remarks:
        note(remark)
    with together():
        if image:
            _write_image(image, subject, result, arguments)
        if plot:
            result.plot(plot)
    if common["json"]:
        print_json(result.as_dict())
    else:
        _print_tables(result)
    print_written(plot, image)


def _subject(what, changes, sampling, seed, sensor, image, solution, common):
    """The scene or scenario, and the keyword arguments of `mi_lcair.budget` for it."""
    from mi_lcair.uncertainty.budget import is_scenario

    if is_scenario(what):
        from mi_lcair.detection.scenario import Scenario

        if image:
            raise InputError("--image needs a scene; a contrast is a single number")
        if sensor:
            raise InputError("--sensor is one of a scene; a scenario has its observer")
        own = {f"render.{name}": value for name, value in sampling.items()}
        own |= {"render.seed": seed} if seed else {}
        own |= {"target.solution": solution} if solution else {}
        scenario = Scenario.read(what, **changes | own)
        prepare_renderer(common["variant"], common["threads"])
        return scenario, {}
    prepare_renderer(common["variant"], common["threads"])
    scene = mi_lcair.load(what, **changes)
    if solution:
        from mi_lcair.sensitivity.solution_file import apply_solution

        note(f"{solution}: sets {', '.join(apply_solution(scene, solution))}")
    for remark in scene.remarks:
        note(remark)
    return scene, {**sampling, "seed": seed, "sensor": sensor}


def _write_image(path, scene, result, arguments):
    """Write the image of a scene with its derivatives."""
    from mi_lcair.rendering.image import write_exr
    from mi_lcair.uncertainty.image import budget_image

    own = {name: arguments[name] for name in ("sensor", "seed", "spp") if name in arguments}
    with progress_bar("pixels") as progress:
        write_exr(path, *budget_image(scene, result.inputs, progress=progress, **own))


def _print_tables(result):
    """Print the result and its uncertainty, the rows, and what renders say about them."""
    relative = f" ({percent(result.sigma / abs(result.value))})" if result.value else ""
    lines = [
        (result.title, f"{result.value:.6g} +- {result.sigma:.3g} {result.unit}{relative}"),
        ("expanded", f"+- {2 * result.sigma:.3g} {result.unit} (k = 2, about 95 %)"),
    ]
    mc = result.monte_carlo
    if mc is not None:
        low, high = mc.interval
        lines.append(
            (
                "monte carlo",
                f"{mc.mean:.6g} +- {mc.sigma:.3g} {result.unit} (itself +- {mc.sigma_error:.2g}) "
                f"from {mc.draws} draws, 95 % in {low:.5g}..{high:.5g}; linear, of the quantities "
                f"alone: {result.sigma_of_quantities:.3g}",
            )
        )
    lines += [
        ("time", f"{result.seconds:.2f} s"),
        ("renders", f"{result.renders} of {result.paths} paths"),
    ]
    print_columns(lines)
    click.echo()
    head = ("quantity", "value", "sigma", "sensitivity", f"contribution {result.unit}", "share")
    table = [head]
    for row in result.rows:
        table.append(_cells(row, f"{100 * row.share:.2f} %"))
        table += [_cells(member, "", indent="  ") for member in row.members]
    print_columns(table)
    if result.checks:
        click.echo()
        print_columns(
            [
                ("rendered at", "derivative", "plus sigma", "minus sigma", "linear"),
                *(
                    (
                        check.quantity,
                        f"+-{abs(check.linear):.4g}",
                        *(_change(change) for change in (check.plus, check.minus)),
                        "holds" if check.holds else "FAILS",
                    )
                    for check in result.checks
                ),
            ]
        )


def _cells(row, share, indent=""):
    """Cells of a row of the budget."""
    number = lambda value, form="{:.5g}": "" if value is None else form.format(value)
    unit = "" if row.unit in ("", "1") else f" {row.unit}"
    slope = number(row.sensitivity)
    if row.sensitivity_error is not None and row.sensitivity_error >= 1e-3 * abs(row.sensitivity):
        slope += f" +- {row.sensitivity_error:.1g}"
    return (
        f"{indent}{row.quantity}",
        number(row.value) + (unit if row.value is not None else ""),
        number(row.sigma, "{:.3g}"),
        slope,
        f"{row.contribution:+.4g}" if row.value is not None else f"{row.contribution:.4g}",
        share,
    )


def _change(change):
    return "outside its bounds" if change is None else f"{change:+.4g}"
