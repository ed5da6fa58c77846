"""Commands that state how certain a result is, and what it depends on."""

from functools import partial

import click

import mi_lcair
from mi_lcair.cli import completion, options
from mi_lcair.cli.output import print_written, write_and_print
from mi_lcair.drawing import PICTURES
from mi_lcair.errors import InputError
from mi_lcair.files import FACET_FILES

# mi-lcair audit: check whether a scene conserves energy
# ------------------------------------------------------


@options.command("audit", "mi-lcair audit open_box --paths 4096")
@options.loading
@options.calls("audit", paths={"type": options.WholeNumber(min=8)})
@options.file("--facets", "Write irradiance and exitance of each facet, FILE.csv.", (".csv",))
def audit_command(facets, result):
    """Follow the flux that SCENE emits.

    SCENE is a Mitsuba XML file or the name of a bundled scene. The command follows photons from the
    emitters until they are absorbed or escape. It prints their flux for each material, in W and in
    percent.
    """
    if facets:
        from mi_lcair import formats

        formats.write_csv(facets, result.facets)
        print_written(facets)


# mi-lcair budget: how certain an intensity or a contrast is, and what that depends on
# ------------------------------------------------------------------------------------


@options.command("budget", "mi-lcair budget box.toml -u sigma.toml -o tornado.png")
@click.argument("what", shell_complete=completion.scenes_and_scenarios)
@options.changes("Set a $-parameter of the scene, or an entry of the scenario")
@options.outputs(
    "the budget for show, report and convert, or draw a tornado chart", ".json", *PICTURES
)
@options.file(
    "--image",
    "Write the image of a scene with the derivatives d.NAME.Y and the uncertainty sigma.Y of each "
    "pixel, FILE.exr.",
    (".exr",),
)
@options.sampling(
    "budget",
    uncertainties={"flag": "-u --uncertainties", "type": options.FILE},
    of={"metavar": "RESULT"},
    draws={"flag": "--monte-carlo"},
)
@options.solution
@options.motions
@options.workers
@options.renderer
def budget_command(what, uncertainties, outputs, image, draws, of, **settings):
    """Compute the uncertainty budget of WHAT.

    WHAT is a Mitsuba XML file or the name of a bundled scene, or a TOML file or the name of a
    bundled contrast scenario. The result is the intensity of the scene's target in W/sr, or the
    contrast of the scenario in W/m^2. --of selects another result of the scenario: a temperature in
    K, a range in m, or a signal-to-noise ratio. The command lists, in the unit of the result, the
    contributions to its standard uncertainty. The largest share of the variance comes first. The
    command checks the contributions that matter with renders at plus and minus one standard
    deviation.
    """
    from mi_lcair.api.estimates import is_scenario
    from mi_lcair.knowing.budgets.uncertainties import Uncertainties

    stated = Uncertainties.read(uncertainties)
    sampling = options.given({name: settings[name] for name in ("spp", "tolerance")})
    measured = _scenario if is_scenario(what) else _scene
    subject, arguments = measured(what, sampling, image, **settings)
    with options.progress_bar("draws") as progress:
        result = mi_lcair.budget(
            subject, stated, draws=draws, of=of, progress=progress, **arguments
        )
    files = dict.fromkeys(outputs, result.save)
    write_and_print(result, files | {image: partial(_write_image, subject, result, arguments)})


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
    return options.SceneOptions(what, dict(settings["changes"]), **common).load(), sampling


def _write_image(scene, result, arguments, path):
    """Write the image of a scene with its derivatives."""
    from mi_lcair.knowing.budgets.budget import budget_image
    from mi_lcair.rendering.images.files import write_exr
    from mi_lcair.rendering.sampling import Sampling

    numbers = {name: arguments[name] for name in ("sensor", "seed", "spp") if name in arguments}
    with options.progress_bar() as progress:
        sampling = Sampling(progress=progress, **numbers)
        write_exr(path, *budget_image(scene, result.inputs, sampling))


# mi-lcair invert: unknown parameters of scenes from measurements
# ---------------------------------------------------------------


@options.command(
    "invert",
    "mi-lcair render box/scene.xml -D azimuth_deg=30 -D elevation_deg=30 -D resolution=64 "
    "--seed 1 -o camera.exr",
    "mi-lcair invert problem.toml -o solution.json -o residual.png",
)
@click.argument("problem", type=options.FILE)
@options.outputs(
    "the solution, for --solution of commands with a SCENE, or draw measured, predicted and their "
    "difference in standard deviations",
    ".json",
    ".toml",
    *PICTURES,
)
@options.workers
@options.renderer
@options.calls(
    "invert",
    unit="renders",
    advise={
        "flag": "--no-advice",
        "flag_value": False,
        "show_default": False,
        "help": "Do not compute what to measure next.",
    },
)
def invert_command():
    """Estimate unknown parameters from measurements.

    PROBLEM is a TOML file. It names the measurements with their scenes and their noise, and the
    unknowns: temperatures of groups or facets, parameters of materials, radiances. The command
    prints the values with their standard errors (temperatures in K, radiances in W m^-2 sr^-1). It
    says which unknowns the data do not determine, and which further measurement would help most.
    With [goal] in place of measurements, it looks for the values that give a wanted intensity or
    contrast. With [heat] it estimates unknown properties of ground and air from temperatures
    measured over time. FILE.toml is then the heat.toml with the estimated values.
    """


# mi-lcair sensitivities: how much an intensity depends on parameters
# -------------------------------------------------------------------


@options.command(
    "sensitivities",
    "mi-lcair sensitivities box/scene.xml lid.temperature self.temperature",
)
@options.loading
@click.argument("names", nargs=-1, required=True, metavar="NAME...")
@options.outputs("the derivatives", ".csv", ".json", ".html")
@options.calls("sensitivities", "part", part={"type": click.Choice(["target", "scene"])})
def sensitivities_command():
    """Derivatives of the intensity of SCENE.

    SCENE is a Mitsuba XML file or the name of a bundled scene with an orthographic sensor. Each
    NAME is a parameter that `mi-lcair parameters SCENE` lists. The command prints the intensity in
    W/sr, and its derivative with respect to each parameter in W/sr per unit of the parameter, with
    standard errors.
    """


# mi-lcair shape-derivatives: which part of a surface to move
# -----------------------------------------------------------


@options.command(
    "shape-derivatives",
    "mi-lcair shape-derivatives cylinder_ir_range -D resolution=32 --group self --spp 32 "
    "-o shape.png",
)
@options.loading
@options.outputs(
    "or draw the derivatives by facet", ".csv", ".json", ".html", *FACET_FILES, *PICTURES
)
@options.calls("shape_derivatives", "group")
def shape_derivatives_command():
    """Show where moving a surface changes the intensity.

    SCENE is a Mitsuba XML file or the name of a bundled scene with an orthographic sensor. Each
    facet is displaced outward. The command prints the derivative of the target's intensity in W/sr
    with respect to the displacement, per m and per m^2 of the facet, and the change if the whole
    surface moves.
    """
