"""mi-lcair fit: fit a reflection model to scatterometer files."""

from itertools import zip_longest

import click

from mi_lcair.cli import options
from mi_lcair.cli.output import (
    JSON,
    is_set,
    note,
    print_json,
    print_next,
    print_sections,
    print_written,
)
from mi_lcair.errors import InputError
from mi_lcair.files import replacing, together
from mi_lcair.physics.reflection import NAMES


def known_form(ctx, param, value):
    """The form, if any model has it; the models are loaded for a form that is given alone."""
    if value != "auto":
        from mi_lcair.physics.reflection.models import MODELS

        forms = dict.fromkeys(form for model in MODELS.values() for form in model.forms)
        if value not in forms:
            raise click.BadParameter(f"'{value}' is not one of auto, {', '.join(forms)}")
    return value


@options.command(
    "fit", "mi-lcair fit paint.csv --model microfacet --starts 8 -o paint.json --plot paint.png"
)
@click.argument("files", nargs=-1, required=True, type=options.FILE, metavar="DATA...")
@options.output("the report, which is a material for scenes, FILE.json", (".json",))
@options.plot("data, fitted curves and parameters")
@options.option(
    "--band bands",
    "Band of the measurement: 3-5 (um), MWIR, or the CSV of a response; one for each DATA "
    "(default: band_um in the file).",
    multiple=True,
    metavar="BAND",
)
@options.option(
    "--emissivity emissivities",
    "Measured emissivity to fit as well; one file for each DATA.",
    options.FILE,
    multiple=True,
)
@options.option(
    "--dhr dhrs",
    "Measured directional-hemispherical reflectance to fit as well; one file for each DATA.",
    options.FILE,
    multiple=True,
)
@options.option(
    "--quantity",
    "Quantity of the values: BRDF, or BRDF x cos theta_r (default: as the file states).",
    click.Choice(["brdf", "brdf_cos"]),
)
@options.option(
    "--theta-r-positive",
    "Side on which theta_r is positive (default: as the file states).",
    click.Choice(["specular", "source"]),
)
@options.option(
    "--model",
    "Reflection model; auto takes the simplest one that describes the data.",
    click.Choice(["auto", *NAMES]),
    default="auto",
)
@options.option(
    "--form",
    "Form of the model, if it has several, such as thesis or normalized.",
    metavar="FORM",
    callback=known_form,
    default="auto",
)
@options.option(
    "--loss",
    "Scale on which BRDFs are compared.",
    click.Choice(["log", "cube_root", "linear"]),
    default="log",
)
@options.option("--robust", "Give outliers little weight.", is_flag=True)
@options.option("--starts", "Number of starting points.", click.IntRange(min=1), default=64)
@options.seed("Seed of the starting points.")
@options.option(
    "--max-angle-deg",
    "Leave out points at larger angles.",
    click.FloatRange(0, 90, min_open=True),
    default=80,
)
@options.option(
    "--min-brdf", "Leave out smaller values, in 1/sr.", click.FloatRange(0), default=1e-4
)
@options.option(
    "--source-half-angle-deg",
    "Half the angle of the source seen from the sample; 0 for a point source (default: as the "
    "file states).",
    click.FloatRange(0, 90, max_open=True),
)
@options.json
def command(files, output, plot, bands, **settings):
    """Fit a reflection model to measured BRDFs.

    DATA are CSV or ASTM E1392/E2387 files with in-plane measurements of one surface in 1/sr, one
    file for each band. FILE.json is a material for scenes. Printed and written are the parameters
    (without unit) with their errors, how well each is known, and whether the model describes the
    data: misfit in decades, reduced chi-square, correlation of the residuals.
    """
    from mi_lcair.fitting import report
    from mi_lcair.fitting.scatterometer import reading

    _check_count("--band", bands, files)
    companions = _companions(files, settings.pop("emissivities"), settings.pop("dhrs"))
    quantity, side = settings.pop("quantity"), settings.pop("theta_r_positive")
    measurements = [
        reading.read(file, quantity, side, band) for file, band in zip_longest(files, bands)
    ]
    report.check_bands(measurements)
    joint = [
        {kind: reading.read_directional(file, kind) for kind, file in of_file.items() if file}
        for of_file in companions
    ]

    from mi_lcair.fitting.estimation import fit

    with options.progress_bar("step") as progress:
        fits = [
            fit(data, **directional, **settings, progress=progress)
            for data, directional in zip(measurements, joint)
        ]
    content = report.as_dict(fits)
    with together():
        if plot:
            from mi_lcair.reports.pictures.fit import save_plot

            save_plot(plot, list(zip(measurements, fits, joint)))
        if output:
            with replacing(output) as partial:
                partial.write_text(report.to_json(content), encoding="utf-8")

    for data, fitted in zip(measurements, fits):
        if fitted.quality.lack_of_fit:
            note(f"{data.source[0]['file']}: {fitted.quality.verdict}")
    if is_set(JSON):
        timing = [{"seconds": f.seconds, "compile_seconds": f.compile_seconds} for f in fits]
        print_json({**content, "timing": timing})
    else:
        for number, fitted in enumerate(fits):
            if number:
                click.echo()
            compiled = f"{fitted.compile_seconds:.2f} s to compile"
            time = ("time", f"{fitted.seconds:.2f} s, of which {compiled}")
            print_sections(fitted.sections(), [time])
    print_written(output, plot)
    if output and (band := content.get("band")):
        given = ["-D", f"material={output}", "-D", f"band={band}"]
        print_next(["render", "furnace", *given, "-o", f"{output.stem}_furnace.exr"])


def _companions(files, emissivities, dhrs):
    """Files of emissivity and DHR of each data file, as {quantity: file or None}."""
    _check_count("--emissivity", emissivities, files)
    _check_count("--dhr", dhrs, files)
    return [
        {"emissivity": emissivity, "dhr": dhr}
        for _, emissivity, dhr in zip_longest(files, emissivities, dhrs)
    ]


def _check_count(option, values, files):
    """Raise InputError for an option that is neither absent nor given once for each file."""
    if len(values) not in (0, len(files)):
        raise InputError(
            f"{option} is given {len(values)} times for {len(files)} data files; "
            f"give it once for each, in their order"
        )
