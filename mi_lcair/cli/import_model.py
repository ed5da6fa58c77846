"""mi-lcair import: convert a model of a modelling program to meshes and a scene."""

import shlex
from functools import partial

import click

import mi_lcair
from mi_lcair.cli import completion, options
from mi_lcair.cli.output import Called, note, print_next, print_result, print_written

FIRST = 0.02  # tolerance of the first intensity of a model
AXIS = click.Choice(["X", "Y", "Z", "-X", "-Y", "-Z"])


@options.command(
    "import",
    "mi-lcair import box.obj -o box",
    "mi-lcair import box.obj --check",
    "mi-lcair import drone.obj --names drone.csv --forward -Z --up Y -o drone",
    cls=Called,
)
@click.argument("file", type=options.FILE, metavar="MODEL")
@options.output(
    "meshes, model.xml, scene.xml and the picture model.png to FOLDER", metavar="FOLDER"
)
@options.option("--check", "Only report; write nothing.", is_flag=True)
@options.option(
    "--overwrite", "Replace files in FOLDER that were edited since the last import.", is_flag=True
)
@options.option(
    "--forward",
    "Forward Axis in the export dialogue of Blender, which has -Z unless it is changed. "
    "Without --forward and --up, x, y and z are those of Blender; glTF is turned by itself.",
    AXIS,
)
@options.option(
    "--up", "Up Axis in the export dialogue of Blender, which has Y unless it is changed.", AXIS
)
@options.option("--nose", "Axis along which the nose points in Blender.", AXIS, default="X")
@options.option(
    "--names",
    "Table that says what the faces of an object, group or Blender material are: name and "
    "type, material or emissivity, kelvin, group, elevation_deg.",
    options.FILE,
    metavar="CSV",
)
@options.option(
    "--temperature",
    "Temperature of all model facets, instead of the labels' temperatures.",
    float,
    metavar="K",
)
@options.option(
    "--temperatures",
    "Table facet,kelvin with each facet once, instead of the labels' temperatures; a mesh of "
    "a FEM program (.vtu, .med); or the solution of an inversion, for the facets that were unknown "
    "in it.",
    options.FILE,
    metavar="CSV|VTU|JSON",
)
@options.option(
    "--material",
    "Material of all model facets, instead of the labels' materials: a name, the emissivity "
    "of a grey surface, or the JSON of a fit.",
    metavar="NAME|NUMBER|JSON",
    shell_complete=completion.materials,
)
@options.option(
    "--materials",
    "Your own materials, or the JSON of a fit or of an inversion; copied to FOLDER.",
    options.FILE,
    metavar="TOML|JSON",
)
@options.option("--scale", "Length of the file's unit, in metres.", float, default=1)
@options.option(
    "--sky",
    "Sky around the model: clear, overcast, a temperature, a bundled table, or a CSV that is "
    "copied to FOLDER. A model with sky facets that have elevation_deg=... in their label takes "
    "their spectra from the TABLE.",
    metavar="clear|overcast|KELVIN|TABLE",
)
@options.option(
    "--ground",
    "Ground below the model: its temperature, and its emissivity (1) or material.",
    metavar="KELVIN[,EMISSIVITY|MATERIAL]",
)
@options.option(
    "--sun",
    "Sun by day, in degrees; azimuth 0 is the nose, 90 the left side. FILE is a CSV of its "
    "irradiance.",
    metavar="ELEVATION[,AZIMUTH[,FILE]]",
)
@options.option(
    "--atmosphere",
    "Clear air of sky and sun: us_standard (the default) or midlat_summer.",
    metavar="NAME",
)
@options.option(
    "--band",
    "Also print the intensity of the model in this band, toward the scene's sensor.",
    metavar="MWIR|LWIR|A-B",
)
@options.json
@click.pass_context
def command(ctx, file, output, check, overwrite, materials, band, **settings):
    """Import a facet model or a scene of Mitsuba.

    MODEL is a Wavefront OBJ, glTF (.glb, .gltf), PLY or STL file whose objects or groups are named
    {f|s|t}*{material}*{kelvin}*{anything}, such as f*bare_aluminum*300*. The first letter stands
    for model (f), sky (s) or terrain (t). A model without such names takes --material and
    --temperature, or a table --names. Written are the meshes, in m and with the temperature of each
    facet in K, and a picture. Look at FOLDER/model.png: the nose must be at +x and the top at +z.
    FOLDER/scene.xml is then ready for render and signature.

    A Mitsuba scene, MODEL.xml, becomes thermal with --temperature: all its shapes emit.
    """
    if file.suffix.lower() == ".xml":
        _import_scene(ctx, file, output, settings["temperature"], band or "LWIR", overwrite)
        return
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

    model = models3d.read(file, materials=materials, **settings)
    files = _write(model, output, materials, words, overwrite) if output else []
    rows, more = [], {"files": files}
    if band:
        first = mi_lcair.signature(output, tolerance=FIRST, parameters={"band": band})
        rows.append(("intensity", first.summary()))
        more["signature"] = first.as_dict()
    if output:
        of_band = f" -D {shlex.quote(f'band={band}')}" if band else ""
        after = f"next: mi-lcair signature {shlex.quote(str(output / 'scene.xml'))}{of_band}"
        rows.append(("written to", f"{output}, {len(files)} files; {after}"))
    print_result(model, rows, more, materials=materials)
    if check:
        words = [word for word in ctx.obj if word != "--check"]
        print_next([*words, "-o", file.stem])


def _import_scene(ctx, file, output, temperature, band, overwrite) -> None:
    """Write a thermal version of a scene that was written for Mitsuba."""
    from mi_lcair.models3d.mitsuba_scene import thermal_scene

    options.check_given(
        ctx, ("file", "output", "temperature", "band", "overwrite"), "a scene of Mitsuba"
    )
    if output is None or temperature is None:
        raise click.UsageError("a scene of Mitsuba needs -o FOLDER and --temperature K", ctx)
    for remark in thermal_scene(file, output, temperature, band, overwrite):
        note(remark)
    print_written(output / "scene.xml")
    print_next(["render", output / "scene.xml", "-o", f"{output.name}.exr"])


def _write(model, output, materials, words, overwrite):
    """Write a model and its picture into a folder; returns the paths.

    words: those of the surroundings.
    """
    from mi_lcair import models3d
    from mi_lcair.physics.surroundings.words import Words
    from mi_lcair.reports.pictures.model import TITLE, png

    picture = {"model.png": partial(png, model, f"{output.resolve().name}: {TITLE}")}
    given, sky, around = {name: word for name, word in words.items() if word}, None, None
    if given.keys() == {"sky"} and any(label.elevation_deg is not None for label in model.labels):
        sky = words["sky"]
    elif given:
        around = Words(**given)
    paths = models3d.export(model, output, materials, sky, overwrite, picture, around)
    return [str(path) for path in paths]
