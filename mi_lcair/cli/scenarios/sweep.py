"""mi-lcair sweep: a table of signatures over many conditions."""

import click

import mi_lcair
from mi_lcair.cli import options
from mi_lcair.cli.output import time_row, write_and_print


@options.command("sweep", "mi-lcair sweep sweep.toml -o signatures.nc --areas areas")
@click.argument("conditions", type=options.FILE)
@options.output("the table, FILE.nc (netCDF) or FILE.csv", (".nc", ".csv"), required=True)
@options.areas
@options.overwrite
@options.workers
@options.renderer
def command(conditions, output, areas, overwrite):
    """Signatures over the table of CONDITIONS.

    CONDITIONS is a TOML file: [base] names a scene or a scenario, [conditions] lists what varies
    and [sampling] states the tolerance. FILE.nc has a dimension for each condition. What does not
    change geometry or reflectances is not traced again. A sweep that was interrupted goes on when
    the same command is given again.
    """
    with options.kept_areas(output, areas, overwrite) as folder:
        with options.progress_bar("views") as progress:
            result = mi_lcair.sweep(conditions, areas=folder, progress=progress)
        write_and_print(result, {output: result.save}, [time_row(result)])
