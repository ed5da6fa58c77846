"""Commands that render: images, intensities, contrasts, and tables of them."""

from math import isfinite

import click

import mi_lcair
from mi_lcair.cli import options
from mi_lcair.cli.output import print_next, print_result, print_written, time_row, write_and_print
from mi_lcair.errors import InputError
from mi_lcair.files import VTK, check_writable, together

# mi-lcair render: render a scene to a radiance image
# ---------------------------------------------------


@options.command(
    "render",
    "mi-lcair render open_box --spp 64 -o open_box.exr",
    "mi-lcair render cylinder_ir_range -D band=MWIR --tolerance 5% -o cylinder.exr",
)
@options.scene(
    spp="Samples per pixel, instead of --tolerance (default: the scene's own).",
    tolerance="Render until the rms standard error over the pixels is below this fraction of the "
    "mean radiance, such as 0.01 or 1%.",
)
@options.output("the image, FILE.exr", required=True)
@options.option(
    "--atmosphere",
    "Also write the radiance that arrives through an atmosphere: a bundled name, a CSV, a "
    "MODTRAN tape7, or vacuum.",
)
@options.option(
    "--range range_m",
    "With --atmosphere: one range for the whole model, m (default: that of each pixel).",
    float,
)
@options.option(
    "--bins",
    "Also write the spectral radiance at this number of even wavelengths over the band.",
    int,
    default=0,
)
@options.option(
    "--wavelengths",
    "The same at the wavelengths A, A + STEP, ... up to B, um. Sets the scene's `band`.",
    metavar="A:B:STEP",
)
@options.option(
    "--errors errors_um",
    "Also write the standard error of each pixel at this wavelength of --bins or "
    "--wavelengths, um; may be repeated.",
    float,
    multiple=True,
    metavar="UM",
)
@options.workers
def render_command(scene, output, atmosphere, range_m, bins, wavelengths, errors_um):
    """Render SCENE to a radiance image.

    SCENE is a Mitsuba XML file or the name of a bundled scene. Written is an OpenEXR file in W m^-2
    sr^-1: channel Y is the total radiance, the other channels are its parts, its standard error,
    the apparent temperature in K and the range in m. With --bins it also has the spectral radiance
    in W m^-2 sr^-1 um^-1, which FILE.hdr in place of FILE.exr makes an ENVI file, and FILE.nc a
    netCDF file with the brightness temperatures. Printed are the mean and the error.
    """
    from mi_lcair.files import check_writable
    from mi_lcair.rendering.images.files import write_exr

    if wavelengths is not None:
        from mi_lcair.rendering.images.spectral import even_wavelengths

        if bins or "band" in scene.parameters:
            raise InputError("--wavelengths sets bins and band; leave out --bins and -D band")
        scene.parameters["band"], bins = even_wavelengths(wavelengths)
    is_cube = bool(bins) and output.suffix.lower() in (".hdr", ".nc")
    if output.suffix.lower() != ".exr" and not is_cube:
        raise InputError(
            f"output '{output}' does not end in .exr; render writes OpenEXR images, and show "
            "makes PNGs"
        )
    check_writable(output)
    if range_m is not None and atmosphere is None:
        raise InputError("--range is the length of the path through an --atmosphere; name one")
    air = {}
    if atmosphere is not None:
        from mi_lcair.physics.atmosphere import atmosphere as read

        air = {"atmosphere": read(atmosphere), "range_m": range_m}
    result = scene.run(mi_lcair.render, bins=bins, errors_um=errors_um, **air)
    if is_cube:
        result.save(output)
    else:
        write_exr(output, result.channels, result.header)
    rows = [("file", str(output)), time_row(result)]
    print_result(result, rows, {"file": str(output)})
    if not is_cube:
        print_next(["show", output])


# mi-lcair signature: intensity of a scene in W/sr
# ------------------------------------------------


@options.command(
    "signature",
    "mi-lcair signature cylinder_ir_range --spp 16",
    "mi-lcair signature box/scene.xml --tolerance 1% --facets facets.csv --spectrum s.csv",
)
@options.scene(
    spp="Number of paths, divided by the number of pixels of the film (default: the scene's own). "
    "The paths begin anywhere on the film.",
    tolerance="Trace paths until half of the 95 % interval of the target's intensity is at most "
    "this fraction of it, such as 0.01 or 1%.",
)
@options.file(
    "--spectrum", "Write the spectral intensity, FILE.csv or FILE.nc (netCDF).", (".csv", ".nc")
)
@options.plot("the spectral intensity of --spectrum")
@options.file(
    "--facets",
    "Write radiance and intensity of each facet of the model, FILE.csv; or the facets with them "
    "for ParaView, FILE.vtp or FILE.vtu.",
    (".csv", *VTK),
)
def signature_command(scene, spectrum, plot, facets):
    """Intensity of SCENE in W/sr.

    SCENE is a Mitsuba XML file or the name of a bundled scene with an orthographic sensor. Printed
    is the intensity in W/sr of the target (the model's facets) and of the whole scene: by number of
    reflections, by the group that emits, and by the group that the sensor sees first. Written on
    request are the spectral intensity in W/sr/um, and for each facet its temperature in K, radiance
    in W m^-2 sr^-1 and intensity in W/sr.
    """
    if plot and not spectrum:
        raise InputError("--plot draws the spectral intensity; give --spectrum FILE.csv too")
    if spectrum and spectrum == facets:
        raise InputError(f"--spectrum and --facets both name '{spectrum}'; give each its own file")
    result = scene.run(mi_lcair.signature, by_spectrum=bool(spectrum), facets=bool(facets))
    with together():
        if spectrum:
            result.effective_areas.save(spectrum)
            if plot:
                result.effective_areas.plot(plot)
        if facets:
            result.facets.save(facets)
    print_result(result, [time_row(result)])
    print_written(spectrum, plot, facets)


# mi-lcair trend: intensity as a function of the aspect
# -----------------------------------------------------

MOST_ANGLES = 100_000  # largest number of angles in START:STOP:STEP


class Angles(click.ParamType):
    """Angles in degrees: one, a list with commas, or START:STOP:STEP.

    STOP is included if a step ends there.
    """

    name = "degrees"

    def convert(self, value, param, ctx):
        if not isinstance(value, str):
            return value
        try:
            return [angle for part in value.split(",") for angle in self.run(part)]
        except ValueError:
            self.fail(
                f"'{value}' is no angle, no list such as 0,45,90 and no START:STOP:STEP such as "
                "0:360:2",
                param,
                ctx,
            )

    @staticmethod
    def run(text) -> list[float]:
        """The angles of one part of a list. Raises ValueError if it is unusable."""
        numbers = [float(number) for number in text.split(":")]
        if len(numbers) == 1 and isfinite(numbers[0]):
            return numbers
        start, stop, step = numbers
        if not (step > 0 and 0 <= (stop - start) / step < MOST_ANGLES):
            raise ValueError
        return [start + step * k for k in range(int((stop - start) / step + 1e-9) + 1)]


class Azimuths(Angles):
    """Angles, without those that differ from an earlier one by whole turns."""

    def convert(self, value, param, ctx):
        angles = super().convert(value, param, ctx)
        kept = {round(angle % 360, 9) % 360: angle for angle in reversed(angles)}
        return [angle for angle in angles if kept[round(angle % 360, 9) % 360] == angle]


@options.command(
    "trend",
    "mi-lcair trend cylinder_ir_range --azimuth 0:180:45 --resolution 16 --spp 16 -o trend.csv",
)
@options.loading
@options.option(
    "--azimuth",
    "Azimuths of the observer, degrees: START:STOP:STEP, or a list. 0 sees the nose, 90 the "
    "left side.",
    Azimuths(),
    required=True,
)
@options.option(
    "--elevation",
    "Elevations of the observer above the horizontal, degrees; written like the azimuths.",
    Angles(),
    default="0",
)
@options.output("a row for each view, FILE.csv or FILE.nc (netCDF)", (".csv", ".nc"), required=True)
@options.plot("polar curves")
@options.of("trend", "resolution")
@options.sampling(
    spp="Paths of each view, divided by its number of pixels, instead of --tolerance.",
    tolerance="Trace paths until half of the 95 % interval of each intensity is at most this "
    "fraction of it (default: 1%).",
    max_spp=options.MAX_SPP,
)
@options.max_bounces
@options.areas
@options.overwrite
@options.workers
def trend_command(scene, azimuth, elevation, output, plot, areas, overwrite, **settings):
    """Intensity of SCENE's model toward observers around it.

    SCENE is a Mitsuba XML file or the name of a bundled scene. FILE has a row for each view with
    the intensity in W/sr and its error; printed are least, mean and greatest intensity. The model
    is everything but sky and terrain. Each view is an orthographic window around it. Views are
    rendered together in batches. A trend that was interrupted goes on when the same command is
    given again. FILE.csv.json beside FILE.csv states how the rows were made.
    """
    with options.kept_areas(output, areas, overwrite) as folder:
        loaded = scene.load(with_sensors=False)
        with options.progress_bar("views") as progress:
            result = mi_lcair.trend(
                loaded,
                azimuth,
                elevation,
                **scene.sampling,
                **settings,
                areas=folder,
                progress=progress,
            )
        write_and_print(result, {output: result.save, plot: result.plot})


# mi-lcair contrast: the contrast of a scenario's target at the sensor
# --------------------------------------------------------------------


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
def contrast_command(scenario, ranges, plot):
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


# mi-lcair image: what the camera of a scenario records
# -----------------------------------------------------


@options.command("image", "mi-lcair image box.toml --spp 4 -o seen.exr --plot seen.png")
@options.scenario(
    "camera.f_number=2",
    spp="Paths through a pixel (default: 64).",
    tolerance="Render until the rms standard error over the pixels on the target is at most this "
    "fraction of its mean radiance.",
)
@options.output(
    "the image, FILE.exr, and the counts to FILE.tif beside it", (".exr",), required=True
)
@options.of("image", "frames", "seed")
@options.plot("frame and measures")
def image_command(scenario, output, frames, seed, plot):
    """Record the target of a scenario with its camera.

    SCENARIO is a TOML file as for `contrast`, with a table [camera]. FILE.exr has the radiance at
    the aperture in W m^-2 sr^-1, electrons, counts and apparent temperature in K; FILE.tif has the
    counts of all frames. Printed are the camera's noise in mK and its sharpness, predicted and
    measured, and the target's electrons and signal-to-noise ratio over range in m.
    """
    pages = output.with_suffix(".tif")
    check_writable(pages)
    with options.progress_bar() as progress:
        result = mi_lcair.image(scenario, frames=frames, seed=seed, progress=progress)
    rows = [time_row(result), ("rendering time", f"{result.render_seconds:.2f} s")]
    more = {"file": str(output), "counts_file": str(pages)}
    files = {output: result.save, pages: result.save, plot: result.plot}
    write_and_print(result, files, rows, more)
    print_next(["show", output])


# mi-lcair sweep: a table of signatures over many conditions
# ----------------------------------------------------------


@options.command("sweep", "mi-lcair sweep sweep.toml -o signatures.nc --areas areas")
@click.argument("conditions", type=options.FILE)
@options.output("the table, FILE.nc (netCDF) or FILE.csv", (".nc", ".csv"), required=True)
@options.areas
@options.overwrite
@options.workers
@options.renderer
def sweep_command(conditions, output, areas, overwrite):
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


# mi-lcair flight: contrast and detection of a moving target against time
# -----------------------------------------------------------------------


@options.command("flight", "mi-lcair flight flyby.toml -o flight.csv --plot flight.png")
@options.scenario(
    "flight.rate_hz=1",
    spp="Paths of each traced view, divided by the number of pixels of render.resolution.",
    tolerance="Trace paths until half of the 95 % interval of each intensity is at most this "
    "fraction of it (default: 1%).",
)
@options.output(
    "a row for each moment, FILE.csv or FILE.nc (netCDF)", (".csv", ".nc"), required=True
)
@options.of("flight", "areas", "frames", "video", "seed")
@options.workers
@options.plot("contrast, signal-to-noise ratio and range")
def flight_command(scenario, output, plot, **arguments):
    """Contrast of a scenario's target along a path.

    SCENARIO is a TOML file as for `contrast`, with a table [flight] in place of [observer] and
    [pose]: it names the CSV of a path. FILE has the range in m, the contrast in W/m^2 and the
    signal-to-noise ratio at each moment, with their errors. Printed is when the target is first
    detected.
    """
    with together():
        with options.progress_bar() as progress:
            result = mi_lcair.flight(scenario, **arguments, progress=progress)
        result.save(output)
        if plot:
            result.plot(plot)
    print_result(result, [time_row(result)])
    print_written(output, arguments["frames"], arguments["video"], plot)
