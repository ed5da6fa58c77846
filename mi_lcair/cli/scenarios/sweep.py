"""mi-lcair sweep: a table of signatures over many conditions."""

from pathlib import Path

import click

import mi_lcair
from mi_lcair.cli.options import (
    FILE,
    POSITIVE,
    examples,
    json_option,
    output_option,
    prepare_renderer,
    progress_bar,
    renderer_options,
)
from mi_lcair.cli.output import check_outputs, print_result, print_written, time_row
from mi_lcair.errors import InputError


@click.command("sweep", epilog=examples("mi-lcair sweep sweep.toml -o signatures.nc --areas areas"))
@click.argument("conditions", type=FILE)
@output_option("the table, FILE.nc (netCDF) or FILE.csv", required=True)
@click.option(
    "--areas",
    type=FILE,
    metavar="FOLDER",
    help="Keep the effective areas in this folder. A later sweep that finds them there traces "
    "nothing again (default: FILE.areas, which is removed at the end).",
)
@click.option("--workers", type=POSITIVE, help="Trace in this number of processes.")
@click.option("--dask", metavar="ADDRESS", help="Trace on the workers of this Dask scheduler.")
@click.option("--overwrite", is_flag=True, help="Replace an output that exists.")
@renderer_options
@json_option
def command(conditions, output, areas, workers, dask, overwrite, variant, threads, json):
    """Signatures over the table of CONDITIONS.

    CONDITIONS is a TOML file: [base] names a scene or a scenario, [conditions] lists what varies
    and [sampling] states the tolerance. FILE.nc has a dimension for each condition. What does not
    change geometry or reflectances is not traced again. A sweep that was interrupted goes on when
    the same command is given again.
    """
    check_outputs((output, (".nc", ".csv")))
    if output.exists() and not overwrite:
        raise InputError(f"output '{output}' exists; give --overwrite, or name another file")
    prepare_renderer(variant, threads)
    folder = areas or Path(f"{output}.areas")
    with progress_bar("views") as progress:
        result = mi_lcair.sweep(
            conditions, areas=folder, workers=workers, dask=dask, progress=progress
        )
    result.save(output)
    if areas is None:
        from mi_lcair.sweeps.areas_folder import AreasFolder

        AreasFolder(folder).clear()
    print_result(result, json, [time_row(result)])
    print_written(output)
