"""mi-lcair contrast: the contrast of a scenario's target at the sensor."""

import click

import mi_lcair
from mi_lcair.cli.options import (
    changes_option,
    json_option,
    plot_option,
    prepare_renderer,
    progress_bar,
    renderer_options,
    sampling_options,
    scenario_argument,
    solution_option,
)
from mi_lcair.cli.output import (
    check_outputs,
    error_row,
    interval,
    note,
    print_columns,
    print_json,
    print_written,
)
from mi_lcair.cli.usage.examples import examples
from mi_lcair.drawing import PICTURES
from mi_lcair.errors import InputError


@click.command(
    "contrast",
    epilog=examples(
        "mi-lcair contrast box.toml -D render.max_bounces=2 --range",
        "mi-lcair contrast a340_landing/position_1 --spp 4",
    ),
)
@scenario_argument
@changes_option("Change an entry of the scenario, such as sensor.band=LWIR")
@click.option(
    "--range",
    "ranges",
    is_flag=True,
    help="Find the ranges at which the target is detected; needs sensor.nei.",
)
@plot_option("Draw the spectra, FILE.png, .svg or .pdf.")
@sampling_options(
    spp="Number of paths, divided by the number of pixels of render.resolution, instead of a "
    "tolerance (default: 64). The paths begin anywhere in a window around the target.",
    tolerance="Trace paths until half of the 95 % interval of each contrast is at most this "
    "fraction of it.",
    max_spp="Largest --spp for the tolerances (default: 65536).",
)
@click.option(
    "--tolerance-W-m2",
    "tolerance_W_m2",
    type=click.FloatRange(min=0, min_open=True),
    help="The same in W m^-2, for a contrast that may be zero. With both tolerances, one suffices.",
)
@solution_option
@renderer_options
@json_option
def command(scenario, changes, ranges, plot, solution, variant, threads, json, **sampling):
    """Measure a target against its background.

    SCENARIO is a TOML file or the name of a bundled scenario. It states the target, the observer,
    the atmosphere, the background and the sensor. Printed are the irradiances at the sensor, the
    contrast, and the largest noise at which the target is detected, all in W/m^2, and ranges in m.
    The options of the sampling override [render] of the scenario.
    """
    from mi_lcair.detection.scenario import Scenario

    check_outputs((plot, PICTURES))
    given = {name: value for name, value in sampling.items() if value is not None}
    own = {f"render.{name}": value for name, value in given.items()}
    if solution:
        own["target.solution"] = solution
    parsed = Scenario.read(scenario, **dict(changes) | own)
    if ranges and parsed.sensor.nei is None:
        raise InputError(
            f"scenario '{scenario}': --range needs nei of [sensor], the noise-equivalent "
            "irradiance in W m^-2"
        )

    parsed.check_scene()
    prepare_renderer(variant, threads)
    with progress_bar() as progress:
        result = mi_lcair.contrast(parsed, progress=progress)
    for remark in result.remarks:
        note(remark)
    detections = result.detection_ranges() if ranges else []
    if plot:
        result.plot(plot)
    if json:
        data = result.as_dict()
        for row, detection in zip(data["rows"], detections):
            row["detection_range"] = detection.as_dict()
        print_json(data)
    else:
        _print_tables(result, detections)
    print_written(plot)


def _print_tables(result, detections):
    """Print the scenario, a table of the rows, and the detection ranges if there are any."""
    scenario, row, detector = result.scenario, result.rows[-1], result.detector
    print_columns(
        [
            ("scenario", f"{scenario.name}: {scenario.title}"),
            ("band", f"{detector.band.label}, optics transmit {detector.optics_transmittance:g}"),
            (
                "line of sight",
                f"{result.path.range_m:.6g} m, {abs(result.sight_elevation_deg):.4g} degrees "
                f"{'up' if result.sight_elevation_deg >= 0 else 'down'}ward, observer at azimuth "
                f"{scenario.observer.azimuth_deg:.6g}{_heights(result)}",
            ),
            (
                "atmosphere",
                f"{result.air.name}: mean transmittance {result.transmittance:.4f}, path "
                f"{result.path_radiance:.5g} W m^-2 sr^-1",
            ),
            (
                "background",
                f"{result.background_name}: {result.background_radiance:.5g} W m^-2 sr^-1",
            ),
            (
                "target",
                f"projected area {_with_error(row.projected_area)} m^2, {row.solid_angle:.5g} sr",
            ),
            *(
                []
                if result.no_target is None
                else [("without target", f"{result.no_target:.5g} W/m^2 in the field of view")]
            ),
            _error(result),
            ("time", f"{result.seconds:.2f} s"),
        ]
    )
    click.echo()
    extra = [
        name
        for name, value in (("observed W/m^2", row.observed), ("detected", row.detected))
        if value is not None
    ]
    print_columns(
        [
            (
                "reflections up to",
                "intensity W/sr",
                "target W/m^2",
                "background W/m^2",
                "path W/m^2",
                "total W/m^2 (95 %)",
                "nei max W/m^2",
                *extra,
            ),
            *(
                (
                    row.max_bounces,
                    _with_error(row.intensity),
                    *map(_with_error, (row.target, row.background, row.path)),
                    f"{row.total.value:.5g} +- {row.half_width:.2g}",
                    _with_error(row.nei_max),
                    *([] if row.observed is None else [f"{row.observed:.5g}"]),
                    *([] if row.detected is None else ["yes" if row.detected else "no"]),
                )
                for row in result.rows
            ),
        ]
    )
    if detections:
        click.echo()
        print_columns(
            [
                (
                    "reflections up to",
                    f"detected at, for a nei of {detector.nei:g} W/m^2 and a signal-to-noise "
                    f"ratio of {detector.snr:g}",
                ),
                *(
                    (row.max_bounces, _sentence(detection))
                    for row, detection in zip(result.rows, detections)
                ),
            ]
        )


def _heights(result):
    """Heights of observer and target as text, where they are known."""
    if result.observer_height_m is None:
        return ""
    return (
        f", at a height of {result.observer_height_m:.5g} m; target {result.target_height_m:.5g} m"
    )


def _error(result):
    """Row about the widest 95 % interval of a contrast, and about the tolerances if any."""
    from mi_lcair.rendering.render import DEFAULT_MAX_SPP

    sampling, rows = result.scenario.render, result.rows
    allowed = [
        *([] if sampling.tolerance is None else [f"{100 * sampling.tolerance:.4g} %"]),
        *([] if sampling.tolerance_W_m2 is None else [f"{sampling.tolerance_W_m2:.4g} W/m^2"]),
    ]
    chosen = [row for row in rows if row.reached is False] or rows
    widest = max(chosen, key=lambda row: row.half_width)
    several = len(rows) > 1
    contrast = f"the contrast with {widest.max_bounces} reflections" if several else "the contrast"
    may_be_zero = widest.half_width >= abs(widest.total.value)
    return error_row(
        interval(
            widest.half_width,
            widest.total.value,
            "W/m^2",
            contrast,
            absolute=sampling.tolerance_W_m2 is not None,
        ),
        " or ".join(allowed) or None,
        result.reached,
        sampling.max_spp or DEFAULT_MAX_SPP,
        where=f"in {len(chosen)} of {len(rows)} rows" if several else "",
        remedy="give --tolerance-W-m2, as no fraction of zero can be reached"
        if may_be_zero and sampling.tolerance_W_m2 is None
        else "raise --max-spp",
    )


def _sentence(detection):
    """The intervals of a detection range, as text."""
    return detection.summary().removeprefix("detected at ").removesuffix(" (standard error)")


def _with_error(estimate):
    """An estimate with its standard error, as text."""
    return f"{estimate.value:.5g} +- {estimate.standard_error:.2g}"
