"""mi-lcair contrast: the contrast of a scenario's target at the sensor."""

import click

import mi_lcair
from mi_lcair.cli.options import examples, given, plot_option, scenario_options, solution_option
from mi_lcair.cli.output import check_outputs, print_result, print_written, time_row
from mi_lcair.drawing import PICTURES
from mi_lcair.errors import InputError


@click.command(
    "contrast",
    epilog=examples(
        "mi-lcair contrast box.toml -D render.max_bounces=2 --range",
        "mi-lcair contrast a340_landing/position_1 --spp 4",
    ),
)
@scenario_options(
    "sensor.band=LWIR",
    spp="Number of paths, divided by the number of pixels of render.resolution, instead of a "
    "tolerance (default: 64). The paths begin anywhere in a window around the target.",
    tolerance="Trace paths until half of the 95 % interval of each contrast is at most this "
    "fraction of it.",
)
@click.option(
    "--tolerance-W-m2",
    "tolerance_W_m2",
    type=click.FloatRange(min=0, min_open=True),
    help="The same in W m^-2, for a contrast that may be zero. With both tolerances, one suffices.",
)
@click.option(
    "--range",
    "ranges",
    is_flag=True,
    help="Find the ranges at which the target is detected; needs sensor.nei.",
)
@plot_option("the spectra")
@solution_option
def command(options, tolerance_W_m2, ranges, plot, solution):
    """Measure a target against its background.

    SCENARIO is a TOML file or the name of a bundled scenario. It states the target, the observer,
    the atmosphere, the background and the sensor. Printed are the irradiances at the sensor, the
    contrast, and the largest noise at which the target is detected, all in W/m^2, and ranges in m.
    The options of the sampling override [render] of the scenario.
    """
    check_outputs((plot, PICTURES))
    options.changes |= given(
        {"render.tolerance_W_m2": tolerance_W_m2, "target.solution": solution or None}
    )
    scenario = options.read()
    if ranges and scenario.sensor.nei is None:
        raise InputError(
            f"scenario '{options.scenario}': --range needs nei of [sensor], the noise-equivalent "
            "irradiance in W m^-2"
        )
    result = options.run(mi_lcair.contrast, scenario)
    if plot:
        result.plot(plot)
    more = {}
    if ranges:
        more["rows"] = [
            row.as_dict() | {"detection_range": detection.as_dict()}
            for row, detection in zip(result.rows, result.detection_ranges())
        ]
    print_result(result, options.json, [time_row(result)], more, ranges=ranges)
    print_written(plot)
