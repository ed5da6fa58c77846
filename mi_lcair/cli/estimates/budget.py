"""mi-lcair budget: how certain an intensity or a contrast is, and what that depends on."""

from functools import partial

import click

import mi_lcair
from mi_lcair.cli import completion, options
from mi_lcair.cli.output import time_row, write_and_print
from mi_lcair.errors import InputError


@options.command(
    "budget", "mi-lcair budget box.toml -u sigma.toml -D render.max_bounces=1 --spp 16"
)
@click.argument("what", shell_complete=completion.scenes_and_scenarios)
@options.option(
    "-u --uncertainties",
    "The uncertainties, FILE.toml: standard deviations, covariances, reports of fits.",
    options.FILE,
    required=True,
)
@options.option(
    "--of",
    "Of a scenario: contrast (default), apparent_temperature, detection_range, snr or netd.",
    metavar="RESULT",
)
@options.changes("Set a $-parameter of the scene, or an entry of the scenario")
@options.output("the budget, FILE.json, for show, report and convert", (".json",))
@options.plot("a tornado chart")
@options.file(
    "--image",
    "Write the image of a scene with the derivatives d.NAME.Y and the uncertainty sigma.Y of each "
    "pixel, FILE.exr.",
    (".exr",),
)
@options.option(
    "--monte-carlo draws",
    "Also compute the distribution of the result from this number of random draws.",
    options.POSITIVE,
)
@options.sampling(
    spp="Number of paths, divided by the number of pixels (default: that of the scene or the "
    "scenario).",
    tolerance="Trace paths until half of the 95 % interval of the result is at most this fraction "
    "of it. It is the error of the rendering alone.",
)
@options.seed()
@options.solution
@options.motions
@options.sensor
@options.workers
@options.renderer
def command(what, uncertainties, output, plot, image, draws, of, **settings):
    """Uncertainty budget of WHAT.

    WHAT is a Mitsuba XML file or the name of a bundled scene, or a TOML file or the name of a
    bundled contrast scenario. The result is the intensity of the scene's target in W/sr, or the
    contrast in W/m^2, or with --of another result of the scenario: a temperature in K, a range in
    m, or a signal-to-noise ratio. The command lists, in the same unit, what contributes to the
    standard uncertainty of the result, the largest share of the variance first. It checks the
    contributions that matter with renders at plus and minus one standard deviation.
    """
    from mi_lcair.api.budget import is_scenario
    from mi_lcair.uncertainty.uncertainties import Uncertainties

    stated = Uncertainties.read(uncertainties)
    sampling = options.given({name: settings[name] for name in ("spp", "tolerance")})
    measured = _scenario if is_scenario(what) else _scene
    subject, arguments = measured(what, sampling, image, **settings)
    with options.progress_bar("draws") as progress:
        result = mi_lcair.budget(
            subject, stated, draws=draws, of=of, progress=progress, **arguments
        )
    files = {
        output: result.save,
        plot: result.plot,
        image: partial(_write_image, subject, result, arguments),
    }
    write_and_print(result, files, [time_row(result)])


def _scenario(what, sampling, image, **settings):
    """The scenario, and the keyword arguments of `mi_lcair.budget` for it."""
    if image:
        raise InputError("--image needs a scene; a contrast is a single number")
    changes = dict(settings["changes"]) | options.given(sampling, "render.")
    changes |= options.given(
        {
            "render.seed": settings["seed"] or None,
            "target.solution": settings["solution"] or None,
            "target.parameters.motions": settings["motions"] and str(settings["motions"]),
        }
    )
    return options.read_scenario(what, changes), {"sensor": settings["sensor"]}


def _scene(what, sampling, image, **settings):
    """The scene, and the keyword arguments of `mi_lcair.budget` for it."""
    sampling |= {name: settings[name] for name in ("seed", "sensor")}
    common = {name: settings[name] for name in ("solution", "motions")}
    return options.SceneOptions(
        what, dict(settings["changes"]), sampling, **common
    ).load(), sampling


def _write_image(scene, result, arguments, path):
    """Write the image of a scene with its derivatives."""
    from mi_lcair.rendering.images.exr import write_exr
    from mi_lcair.rendering.sampling import Sampling
    from mi_lcair.uncertainty.image import budget_image

    numbers = {name: arguments[name] for name in ("sensor", "seed", "spp") if name in arguments}
    with options.progress_bar() as progress:
        sampling = Sampling(progress=progress, **numbers)
        write_exr(path, *budget_image(scene, result.inputs, sampling))
