"""mi-lcair image: what the camera of a scenario records."""

from pathlib import Path

import click

import mi_lcair
from mi_lcair.cli.options import (
    POSITIVE,
    changes_option,
    json_option,
    plot_option,
    prepare_renderer,
    progress_bar,
    renderer_options,
    sampling_options,
    scenario_argument,
    seed_option,
)
from mi_lcair.cli.output import (
    check_outputs,
    error_row,
    note,
    print_columns,
    print_json,
    print_written,
)
from mi_lcair.cli.usage.examples import examples
from mi_lcair.drawing import PICTURES
from mi_lcair.files import together
from mi_lcair.fraction import percent


@click.command(
    "image",
    epilog=examples(
        "mi-lcair image box.toml --spp 4 -o seen.exr --plot seen.png",
    ),
)
@scenario_argument
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    required=True,
    help="The image to write, FILE.exr. The counts go to FILE.tif beside it.",
)
@changes_option("Change an entry of the scenario, such as camera.f_number=2")
@click.option(
    "--frames",
    type=POSITIVE,
    default=1,
    show_default=True,
    help="Number of frames with independent noise, pages of FILE.tif. There is one render.",
)
@seed_option("Seed of the camera's noise and fixed pattern.")
@plot_option("Draw frame and measures, FILE.png, .svg or .pdf.")
@sampling_options(
    spp="Paths through a pixel (default: 64).",
    tolerance="Render until the rms standard error over the pixels on the target is at most this "
    "fraction of its mean radiance.",
    max_spp="Largest --spp for the tolerance (default: 65536).",
)
@renderer_options
@json_option
def command(scenario, output, changes, frames, seed, plot, variant, threads, json, **sampling):
    """Record the target of a scenario with its camera.

    SCENARIO is a TOML file as for `contrast`, with a table [camera]. FILE.exr has the radiance at
    the aperture in W m^-2 sr^-1, electrons, counts and apparent temperature in K; FILE.tif has the
    counts of all frames. Printed are the camera's noise in mK and its sharpness, predicted and
    measured, and the target's electrons and signal-to-noise ratio over range in m.
    """
    from mi_lcair.detection.scenario import Scenario

    pages = output.with_suffix(".tif")
    check_outputs((output, ".exr"), (pages, ".tif"), (plot, PICTURES))
    given = {name: value for name, value in sampling.items() if value is not None}
    own = {f"render.{name}": value for name, value in given.items()}
    parsed = Scenario.read(scenario, **dict(changes) | own)

    parsed.check_scene()

    from mi_lcair.camera.image_result import write_counts
    from mi_lcair.rendering.image import write_exr

    prepare_renderer(variant, threads)
    with progress_bar() as progress:
        result = mi_lcair.image(parsed, frames=frames, seed=seed, progress=progress)
    for remark in result.remarks:
        note(remark)
    with together():
        write_exr(output, result.channels, result.header)
        write_counts(pages, result)
        if plot:
            result.plot(plot)
    if json:
        print_json({"file": str(output), "counts_file": str(pages), **result.as_dict()})
    else:
        _print_tables(result)
    print_written(output, pages, plot)


def _print_tables(result):
    """Print the scenario, the measures of camera and target, and the target over range."""
    scenario, measures, camera = result.scenario, result.measures, result.scenario.camera
    mtf = measures.mtf
    half, last = len(mtf["frequency"]) // 2, -1
    kelvin = lambda value: f"{1e3 * value:.4g} mK"
    measured = (
        "not measurable, as a uniform scene saturates or its noise is below a count"
        if measures.netd_measured is None
        else f"measured {kelvin(measures.netd_measured)}"
    )
    print_columns(
        [
            ("scenario", f"{scenario.name}: {scenario.title}"),
            (
                "camera",
                f"{camera.width} x {camera.height} pixels of {camera.pitch_um:g} um, "
                f"{camera.focal_length_mm:g} mm, f/{camera.f_number:g}, "
                f"{1e6 * camera.pixel_angle:.4g} urad a pixel, {result.band.label}",
            ),
            (
                "background",
                f"{measures.temperature:.5g} K, {1e-6 * measures.background:.4g} Me of "
                f"{camera.well_Me:g} Me in {camera.integration_time_ms:g} ms",
            ),
            ("count", f"{camera.electrons_per_count:.5g} electrons, {camera.bits} bits"),
            (
                "NETD",
                f"predicted {kelvin(measures.netd)}, {measured}; of shot noise alone "
                f"{kelvin(measures.netd_shot)}",
            ),
            *(
                (
                    f"MTF at {name}",
                    f"predicted {mtf['predicted'][k]:.3f}, measured {mtf['measured'][k]:.3f}, "
                    f"{mtf['frequency'][k]:.4g} cycles/mm",
                )
                for name, k in (("half of Nyquist", half), ("Nyquist", last))
            ),
            ("pixels on target", f"{measures.pixels:.4g}"),
            (
                "signal to noise",
                f"{measures.peak_snr:.4g} in the strongest pixel, {measures.snr:.4g} of the "
                "target with a matched filter",
            ),
            (
                "rendering",
                f"standard error {kelvin(measures.render_error)} on the target, the same in all "
                f"frames; {result.exposure.spp} paths through a pixel",
            ),
            _error(result),
            ("time", f"{result.seconds:.2f} s, of which rendering {result.render_seconds:.2f} s"),
        ]
    )
    click.echo()
    print_columns(
        [
            ("range m", "pixels on target", "electrons", "signal to noise, even", "detected"),
            *(
                (
                    f"{row.range_m:.6g}",
                    f"{row.pixels:.4g}",
                    f"{row.electrons:.4g}",
                    f"{row.snr:.4g}",
                    "yes" if row.detected else f"no, too few: {row.lacks}",
                )
                for row in result.ranges
            ),
        ]
    )
    click.echo()
    needed = (
        f"a signal-to-noise ratio of {scenario.sensor.snr:g} and {camera.least_pixels:g} "
        "pixels on the target"
    )
    if not result.detected_to_m:
        click.echo(f"not detected at these ranges, with {needed}")
        return
    ends = result.detected_to_m > 0.999 * result.ranges[-1].range_m
    click.echo(
        f"detected up to {result.detected_to_m:.5g} m{' at least' if ends else ''}, with {needed}"
    )


def _error(result):
    """Row about the error of the rendering and the tolerance, if any."""
    from mi_lcair.rendering.render import DEFAULT_MAX_SPP

    sampling = result.scenario.render
    return error_row(
        f"the rms standard error over the pixels on the target is "
        f"{percent(result.exposure.rms_error)} of its mean radiance",
        sampling.tolerance,
        result.exposure.reached,
        sampling.max_spp or DEFAULT_MAX_SPP,
    )
