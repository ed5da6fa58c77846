"""Commands that render: images, intensities, contrasts, and tables of them."""

import shlex
from math import isfinite
from pathlib import Path

import click

import mi_lcair
from mi_lcair.cli import options
from mi_lcair.cli.output import print_result, print_written, write_and_print
from mi_lcair.drawing import PICTURES
from mi_lcair.errors import InputError
from mi_lcair.files import FACET_FILES, check_writable, together

OF_TRUTH = ("truth", "facet", "group", "material", "instance")  # ends of names of its files

# mi-lcair render: render a scene to a radiance image
# ---------------------------------------------------


@options.command(
    "render",
    "mi-lcair render two_plates --tolerance 1% -o two_plates.exr",
    "mi-lcair render cylinder_ir_range --tolerance 2% --max-bounces auto -o seen.exr",
)
@options.loading
@options.outputs(
    "the image, or its spectra (.hdr, ENVI), or draw it",
    *(".exr", ".nc", ".hdr", *PICTURES),
    required=True,
)
@options.sampling(
    "render",
    "parts",
    "bins",
    "truth",
    atmosphere={"metavar": "TEXT"},
    range_m={"flag": "--range"},
    errors_um={"flag": "--errors", "multiple": True, "metavar": "UM", "show_default": False},
)
@options.option(
    "--wavelengths",
    "Like --bins, but at the wavelengths A, A + STEP, ... up to B, um. Sets the scene's `band`.",
    metavar="A:B:STEP",
)
@options.workers
def render_command(scene, outputs, atmosphere, range_m, bins, wavelengths, **sampling):
    """Render SCENE to a radiance image.

    SCENE is a Mitsuba XML file or the name of a bundled scene. The output is an OpenEXR file in
    W m^-2 sr^-1. Channel Y is the total radiance. Other channels are its standard error, the part
    of the model, the apparent temperature in K and the range in m. --parts adds the parts of the
    radiance. --bins adds the spectral radiance in W m^-2 sr^-1 um^-1. -o FILE.hdr then writes an
    ENVI file, and -o FILE.nc a netCDF file with the brightness temperatures. --truth also writes
    FILE.truth.exr, FILE.facet.png and others, which say what each pixel shows. The command prints
    the mean and the error.
    """
    if wavelengths is not None:
        from mi_lcair.rendering.images.spectral import even_wavelengths

        if bins or "band" in scene.parameters:
            raise InputError("--wavelengths sets bins and band; leave out --bins and -D band")
        scene.parameters["band"], bins = even_wavelengths(wavelengths)
    for output in outputs:
        if output.suffix.lower() == ".hdr" and not bins:
            raise InputError(f"output '{output}' has spectra; give --bins too, or .exr")
    stem = stem_of_truth(outputs) if sampling["truth"] else None
    if range_m is not None and atmosphere is None:
        raise InputError("--range is the length of the path through an --atmosphere; name one")
    if atmosphere is not None:
        from mi_lcair.physics.atmosphere import atmosphere as read

        sampling |= {"atmosphere": read(atmosphere), "range_m": range_m}
    result = scene.run(mi_lcair.render, bins=bins, **sampling)
    with together():
        for output in outputs:
            result.save(output)
        more = result.truth.save(stem) if stem else []
    files = [("file", str(output)) for output in [*outputs, *more]]
    print_result(result, files, dict(files[:1]))


def stem_of_truth(outputs) -> Path:
    """The first EXR among the outputs, without its suffix: the files of --truth stand beside it.

    Raises InputError without one, and if another output would be one of these files.
    """
    stems = [output.with_suffix("") for output in outputs if output.suffix.lower() == ".exr"]
    if not stems:
        raise InputError("--truth writes files next to an image; give -o FILE.exr too")
    taken = [stems[0].with_name(f"{stems[0].name}.{end}").resolve() for end in OF_TRUTH]
    for output in outputs:
        if output.with_suffix("").resolve() in taken:
            raise InputError(f"output '{output}' is a file of --truth; give it another name")
    return stems[0]


# mi-lcair signature: intensity of a scene in W/sr
# ------------------------------------------------


@options.command(
    "signature",
    "mi-lcair signature cylinder_ir_range --tolerance 1%",
    "mi-lcair signature box/scene.xml --tolerance 5% --spectrum spectrum.csv --facets facets.csv",
)
@options.loading
@options.sampling("signature", parts={"flag": "--parts/--no-parts", "show_default": False})
@options.file(
    "--spectrum spectra",
    "Write the spectral intensity, FILE.csv or FILE.nc (netCDF), or draw it, FILE.png, .svg or "
    ".pdf; may be repeated.",
    (".csv", ".nc", *PICTURES),
    multiple=True,
)
@options.file(
    "--facets",
    "Write radiance and intensity of each facet of the model, FILE.csv. FILE.vtp and FILE.vtu also "
    "have the facets, for ParaView, and FILE.usda and FILE.usdc as OpenUSD.",
    (".csv", *FACET_FILES),
)
def signature_command(scene, spectra, facets, **sampling):
    """Intensity of SCENE in W/sr.

    SCENE is a Mitsuba XML file or the name of a bundled scene with an orthographic sensor. The
    command prints the intensity in W/sr of the target (the model's facets) and of the whole scene.
    It splits both by number of reflections, by the group that emits, and by the group that the
    sensor sees first. --spectrum writes the spectral intensity in W/sr/um. --facets writes the
    temperature in K, radiance in W m^-2 sr^-1 and intensity in W/sr of each facet.
    """
    if facets in spectra:
        raise InputError(f"--spectrum and --facets both name '{facets}'; give each its own file")
    result = scene.run(
        mi_lcair.signature, by_spectrum=bool(spectra), facets=bool(facets), **sampling
    )
    files = dict.fromkeys(spectra, spectra and result.effective_areas.save)
    write_and_print(result, files | ({facets: result.facets.save} if facets else {}))


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
    "mi-lcair trend box/scene.xml --azimuth 0:330:30 --elevation 0,20 --spp 16 -o trend.csv",
)
@options.loading
@options.outputs(
    "a row for each view, or draw polar curves", ".csv", ".nc", *PICTURES, required=True
)
@options.areas
@options.workers
@options.calls(
    "trend",
    "resolution",
    unit="views",
    load={"with_sensors": False},
    azimuths_deg={
        "flag": "--azimuth",
        "type": Azimuths(),
        "help": "Azimuths of the observer, degrees: START:STOP:STEP, or a list. 0 sees the nose, "
        "90 the left side.",
    },
    elevations_deg={
        "flag": "--elevation",
        "type": Angles(),
        "default": "0",
        "help": "Elevations of the observer above the horizontal, degrees; written like the "
        "azimuths.",
    },
)
def trend_command():
    """Intensity of SCENE's model toward observers around it.

    SCENE is a Mitsuba XML file or the name of a bundled scene. FILE has a row for each view with
    the intensity in W/sr and its error. The command prints the smallest, mean and largest
    intensity. The model is everything but sky and terrain. Each view is an orthographic window
    around the model. Views are rendered together in batches. To resume an interrupted trend, run
    the same command again. FILE.csv.json records how the rows of FILE.csv were made.
    """


# mi-lcair chart: error against processor time
# --------------------------------------------


@options.command("chart", "mi-lcair chart cylinder_ir_range --tolerance 1% -o chart.png")
@options.loading
@options.outputs("the table, or draw the chart", ".csv", ".json", *PICTURES)
@options.calls("chart", "seconds", unit="ways")
def chart_command(result):
    """Chart error against processor time for SCENE.

    SCENE is a Mitsuba XML file or the name of a bundled scene with an orthographic sensor. The
    command renders it with different settings: few and many reflections, full reflection models,
    mirrors or diffuse surfaces, with and without emitter sampling. For each setting it prints the
    intensity in W/sr, the error and the processor time in seconds. It also prints the command with
    the fastest setting that meets the tolerance.
    """
    return {"recommended": shlex.split(result.command)[1:] or None}


# mi-lcair contrast: the contrast of a scenario's target at the sensor
# --------------------------------------------------------------------


@options.command(
    "contrast",
    "mi-lcair contrast box.toml --range",
    "mi-lcair contrast a340_landing/position_3 -D sensor.band=LWIR -D render.tolerance=0.1",
)
@options.scenario("sensor.band=LWIR")
@options.sampling("contrast", tolerance_W_m2={"type": click.FloatRange(min=0, min_open=True)})
@options.option(
    "--range ranges",
    "Find the ranges at which the target is detected; needs sensor.nei.",
    is_flag=True,
)
@options.outputs("the contrast, or draw its spectra", ".json", ".csv", ".html", *PICTURES)
def contrast_command(scenario, ranges, outputs):
    """Compute the contrast of a target against its background.

    SCENARIO is a TOML file or the name of a bundled scenario. It describes the target, the
    observer, the atmosphere, the background and the sensor. The command prints the irradiances at
    the sensor, the contrast, and the largest noise at which the target is detected, all in W/m^2.
    Ranges are in m. --spp, --max-spp and the tolerances override [render] of the scenario.
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
        from mi_lcair.results import strict

        more["rows"] = [
            strict(row) | {"detection_range": detection.as_dict()}
            for row, detection in zip(result.rows, result.detection_ranges())
        ]
    write_and_print(result, dict.fromkeys(outputs, result.save), (), more, ranges=ranges)
    return {"camera": scenario.camera and click.get_current_context().params["scenario"]}


# mi-lcair image: what the camera of a scenario records
# -----------------------------------------------------


@options.command("image", "mi-lcair image box.toml -o seen.exr --frames 10 -o seen.png")
@options.scenario("camera.f_number=2")
@options.outputs(
    "the image, and the counts to FILE.tif in the same folder, or draw frame and measures",
    ".exr",
    *PICTURES,
    required=True,
)
@options.sampling("image", "frames", "truth")
def image_command(scenario, outputs, **arguments):
    """Record the target of a scenario with its camera.

    SCENARIO is a TOML file as for `contrast`, with a table [camera]. FILE.exr has the radiance at
    the aperture in W m^-2 sr^-1, electrons, counts and apparent temperature in K. FILE.tif has the
    counts of all frames. With --truth, FILE.truth.exr, FILE.facet.png and others say what each
    pixel shows. The command prints the camera's noise in mK and its sharpness, both predicted and
    measured. It also prints the target's electrons, and its signal-to-noise ratio against range
    in m.
    """
    images = [path for path in outputs if path.suffix.lower() == ".exr"]
    pages = [image.with_suffix(".tif") for image in images]
    stem = stem_of_truth(outputs) if arguments["truth"] else None
    for path in pages:
        check_writable(path)
    with options.progress_bar() as progress:
        result = mi_lcair.image(scenario, **arguments, progress=progress)
    rows = [("rendering time", f"{result.render_seconds:.2f} s")]
    more = {"file": str(images[0]), "counts_file": str(pages[0])} if images else {}
    files = dict.fromkeys([*images, *pages, *outputs], result.save)
    files |= result.truth.files(stem) if stem else {}
    write_and_print(result, files, rows, more)


# mi-lcair sweep: a table of signatures over many conditions
# ----------------------------------------------------------


@options.command("sweep", "mi-lcair sweep sweep.toml -o signatures.nc --areas areas")
@click.argument("conditions", type=options.FILE)
@options.outputs("the table", ".nc", ".csv", required=True)
@options.areas
@options.workers
@options.renderer
@options.calls("sweep", unit="views")
def sweep_command():
    """Signatures, in W/sr, over the table of CONDITIONS.

    CONDITIONS is a TOML file: [base] names a scene or a scenario, [conditions] lists the values
    that vary, and [sampling] sets the tolerance. FILE.nc has a dimension for each condition.
    Conditions with the same geometry and reflectances share their traced paths. To resume an
    interrupted sweep, run the same command again.
    """


# mi-lcair flight: contrast and detection of a moving target against time
# -----------------------------------------------------------------------


@options.command("flight", "mi-lcair flight flyby.toml -o flight.csv -o flight.png")
@options.scenario("flight.rate_hz=1")
@options.of("trend", "spp", "tolerance", "max_spp")
@options.outputs(
    "a row for each time, or draw contrast, signal-to-noise ratio and range",
    *(".csv", ".nc", *PICTURES),
    required=True,
)
@options.sampling("flight", "areas", "frames", "video")
@options.workers
def flight_command(scenario, outputs, **arguments):
    """Contrast of a scenario's target along a path.

    SCENARIO is a TOML file as for `contrast`, with a table [flight] in place of [observer] and
    [pose]: it names the CSV of a path. FILE has the range in m, the contrast in W/m^2 and the
    signal-to-noise ratio for each time, with their errors. The command prints the time at which the
    target is first detected.
    """
    with together():
        with options.progress_bar() as progress:
            result = mi_lcair.flight(scenario, **arguments, progress=progress)
        for path in outputs:
            result.save(path)
    print_result(result)
    print_written(*outputs, arguments["frames"], arguments["video"])


# mi-lcair dataset: labelled frames of many views
# -----------------------------------------------


@options.command("dataset", "mi-lcair dataset dataset.toml -o labelled")
@click.argument("description", type=options.FILE)
@options.workers
@options.renderer
@options.calls("dataset", unit="views", folder={"flag": "-o --output", "type": options.FILE})
def dataset_command(folder):
    """Record labelled frames of many views.

    DESCRIPTION is a TOML file. [base] names a scenario with a camera, [views] gives the camera's
    positions, and [draws] gives the random values that change from image to image. The command
    writes frames with noise as 16-bit PNG, images without noise in W m^-2 sr^-1 and K, the true
    values of each pixel, poses for nerfstudio and COLMAP, splits, a manifest with checksums, and a
    card with pictures. To resume an interrupted data set, run the same command again.
    """
    return {"frame": min(folder.rglob("radiance/*.exr"))}
