"""Commands on files: pictures, pages, and files of other programs."""

from pathlib import Path

import click

import mi_lcair
from mi_lcair.cli import completion, options, pictures
from mi_lcair.cli.output import line_of, note, print_written
from mi_lcair.drawing import PICTURES
from mi_lcair.errors import InputError, errors_of
from mi_lcair.extras import named
from mi_lcair.files import FACET_FILES, check_suffix, check_writable, write_bytes

# mi-lcair convert: files of this project as files that other programs read
# -------------------------------------------------------------------------

STATED_K = 300.0  # temperature that an OpenMATERIAL states for its emissivity
SAME_AREA = 1e-4  # relative difference of a facet's area in a result and in its scene
CURVE = "theta_deg", "predicted", "standard_error"  # of the emissivity in a fit's report


@options.command(
    "convert",
    "mi-lcair convert box.exr box_K.tif -c temperature.Y",
    "mi-lcair convert box.obj box.vtp",
    "mi-lcair convert box.obj box.usda",
)
@click.argument("source", metavar="IN")
@click.argument("output", metavar="OUT", type=options.FILE)
@options.option(
    "-c --channel", "Channel of FILE.exr for a TIFF, such as temperature.Y.", default="Y"
)
@options.option("--scene", "Scene of a table of facets.")
@options.changes("Set a $-parameter of the scene", "parameters")
@options.plugins
@click.pass_context
def convert_command(ctx, source, output, channel, scene, parameters):
    """Write the content of IN as OUT.

    The suffix of OUT sets the format:

    \b
    FILE.exr -> FILE.tif          a channel as 32-bit numbers, in kelvin for
                                  temperature.Y, else in W m^-2 sr^-1 (or m)
    FILE.csv -> FILE.nc           a trend, spectrum or other table
    FILE.nc -> FILE.csv           and back
    FILE.json -> FILE.csv, .nc    the table of a solution, budget or audit
    fit.json -> FILE.csv          the emissivity by angle with its standard
                                  error, which a BSDF takes as `emissivity`
    fit.json -> FILE.xomp, .json  a material of ASAM OpenMATERIAL 3D
    facets.csv -> FILE.vtp, .vtu  facets with all columns, for ParaView; with
                                  --scene SCENE
    signature.json -> FILE.vtp    the same, if it has facets
    SCENE, MODEL.obj, FOLDER -> FILE.vtp, .vtu
                                  the facets of a model
    FILE.usd, .usda, .usdc        in place of FILE.vtp: OpenUSD, with the
                                  columns as primvars; import reads it

    Use show to make pictures.
    """
    convert, suffixes, names = _way(source, scene)
    options.check_given(ctx, ("source", "output", *names), f"'{source}'")
    suffix = check_suffix(output, suffixes, f"'{source}' becomes {', '.join(suffixes)}; output")
    check_writable(output)
    if Path(source).exists() and output.exists() and output.samefile(source):
        raise InputError(f"'{source}' and the output are the same file")
    settings = {"channel": channel, "scene": scene, "parameters": dict(parameters)}
    convert(source, output, suffix, **{name: settings[name] for name in names})
    print_written(output)


def _way(source: str, scene):
    """Function that converts `source`, the suffixes that it writes, and the options that it takes.

    Raises InputError for a source that cannot be converted.
    """
    suffix = Path(source).suffix.lower()
    if suffix == ".csv" and scene:
        return _facets, FACET_FILES, ("scene", "parameters")
    if suffix in (".csv", ".nc"):
        return _table, (".nc",) if suffix == ".csv" else (".csv",), ()
    from mi_lcair.show import kinds

    name = kinds.kind_of(source)
    kind = kinds.KINDS[name]
    if not kind.converted:
        raise InputError(
            f"'{source}' is {name}, which is not converted; convert takes an image (.exr), a table "
            "(.csv, .nc), a signature, solution, budget, audit or fit (.json), a scene or a model"
        )
    return named(f"{__name__}:_{kind.converted}"), kind.to, kind.settings


def _image(source, output, suffix, channel):
    """A channel of an EXR image as a TIFF."""
    from mi_lcair import formats
    from mi_lcair.formats import check_channels, or_nan, quantity_of_channel
    from mi_lcair.rendering.images.files import read_exr

    channels, header = read_exr(source)
    check_channels("channel", channels, channel)
    is_radiance = "units" in header or "band" in header
    unit = quantity_of_channel(channel)[1] if is_radiance else "units of the image"
    values = or_nan(channel, channels[channel])
    formats.write_tiff(output, values, ", ".join(filter(None, (channel, unit))))


def _table(source, output, suffix):
    """A table of this project from CSV to netCDF or back."""
    from mi_lcair import formats
    from mi_lcair.formats import read_columns
    from mi_lcair.show.kinds import KINDS, TREND
    from mi_lcair.signatures.trend import Trend, settings_of

    columns, made = read_columns(source), settings_of(Path(source))
    if suffix == ".nc":
        formats.write_netcdf(output, formats.dataset(columns, **made))
    elif made and set(KINDS[TREND].columns) <= set(columns):
        Trend.read(source).save(output)
    else:
        formats.write_csv(output, columns)


def _result(source, output, suffix):
    """The main table of a result from its JSON."""
    from mi_lcair.show.kinds import read_result

    read_result(source).save(output)


def _fit(source, output, suffix):
    """The predicted emissivity of a fit by angle, with its standard error, or an OpenMATERIAL."""
    import json

    import numpy as np

    from mi_lcair import formats
    from mi_lcair.physics import materials, openmaterial
    from mi_lcair.show.kinds import read_json, whole

    report = read_json(source)
    if "emissivity" not in report:
        bands = len(report.get("materials", ()))
        raise InputError(f"'{source}': has fits of {bands} bands; convert a whole fit of one")
    with whole(source):
        curve = np.array([report["emissivity"][name] for name in CURVE], float)
        if not np.isfinite(curve[:2]).all():
            raise ValueError("an emissivity is no number")
        if suffix != ".csv":
            emissivity = materials.over_hemisphere(materials.entries_of(source)[0])
            content = openmaterial.content_of(Path(source).stem, report, emissivity, STATED_K)
            write_bytes(output, json.dumps(content, indent=2).encode())
            return
    formats.write_csv(output, dict(zip(("theta_deg", "emissivity", "emissivity_std"), curve)))


def _facets(source, output, suffix, scene, parameters):
    """A table of facets and their polygons."""
    from mi_lcair.formats import read_columns
    from mi_lcair.rendering.facets import FACET, FacetPolygons, FacetTable, by_facet
    from mi_lcair.table import read_table

    facets = FacetTable(mi_lcair.load(scene, **parameters))
    by_facet(read_table(source, (FACET,)), FACET, facets.count)  # checks the numbers
    columns = read_columns(source)
    columns[FACET] = columns[FACET].astype(int)
    FacetPolygons.of(facets.triangles, facets.triangle_facet).write(output, columns)


def _facets_of_signature(source, output, suffix, scene, parameters):
    """The facets of a signature's JSON and their polygons."""
    import numpy as np

    from mi_lcair.rendering.facets import FACET, FacetPolygons, FacetTable
    from mi_lcair.results import columns_of
    from mi_lcair.show.kinds import read_json, whole

    entries = read_json(source)
    if "facets" not in entries:
        raise InputError(f"'{source}': has no facets; signature --facets FILE --json gives them")
    with whole(source):
        columns, scene = columns_of(entries["facets"]), scene or entries["scene_name"]
        columns[FACET] = columns[FACET].astype(int)
        number, areas = columns[FACET], columns["area_m2"]
    with errors_of(f"'{source}': scene '{scene}' (another: --scene)"):
        facets = FacetTable(mi_lcair.load(scene, **parameters))
    if number.max() >= facets.count or not np.allclose(facets.area[number], areas, SAME_AREA):
        raise InputError(f"'{source}': is not of scene '{scene}', whose facets have other areas")
    FacetPolygons.of(facets.triangles, facets.triangle_facet).write(output, columns)


def _model(source, output, suffix):
    """The facets of a model file with their labels."""
    import numpy as np

    from mi_lcair import formats, models3d

    model = models3d.read(Path(source))
    used, corners = np.unique(model.corners, return_inverse=True)
    faces = np.split(corners, model.first[1:-1])
    formats.write_facets(output, model.vertices[used], faces, model.columns())


def _scene(source, output, suffix, parameters):
    """The facets of a scene with their groups, materials and temperatures."""
    from mi_lcair.rendering.facets import FacetTable, write_vtk

    write_vtk(output, FacetTable(mi_lcair.load(source, **parameters)))


# mi-lcair show: pictures of what the commands read and write
# -----------------------------------------------------------

FACET, COLUMNS, PIXEL, TWO = "--facet", "--facets", "--pixel", "two images"


@options.command(
    "show",
    "mi-lcair show two_plates.exr",
    "mi-lcair show gloss_black --band LWIR -o brdf.png",
)
@click.argument("what", nargs=-1, required=True, metavar="WHAT", shell_complete=completion.pictured)
@options.output("the picture, FILE.png, .svg or .pdf (default: named after WHAT)", PICTURES)
@options.option(
    "-c --channel channels",
    "Channel of FILE.exr (default: Y or temperature.Y) or column of FILE.csv, or a pattern "
    "such as 'bounce*'; may be repeated.",
    multiple=True,
)
@options.of(
    "mi_lcair.charts:Scale",
    *("log", "vmin", "vmax"),
    cmap={"metavar": "NAME"},
    common_scale={"flag": "--common-scale/--own-scales", "default": True, "show_default": False},
)
@options.option("--outlines", "Draw lines between the facets.", is_flag=True)
@options.option("--scene", "With --outlines: the scene of FILE.exr, if it is not a bundled one.")
@options.option(
    "--facet",
    "Number of the facet whose view is shown, from 0.",
    options.WholeNumber(min=0),
    metavar="N",
)
@options.option(
    "--facets",
    "Table with a column `facet` and others to colour the facets by.",
    options.FILE,
    metavar="FILE.csv",
)
@options.option(
    "--pixel",
    "Pixel of a spectral image whose spectrum is drawn, from 0 at the upper left.",
    (int, int),
    metavar="ROW COLUMN",
)
@options.changes("Set a $-parameter of the scene, or change an entry of the scenario", "parameters")
@options.of("render", "sensor")
@options.option("--band", "Band (default: the band of a fit if it has only one, otherwise MWIR).")
@options.option("--materials", "Your own materials.", options.FILE, metavar="TOML")
@options.option(
    "--theta-deg",
    "Angle of incidence in degrees.",
    click.FloatRange(0, 90, max_open=True),
    default=30,
)
@options.json
@options.plugins
@click.pass_context
def show_command(ctx, what, output, **settings):
    """Write a picture of WHAT.

    WHAT is one of these, with its options:

    \b
    FILE.exr                            channels of an image
    FILE.exr FILE.exr                   two images with one scale, and their
                                        difference
    FILE.exr --pixel ROW COLUMN         the spectrum of a pixel of an image
                                        that render --bins has written
    FILE.csv, FILE.nc                   a trend, or a spectrum of a signature
    FILE.json                           a solution of invert, a budget, or a
                                        contrast
    SCENE, MODEL.obj, FOLDER            three views of a model; FOLDER is
                                        what import wrote
    SCENE --facet N                     the view from a facet, its neighbours'
                                        solid angles and view factors
    SCENE --facets FILE.csv -c COLUMN   the facets, coloured by a table
    SCENARIO.toml                       the entries of a scenario, and its target
    MATERIAL --band BAND                the BRDF over the hemisphere
    260K,300K --band BAND               spectra of blackbodies
    AIR --band BAND                     transmittance and path radiance of
                                        clear air, such as us_standard
    SKY --band BAND                     a sky by wavelength and elevation,
                                        such as us_standard_clear
    """
    if len(what) == 1:
        (what,) = what
    kind = _kind(
        what, **{name: settings[name] for name in ("facet", "facets", "materials", "pixel")}
    )
    draw, names = _drawn(kind)
    options.check_given(ctx, ("what", "output", *names), kind)
    if settings["scene"] and not settings["outlines"]:
        raise InputError("--scene names the scene whose facets --outlines draws; give that too")
    draw(what, output, **{name: settings[name] for name in names if name in settings})
    from mi_lcair.show.kinds import KINDS, MATERIAL, MODEL, SCENARIO, SCENE

    own = {SCENE: "scene", FACET: "scene", COLUMNS: "scene", SCENARIO: "scenario", MODEL: "model"}
    own |= {MATERIAL: "unread" if settings["materials"] else "material"}
    is_read = kind in (PIXEL, TWO) or kind in KINDS and KINDS[kind].page
    return {own.get(kind, "result" if is_read else "unread"): what}


def _kind(what, facet, facets, materials, pixel) -> str:
    """What is drawn, a kind or an option; raises InputError for what has no picture."""
    from mi_lcair.show.kinds import IMAGE, KINDS, kind_of

    if isinstance(what, tuple):
        if len(what) > 2 or {kind_of(file, materials) for file in what} != {IMAGE}:
            raise InputError("show takes one WHAT, or two images (.exr) to compare")
        return TWO
    if facet is not None or facets is not None:
        return COLUMNS if facet is None else FACET
    kind = kind_of(what, materials)
    if kind == IMAGE and pixel is not None:
        return PIXEL
    if not KINDS[kind].drawn:
        raise InputError(f"'{what}' is {kind}; {KINDS[kind].hint.format(what)}")
    return kind


def _drawn(kind: str):
    """The function that draws a kind, or for an option, and its options beside --output."""
    from mi_lcair.show.kinds import KINDS, SCALE

    special = {
        FACET: (pictures.facet_view, ("facet", "parameters", "json")),
        COLUMNS: (pictures.facet_columns, ("facets", "channels", *SCALE, "parameters", "sensor")),
        PIXEL: (pictures.pixel_spectrum, ("pixel",)),
        TWO: (pictures.comparison, ("channels", *SCALE[:-1])),
    }
    if kind in special:
        return special[kind]
    return getattr(pictures, KINDS[kind].drawn), KINDS[kind].options


# mi-lcair report: a page in HTML of results, scenes and scenarios
# ----------------------------------------------------------------


@options.command("report", "mi-lcair report box.toml --spp 16 -o scenario.html")
@click.argument("what", nargs=-1, required=True, shell_complete=completion.scenes_and_scenarios)
@options.output("the page, FILE.html", required=True)
@options.changes("Set a $-parameter of the scene, or an entry of the scenario", "parameters")
@options.sampling("report", "scene")
@options.renderer
@click.pass_obj
def report_command(call, what, output, parameters, **settings):
    """Write an interactive page of WHAT.

    \b
    FILE.exr             images with the values of every channel
    FILE.json            tables and pictures of a result; data and curves of a
                         fit
    MODEL.obj            the facets of a model
    FILE.csv, FILE.nc    polar curves of a trend; facets; spectra; the table
                         of a sweep or a flight
    SCENE                image, signature, facets, spectrum, audit
    SCENARIO             image through the air, contrast, ranges, and the rest

    SCENE is an XML file or a bundled name, SCENARIO a TOML file or a bundled name. Several WHAT
    share one page. The page is one file that needs no network. Radiances are in W m^-2 sr^-1,
    temperatures in K, intensities in W/sr, contrasts in W/m^2.
    """
    with options.progress_bar() as progress:
        notes = mi_lcair.report(
            what,
            output,
            parameters=dict(parameters),
            command=line_of(call),
            progress=progress,
            **settings,
        )
    for remark in notes:
        note(remark)
    click.echo(output)
