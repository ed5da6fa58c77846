"""mi-lcair contrast: the contrast of a scenario's target at the sensor."""

import click

import mi_lcair
from mi_lcair.cli import options
from mi_lcair.cli.output import time_row, write_and_print
from mi_lcair.errors import InputError


@options.command(
    "contrast",
    "mi-lcair contrast box.toml -D render.max_bounces=2 --range",
    "mi-lcair contrast a340_landing/position_1 --spp 4",
)
@options.scenario(
    "sensor.band=LWIR",
    spp="Number of paths, divided by the number of pixels of render.resolution, instead of a "
    "tolerance (default: 64). The paths begin anywhere in a window around the target.",
    tolerance="Trace paths until half of the 95 % interval of each contrast is at most this "
    "fraction of it.",
)
@options.option(
    "--tolerance-W-m2 tolerance_W_m2",
    "The same in W m^-2, for a contrast that may be zero. With both tolerances, one suffices.",
    click.FloatRange(min=0, min_open=True),
)
@options.option(
    "--range ranges",
    "Find the ranges at which the target is detected; needs sensor.nei.",
    is_flag=True,
)
@options.plot("the spectra")
def command(scenario, ranges, plot):
    """Measure a target against its background.

    SCENARIO is a TOML file or the name of a bundled scenario. It states the target, the observer,
    the atmosphere, the background and the sensor. Printed are the irradiances at the sensor, the
    contrast, and the largest noise at which the target is detected, all in W/m^2, and ranges in m.
    The options of the sampling override [render] of the scenario.
    """
    if ranges and scenario.sensor.nei is None:
        raise InputError(
            f"scenario '{scenario.name}': --range needs nei of [sensor], the noise-equivalent "
            "irradiance in W m^-2"
        )
    with options.progress_bar() as progress:
        result = mi_lcair.contrast(scenario, progress=progress)
    more = {}
    if ranges:
        more["rows"] = [
            row.as_dict() | {"detection_range": detection.as_dict()}
            for row, detection in zip(result.rows, result.detection_ranges())
        ]
    rows = [time_row(result)]
    write_and_print(result, {plot: result.plot}, rows, more, ranges=ranges)
