"""mi-lcair import: convert a model of a modelling program to meshes and a scene."""

from pathlib import Path

import click

from mi_lcair.cli.options import json_option
from mi_lcair.cli.output import note, print_columns, print_json
from mi_lcair.cli.usage import completion
from mi_lcair.cli.usage.examples import examples

FILE = click.Path(path_type=Path)
AXIS = click.Choice(["X", "Y", "Z", "-X", "-Y", "-Z"])
COLD = 200.0  # lower temperatures, K, are remarked because they are rare on a surface


@click.command(
    "import",
    epilog=examples(
        "mi-lcair import box.obj -o box",
        "mi-lcair import box.obj --check",
        "mi-lcair import drone.obj --names drone.csv --forward -Z --up Y -o drone",
    ),
)
@click.argument("file", type=FILE, metavar="MODEL")
@click.option(
    "-o",
    "--output",
    type=FILE,
    metavar="FOLDER",
    help="Folder to write meshes, model.xml, scene.xml and the picture model.png to.",
)
@click.option("--check", is_flag=True, help="Only report; write nothing.")
@click.option(
    "--overwrite",
    is_flag=True,
    help="Replace files in FOLDER that were edited since the last import.",
)
@click.option(
    "--forward",
    type=AXIS,
    help="Forward Axis in the export dialogue of Blender, which has -Z unless it is changed. "
    "Without --forward and --up, x, y and z are those of Blender; glTF is turned by itself.",
)
@click.option(
    "--up",
    type=AXIS,
    help="Up Axis in the export dialogue of Blender, which has Y unless it is changed.",
)
@click.option(
    "--nose",
    type=AXIS,
    default="X",
    show_default=True,
    help="Axis along which the nose points in Blender.",
)
@click.option(
    "--names",
    type=FILE,
    metavar="CSV|TOML",
    help="Table that says what the faces of an object, group or Blender material are: name and "
    "type, material, kelvin, group, elevation_deg.",
)
@click.option(
    "--temperature",
    type=float,
    metavar="K",
    help="Temperature of all model facets, instead of the labels' temperatures.",
)
@click.option(
    "--temperatures",
    type=FILE,
    metavar="CSV|JSON",
    help="Table facet,kelvin with each facet once, instead of the labels' temperatures; or the "
    "solution of an inversion, for the facets that were unknown in it.",
)
@click.option(
    "--material",
    metavar="NAME|JSON",
    shell_complete=completion.materials,
    help="Material of all model facets, instead of the labels' materials; or the JSON of a fit.",
)
@click.option(
    "--materials",
    type=FILE,
    metavar="TOML|JSON",
    help="Your own materials, or the JSON of a fit or of an inversion; copied to FOLDER.",
)
@click.option(
    "--scale",
    type=float,
    default=1,
    show_default=True,
    help="Length of the file's unit, in metres.",
)
@click.option(
    "--sky",
    metavar="TABLE",
    help="Spectra of sky facets that have elevation_deg=... in their label: a bundled table, or a "
    "CSV that is copied to FOLDER.",
)
@json_option
def command(file, output, check, overwrite, materials, sky, json, **reading):
    """Import a facet model for rendering.

    MODEL is a Wavefront OBJ, glTF (.glb, .gltf), PLY or STL file whose objects or groups are named
    {f|s|t}*{material}*{kelvin}*{anything}, such as f*bare_aluminum*300*. The first letter stands
    for model (f), sky (s) or terrain (t). A model without such names takes --material and
    --temperature, or a table --names. Written are the meshes, in m and with the temperature of each
    facet in K, and a picture. Look at FOLDER/model.png: the nose must be at +x and the top at +z.
    FOLDER/scene.xml is then ready for render and signature.
    """
    if bool(output) == check:
        raise click.UsageError("give either -o FOLDER or --check", click.get_current_context())
    for option, given in (("--sky", sky), ("--overwrite", overwrite)):
        if check and given:
            raise click.UsageError(
                f"{option} goes into what -o FOLDER writes; --check writes nothing",
                click.get_current_context(),
            )
    from mi_lcair import models3d as facets

    model = facets.read(file, materials=materials, **reading)
    result = facets.report(model)
    result["files"] = _write(model, output, materials, sky, overwrite) if output else []
    for remark in (*model.remarks, *_remarks(result, materials)):
        note(remark)
    if json:
        print_json(result)
    else:
        _print_table(result, output)


def _write(model, output, materials, sky, overwrite):
    """Write a model and its picture into a folder; returns the paths."""
    from mi_lcair import models3d as facets
    from mi_lcair.reports.pictures import model as model_picture

    title = f"{output.resolve().name}: {model_picture.TITLE}"
    picture = {"model.png": model_picture.png(model, title)}
    return [str(path) for path in facets.export(model, output, materials, sky, overwrite, picture)]


def _remarks(result, materials):
    """Yield remarks on the model that a user should know, one line each."""
    from mi_lcair.physics.materials import emits_nothing

    for material in result["area_by_material"]:
        if emits_nothing(material, materials):
            yield (
                f"material {material} reflects all that arrives and emits nothing: its facets are "
                "black but for what they reflect; name a material that absorbs, such as blackbody, "
                "where they are to radiate by their temperature"
            )
    if result["temperature_min"] < COLD:
        yield f"the lowest temperature is {result['temperature_min']:g} K"
    if result["inward"]:
        yield (
            f"{result['inward']} model facet{'s face' if result['inward'] > 1 else ' faces'} "
            "inward; the back of a facet neither emits nor reflects"
        )
    for key, how in (("back_to_back", "back to back"), ("one_on_the_other", "one on the other")):
        if result[key]["count"]:
            a, b = result[key]["first"]
            more = f" ({result[key]['count'] - 1} more pairs)" if result[key]["count"] > 1 else ""
            yield (
                f"facets {a} and {b} lie {how} in one plane{more}; which of them is seen is left "
                "to rounding"
            )


def _print_table(result, output):
    """Print the report of a model."""
    lower, upper = result["bounding_box"]
    print_columns(
        [
            ("facets", f"{result['facets']} ({result['triangles']} triangles)"),
            ("bounding box", " x ".join(f"{length:.4g}" for length in upper - lower) + " m"),
            ("volume", f"{result['volume']:.6g} m^3"),
            *(
                (f"area of {material}", f"{area:.6g} m^2")
                for material, area in result["area_by_material"].items()
            ),
            ("temperature", f"{result['temperature_min']:g} to {result['temperature_max']:g} K"),
            ("open edges", result["open_edges"]),
            ("facing inward", result["inward"]),
            ("without area", result["degenerate"]),
            ("duplicate", result["duplicate"]),
            (
                "not planar",
                f"{result['non_planar']} (at most {result['non_planar_mm']:.3g} mm off)",
            ),
            *(
                [
                    (
                        "written to",
                        f"{output}, {len(result['files'])} files; next: mi-lcair signature "
                        f"{output / 'scene.xml'}",
                    )
                ]
                if output
                else []
            ),
        ]
    )
