"""Commands about scenes, models and materials."""

from dataclasses import asdict
from functools import partial
from itertools import zip_longest
from pathlib import Path

import click

import mi_lcair
from mi_lcair.cli import completion, options
from mi_lcair.cli.output import (
    JSON,
    is_set,
    note,
    print_columns,
    print_json,
    print_result,
    print_sections,
    print_written,
)
from mi_lcair.drawing import PICTURES
from mi_lcair.errors import InputError
from mi_lcair.files import together, write_bytes
from mi_lcair.physics.reflection import NAMES
from mi_lcair.scenes import USD

# mi-lcair scenes: list the bundled scenes
# ----------------------------------------


@options.command("scenes", "mi-lcair scenes", "mi-lcair scenes --json")
@options.json
def scenes_command():
    """List the bundled scenes.

    The command prints the parameters of each scene with their defaults, meanings and units, and the
    scenarios of the scene.
    """
    from mi_lcair import scenes

    if is_set(JSON):
        print_json(
            {
                name: {
                    "title": scenes.title(name),
                    "path": str(scenes.path(name)),
                    "parameters": {
                        key: parameter._asdict()
                        for key, parameter in scenes.parameters(name).items()
                    },
                    "scenarios": {
                        scenario: scenes.scenario_title(scenario)
                        for scenario in scenes.scenarios(name)
                    },
                }
                for name in scenes.names()
            }
        )
        return
    for number, name in enumerate(scenes.names()):
        click.echo("\n" * bool(number) + f"{name}: {scenes.title(name)}")
        print_columns(
            [
                (f"    {key}={parameter.default}", parameter.description)
                for key, parameter in scenes.parameters(name).items()
            ]
        )
        for scenario in scenes.scenarios(name):
            click.echo(f"    scenario {scenario}: {scenes.scenario_title(scenario)}")


# mi-lcair parameters: what of a scene can be changed
# ---------------------------------------------------


@options.command("parameters", "mi-lcair parameters box/scene.xml")
@options.loading
def parameters_command(scene):
    """List the parameters of SCENE.

    SCENE is a Mitsuba XML file or the name of a bundled scene. The command prints the name of each
    parameter, its kind, its value with its unit, the limits of its value, and the standard
    deviation if its material has one. Use the names in -D, budget, invert and sensitivities.
    """
    known = mi_lcair.parameters(scene.load())
    if is_set(JSON):
        print_json({name: asdict(parameter) for name, parameter in known.items()})
        return None
    heading = ("name", "kind", "value", "unit", "lower", "upper", "sigma")
    numbers = (
        [p.name, p.kind, f"{p.value:.6g}", p.unit, f"{p.lower:.6g}", f"{p.upper:.6g}"]
        + [f"{p.sigma:.3g}" if p.sigma else ""]
        for p in known.values()
    )
    print_columns([heading, *numbers])
    return {"first": next(iter(known), None)}


# mi-lcair materials: list the known materials
# --------------------------------------------


@options.command("materials", "mi-lcair materials", "mi-lcair materials own.toml --json")
@click.argument("files", nargs=-1, type=click.Path(path_type=Path), metavar="[FILE|FOLDER]...")
@options.json
def materials_command(files):
    """List the known materials.

    For each material the command prints the name, the reflection model, the band in um, the
    emissivity along the normal and at 60 degrees to it, and the source of its parameters. A FILE of
    your own materials (TOML, or the JSON of a fit) and all TOML files with materials in a FOLDER
    come first. Labels of surfaces, such as steel+paint, follow with their emissivity and its sigma.
    A number in place of a name, such as 0.92, is the emissivity of a grey diffuse surface.
    """
    known = mi_lcair.materials(*files)
    print_result(known)
    own = ["--materials", files[0]] if files else []
    return {"first": known.listed[0].name, "band": known.listed[0].band, "own": own}


# mi-lcair import: convert a model of a modelling program to meshes and a scene
# -----------------------------------------------------------------------------

FIRST, MOST_SPP = 0.02, 128  # tolerance and most paths per pixel of the first intensity of a model
AXIS = click.Choice(["X", "Y", "Z", "-X", "-Y", "-Z"])


@options.command(
    "import",
    "mi-lcair import box.obj -o box",
    "mi-lcair import box.obj --check",
    "mi-lcair import drone.obj --names drone.csv --forward -Z --up Y -o drone",
)
@click.argument("file", type=options.FILE, metavar="MODEL")
@options.output(
    "meshes, model.xml, scene.xml, a copy of your own materials and the picture model.png to "
    "FOLDER",
    metavar="FOLDER",
)
@options.option("--check", "Only report; write nothing.", is_flag=True)
@options.option(
    "--overwrite", "Replace files in FOLDER that were edited since the last import.", is_flag=True
)
@options.of(
    "mi_lcair.models3d.model:read",
    forward={"type": AXIS},
    up={"type": AXIS},
    nose={"type": AXIS},
    names={"type": options.FILE, "metavar": "CSV"},
    temperature={"metavar": "K"},
    temperatures={"type": options.FILE, "metavar": "CSV|VTU|JSON"},
    material={"metavar": "NAME|NUMBER|JSON", "shell_complete": completion.materials},
    materials={"type": options.FILE, "metavar": "TOML|JSON"},
    scale={},
    guess={},
)
@options.of(
    "mi_lcair.physics.surroundings:Words",
    sky={"metavar": "clear|overcast|KELVIN|TABLE"},
    ground={"metavar": "KELVIN[,EMISSIVITY|MATERIAL]"},
    sun={"metavar": "ELEVATION[,AZIMUTH[,FILE]]"},
    atmosphere={"metavar": "NAME"},
)
@options.option(
    "--band",
    "Also print the intensity of the model in this band, toward the scene's sensor.",
    metavar="MWIR|LWIR|A-B",
)
@options.of(
    "mi_lcair.rendering.conversion:thermal_scene",
    emissivity={"multiple": True, "metavar": "[NAME=]NUMBER", "show_default": False},
)
@options.changes(
    "Set a $-parameter of a Mitsuba scene, such as spp=16, or select a variant of a USD file",
    "parameters",
)
@options.json
@click.pass_context
def import_command(ctx, file, output, check, overwrite, materials, band, **settings):
    """Import a facet model or a scene of Mitsuba.

    MODEL is a Wavefront OBJ, glTF (.glb, .gltf), PLY or STL file whose objects or groups are named
    {f|s|t}*{material}*{kelvin}*{anything}, such as f*bare_aluminum*300*. The first letter stands
    for model (f), sky (s) or terrain (t). A USD file has attributes such as thermal:material and
    thermal:kelvin instead. For a model without labels and attributes, give --material and
    --temperature, or a table --names. The command writes the meshes, in m and with the temperature
    of each facet in K, and a picture. Look at FOLDER/model.png: the nose must be at +x and the top
    at +z. Then use FOLDER/scene.xml in render and signature.

    MODEL may also be a Mitsuba scene, MODEL.xml. --temperature turns it into a thermal scene: all
    its shapes emit.
    """
    if band:
        from mi_lcair.physics import bands

        bands.band(band)  # raises InputError, before anything is written
    if file.suffix.lower() == ".xml":
        _import_scene(ctx, file, output, band or "LWIR", settings)
        return {"thermal": output}
    if settings.pop("emissivity"):
        raise click.UsageError("--emissivity needs a scene of Mitsuba, MODEL.xml", ctx)
    if (variants := dict(settings.pop("parameters"))) and file.suffix.lower() not in USD:
        raise click.UsageError("-D needs a scene of Mitsuba, MODEL.xml, or a USD file", ctx)
    if bool(output) == check:
        raise click.UsageError("give either -o FOLDER or --check", click.get_current_context())
    words = {name: settings.pop(name) for name in ("sky", "ground", "sun", "atmosphere")}
    written = [(f"--{name}", word) for name, word in words.items()]
    for option, given in (*written, ("--overwrite", overwrite), ("--band", band)):
        if check and given:
            raise click.UsageError(
                f"{option} goes into what -o FOLDER writes; --check writes nothing",
                click.get_current_context(),
            )
    from mi_lcair import models3d

    model = models3d.read(file, materials=materials, variants=variants, **settings)
    files = _write(model, output, materials, words, overwrite) if output else []
    rows, more = [], {"files": files}
    if band:
        # A model without light, such as a plate seen edge-on, would take all paths
        most = {"tolerance": FIRST, "max_spp": MOST_SPP}
        first = mi_lcair.signature(output, **most, parameters={"band": band})
        rows.append(("intensity", first.summary()))
        more["signature"] = first.as_dict()
    if output:
        rows.append(("written to", f"{output}, {len(files)} files"))
    print_result(model, rows, more, materials=materials)
    return {"model": output}


def _import_scene(ctx, file, output, band, settings) -> None:
    """Write a thermal version of a scene that was written for Mitsuba."""
    taken = ("temperature", "emissivity", "parameters")
    options.check_given(ctx, ("file", "output", "band", "overwrite", *taken), "a scene of Mitsuba")
    temperature, *others = (settings[name] for name in taken)
    if output is None or temperature is None:
        raise click.UsageError("a scene of Mitsuba needs -o FOLDER and --temperature K", ctx)
    from mi_lcair.rendering.conversion import thermal_scene

    for remark in thermal_scene(
        file, output, temperature, band, *others, overwrite=ctx.params["overwrite"]
    ):
        note(remark)
    print_written(output / "scene.xml")


def _write(model, output, materials, words, overwrite):
    """Write a model and its picture into a folder; returns the paths.

    words: those of the surroundings.
    """
    from mi_lcair import models3d
    from mi_lcair.physics.surroundings import Words
    from mi_lcair.show.pictures.model import TITLE, png

    picture = {"model.png": partial(png, model, f"{output.resolve().name}: {TITLE}")}
    given, sky, around = {name: word for name, word in words.items() if word}, None, None
    if given.keys() == {"sky"} and any(label.elevation_deg is not None for label in model.labels):
        sky = words["sky"]
    elif given:
        around = Words(**given)
    paths = models3d.export(model, output, materials, sky, overwrite, picture, around)
    return [str(path) for path in paths]


# mi-lcair fit: fit a reflection model to scatterometer files
# -----------------------------------------------------------


def known_form(ctx, param, value):
    """The form, if any model has it; the models are loaded for a form that is given alone."""
    if value != "auto":
        from mi_lcair.physics.reflection.models import MODELS

        forms = dict.fromkeys(form for model in MODELS.values() for form in model.forms)
        if value not in forms:
            raise click.BadParameter(f"'{value}' is not one of auto, {', '.join(forms)}")
    return value


@options.command(
    "fit", "mi-lcair fit paint.csv --model microfacet --starts 8 -o paint.json -o paint.png"
)
@click.argument("files", nargs=-1, required=True, type=options.FILE, metavar="DATA...")
@options.outputs(
    "the report, which is a material for scenes, or draw data, fitted curves and parameters",
    ".json",
    *PICTURES,
)
@options.option(
    "--band bands",
    "Band of the measurement: 3-5 (um), MWIR, 10.6 for a laser, or the CSV of a response; one for "
    "each DATA "
    "(default: band_um in the file).",
    multiple=True,
    metavar="BAND",
)
@options.option(
    "--emissivity emissivities",
    "Measured emissivity, fitted together with the BRDF; one file for each DATA.",
    options.FILE,
    multiple=True,
)
@options.option(
    "--dhr dhrs",
    "Measured directional-hemispherical reflectance, fitted together with the BRDF; one file for "
    "each DATA.",
    options.FILE,
    multiple=True,
)
@options.of(
    "fit",
    *("quantity", "theta_r_positive", "model", "form", "loss", "robust", "starts", "seed"),
    *("max_angle_deg", "min_brdf", "source_half_angle_deg", "calibration"),
    model={"type": click.Choice(["auto", *NAMES])},
    form={"callback": known_form},
    max_angle_deg={"type": click.FloatRange(0, 90, min_open=True)},
    min_brdf={"type": click.FloatRange(0)},
    source_half_angle_deg={"type": click.FloatRange(0, 90, max_open=True)},
)
@options.json
def fit_command(files, outputs, bands, **settings):
    """Fit a reflection model to measured BRDFs.

    DATA are CSV, ASTM E1392/E2387, Zemax, LightTools or MERL files with in-plane measurements of
    one surface in 1/sr, one file for each band. FILE.json is a material for scenes. The command
    prints and writes the parameters (without unit) with their errors, and how well each is known.
    It says whether the model describes the data: misfit in decades, reduced chi-square, correlation
    of the residuals.
    """
    from mi_lcair.fitting import report
    from mi_lcair.fitting.scatterometer import reading

    _check_count("--band", bands, files)
    companions = _companions(files, settings.pop("emissivities"), settings.pop("dhrs"))
    quantity, side = settings.pop("quantity"), settings.pop("theta_r_positive")
    measurements = [
        reading.read(file, quantity, side, band) for file, band in zip_longest(files, bands)
    ]
    report.check_bands(measurements)
    for file, data in zip(files, measurements):
        if data.reading["not_read"]:
            note(f"{file}: not read: {', '.join(map(repr, data.reading['not_read']))}")
    joint = [
        {kind: reading.read_directional(file, kind) for kind, file in of_file.items() if file}
        for of_file in companions
    ]

    from mi_lcair.fitting.estimation import fit

    with options.progress_bar("step") as progress:
        fits = [
            fit(data, **directional, **settings, progress=progress)
            for data, directional in zip(measurements, joint)
        ]
    content = report.as_dict(fits)
    with together():
        for output in outputs:
            if output.suffix.lower() in PICTURES:
                from mi_lcair.show.pictures.fit import save_plot

                save_plot(output, list(zip(measurements, fits, joint)))
            else:
                write_bytes(output, report.to_json(content).encode())

    for data, fitted in zip(measurements, fits):
        if fitted.quality.lack_of_fit:
            note(f"{data.source[0]['file']}: {fitted.quality.verdict}")
    if is_set(JSON):
        timing = [{"seconds": f.seconds, "compile_seconds": f.compile_seconds} for f in fits]
        print_json({**content, "timing": timing})
    else:
        for number, fitted in enumerate(fits):
            if number:
                click.echo()
            compiled = f"{fitted.compile_seconds:.2f} s to compile"
            time = ("time", f"{fitted.seconds:.2f} s, of which {compiled}")
            print_sections(fitted.sections(), [time])
    print_written(*outputs)
    return {"measured": content.get("band")}


def _companions(files, emissivities, dhrs):
    """Files of emissivity and DHR of each data file, as {quantity: file or None}."""
    _check_count("--emissivity", emissivities, files)
    _check_count("--dhr", dhrs, files)
    return [
        {"emissivity": emissivity, "dhr": dhr}
        for _, emissivity, dhr in zip_longest(files, emissivities, dhrs)
    ]


def _check_count(option, values, files):
    """Raise InputError for an option that is neither absent nor given once for each file."""
    if len(values) not in (0, len(files)):
        raise InputError(
            f"{option} is given {len(values)} times for {len(files)} data files; "
            f"give it once for each, in their order"
        )
