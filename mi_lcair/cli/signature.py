"""mi-lcair signature: intensity of a scene in W/sr."""

from pathlib import Path

import click

import mi_lcair
from mi_lcair.cli.options import scene_options
from mi_lcair.cli.output import (
    Verdict,
    check_outputs,
    interval,
    note_invalid,
    print_columns,
    print_json,
    print_written,
)
from mi_lcair.cli.plan import rows as plan_rows
from mi_lcair.cli.usage.examples import examples
from mi_lcair.drawing import PICTURES
from mi_lcair.errors import InputError
from mi_lcair.files import together
from mi_lcair.formats import VTK


@click.command(
    "signature",
    epilog=examples(
        "mi-lcair signature cylinder_ir_range --spp 16",
        "mi-lcair signature box/scene.xml --tolerance 1% --facets facets.csv --spectrum s.csv",
    ),
)
@scene_options(
    spp="Number of paths, divided by the number of pixels of the film (default: the scene's own). "
    "The paths begin anywhere on the film.",
    tolerance="Trace paths until half of the 95 % interval of the target's intensity is at most "
    "this fraction of it, such as 0.01 or 1%.",
)
@click.option(
    "--spectrum",
    type=click.Path(path_type=Path),
    help="Write the spectral intensity, FILE.csv or FILE.nc (netCDF).",
)
@click.option(
    "--plot",
    type=click.Path(path_type=Path),
    help="With --spectrum: also draw the spectral intensity, FILE.png, .svg or .pdf.",
)
@click.option(
    "--facets",
    type=click.Path(path_type=Path),
    help="Write radiance and intensity of each facet of the model, FILE.csv; or the facets with "
    "them for ParaView, FILE.vtp or FILE.vtu.",
)
def command(options, spectrum, plot, facets):
    """Intensity of SCENE in W/sr.

    SCENE is a Mitsuba XML file or the name of a bundled scene with an orthographic sensor. Printed
    is the intensity in W/sr of the target (the model's facets) and of the whole scene: by number of
    reflections, by the group that emits, and by the group that the sensor sees first. Written on
    request are the spectral intensity in W/sr/um, and for each facet its temperature in K, radiance
    in W m^-2 sr^-1 and intensity in W/sr.
    """
    if plot and not spectrum:
        raise InputError("--plot draws the spectral intensity; give --spectrum FILE.csv too")
    if spectrum and spectrum == facets:
        raise InputError(f"--spectrum and --facets both name '{spectrum}'; give each its own file")
    check_outputs((spectrum, (".csv", ".nc")), (plot, PICTURES), (facets, (".csv", *VTK)))

    result = options.run_planned(
        mi_lcair.signature, each_pixel=False, by_spectrum=bool(spectrum), facets=bool(facets)
    )
    note_invalid(result)
    with together():
        if spectrum:
            result.effective_areas.save(spectrum)
            if plot:
                result.effective_areas.plot(plot)
        if facets:
            result.facets.save(facets)
    verdict = Verdict.on(options, result.reached)
    if options.json:
        print_json(result.as_dict() | verdict.as_dict() | options.planned())
    else:
        error = interval(
            result.half_width, result.intensity, "W/sr", f"the {result.main_part}'s intensity"
        )
        _print_tables(result, verdict.row(error))
        if options.plan:
            click.echo()
            print_columns([("plan", ""), *plan_rows(options.plan)])
    print_written(spectrum, plot, facets)


def _print_tables(result, error):
    """Print the intensities of target and scene, their error, and tables of their parts."""
    target, scene = result.target, result.scene
    print_columns(
        [
            ("band", result.band),
            *(
                (name, f"{part.intensity:.6g} W/sr +- {part.half_width:.2g} (95 %)")
                for name, part in (("target", target), ("scene", scene))
            ),
            error,
            ("time", f"{result.seconds:.2f} s"),
            ("paths", result.paths),
        ]
    )
    bounces = zip(target.by_bounce, target.up_to_bounce, scene.by_bounce, scene.up_to_bounce)
    click.echo()
    print_columns(
        [
            ("reflections", "target W/sr", "up to these", "scene W/sr", "up to these"),
            *((str(k), *(f"{value:.6g}" for value in row)) for k, row in enumerate(bounces)),
        ]
    )
    for title, kind in (("emitted by", "by_group"), ("seen first", "by_seen")):
        click.echo()
        print_columns(
            [
                (title, "target W/sr", "scene W/sr"),
                *(
                    (name, *(_with_error(part, kind, name) for part in (target, scene)))
                    for name in getattr(scene, kind)
                ),
            ]
        )


def _with_error(part, kind, name):
    """A part of an intensity with its standard error; `kind` is "by_group" or "by_seen"."""
    value, error = (getattr(part, key)[name] for key in (kind, f"{kind}_error"))
    return f"{value:.6g} +- {error:.2g}"
