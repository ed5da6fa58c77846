"""mi-lcair convert: files of this project as files that other programs read."""

from pathlib import Path

import click

import mi_lcair
from mi_lcair.cli import options
from mi_lcair.cli.output import print_written
from mi_lcair.errors import InputError, check_known
from mi_lcair.extras import named
from mi_lcair.files import check_suffix, check_writable
from mi_lcair.formats import VTK

CURVE = "theta_deg", "predicted", "standard_error"  # of the emissivity in a fit's report


@options.command(
    "convert",
    "mi-lcair convert open_box.exr open_box.tif -c temperature.Y",
    "mi-lcair convert box.obj box.vtp",
)
@click.argument("source", metavar="IN")
@click.argument("output", metavar="OUT", type=options.FILE)
@options.option(
    "-c --channel", "Channel of FILE.exr for a TIFF, such as temperature.Y.", default="Y"
)
@options.option("--scene", "Scene of a table of facets.")
@options.changes("Set a $-parameter of the scene", "parameters")
@click.pass_context
def command(ctx, source, output, channel, scene, parameters):
    """Write the content of IN as OUT.

    The suffix of OUT chooses the format:

    \b
    FILE.exr -> FILE.tif          a channel as 32-bit numbers, in kelvin for
                                  temperature.Y, else in W m^-2 sr^-1 (or m)
    FILE.csv -> FILE.nc           a trend, spectrum or other table
    FILE.nc -> FILE.csv           and back
    FILE.json -> FILE.csv, .nc    the table of a solution, budget or audit
    fit.json -> FILE.csv          the emissivity by angle with its standard
                                  error, which a BSDF takes as `emissivity`
    facets.csv -> FILE.vtp, .vtu  facets with all columns, for ParaView; with
                                  --scene SCENE
    SCENE, MODEL.obj, FOLDER -> FILE.vtp, .vtu
                                  the facets of a model

    Pictures are made by show.
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
        return _facets, VTK, ("scene", "parameters")
    if suffix in (".csv", ".nc"):
        return _table, (".nc",) if suffix == ".csv" else (".csv",), ()
    from mi_lcair.formats import kinds

    name = kinds.kind_of(source)
    kind = kinds.KINDS[name]
    if not kind.converted:
        raise InputError(
            f"'{source}' is {name}, which is not converted; convert takes an image (.exr), a table "
            "(.csv, .nc), a solution, budget, audit or fit (.json), a scene or a model"
        )
    return named(f"{__name__}:_{kind.converted}"), kind.to, kind.settings


def _image(source, output, suffix, channel):
    """A channel of an EXR image as a TIFF."""
    from mi_lcair.formats import tiff
    from mi_lcair.formats.channels import or_nan, quantity_of
    from mi_lcair.rendering.images.exr import read_exr

    channels, header = read_exr(source)
    check_known("channel", channels, channel)
    is_radiance = "units" in header or "band" in header
    unit = quantity_of(channel)[1] if is_radiance else "units of the image"
    values = or_nan(channel, channels[channel])
    tiff.write(output, values, ", ".join(filter(None, (channel, unit))))


def _table(source, output, suffix):
    """A table of this project from CSV to netCDF or back."""
    from mi_lcair.formats import csv, netcdf
    from mi_lcair.formats.kinds import KINDS, TREND
    from mi_lcair.formats.tables import read_columns
    from mi_lcair.signatures.trend_result import Trend, settings_of

    columns, made = read_columns(source), settings_of(Path(source))
    if suffix == ".nc":
        netcdf.write(output, netcdf.dataset(columns, **made))
    elif made and set(KINDS[TREND].columns) <= set(columns):
        Trend.read(source).save(output)
    else:
        csv.write(output, columns)


def _result(source, output, suffix):
    """The main table of a result from its JSON."""
    from mi_lcair.formats.kinds import read_result

    read_result(source).save(output)


def _emissivity(source, output, suffix):
    """The predicted emissivity of a fit by angle, with its standard error."""
    from mi_lcair.formats import csv
    from mi_lcair.formats.kinds import read_json

    report = read_json(source)
    if "emissivity" not in report:
        bands = len(report.get("materials", ()))
        raise InputError(f"'{source}': has fits of {bands} bands; convert a whole fit of one")
    angles, curve, errors = map(report["emissivity"].get, CURVE)
    csv.write(output, {"theta_deg": angles, "emissivity": curve, "emissivity_std": errors})


def _facets(source, output, suffix, scene, parameters):
    """A table of facets and their polygons."""
    from mi_lcair.formats.tables import read_columns
    from mi_lcair.rendering.facets.image import FACET, by_facet
    from mi_lcair.rendering.facets.polygons import FacetPolygons
    from mi_lcair.rendering.facets.table import FacetTable
    from mi_lcair.table import read_table

    facets = FacetTable(mi_lcair.load(scene, **parameters))
    by_facet(read_table(source, (FACET,)), FACET, facets.count)  # checks the numbers
    columns = read_columns(source)
    columns[FACET] = columns[FACET].astype(int)
    FacetPolygons.of(facets.triangles, facets.triangle_facet).write(output, columns)


def _model(source, output, suffix):
    """The facets of a model file with their labels."""
    import numpy as np

    from mi_lcair import models3d
    from mi_lcair.formats import vtk

    model = models3d.read(Path(source))
    used, corners = np.unique(model.corners, return_inverse=True)
    faces = np.split(corners, model.first[1:-1])
    vtk.write_facets(output, model.vertices[used], faces, model.columns())


def _scene(source, output, suffix, parameters):
    """The facets of a scene with their groups, materials and temperatures."""
    from mi_lcair.rendering.facets.polygons import write_vtk
    from mi_lcair.rendering.facets.table import FacetTable

    write_vtk(output, FacetTable(mi_lcair.load(source, **parameters)))
