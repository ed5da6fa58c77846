"""Commands about temperatures, heat, cavities and the pose of a camera."""

from functools import partial
from pathlib import Path

import click

import mi_lcair
from mi_lcair.cli import options
from mi_lcair.cli.output import Called, print_next, time_row, write_and_print
from mi_lcair.drawing import PICTURES
from mi_lcair.errors import InputError
from mi_lcair.files import VTK

# mi-lcair temperature: the temperature of an object from an image of a thermographic camera
# ------------------------------------------------------------------------------------------

TEMPERATURE_SUFFIXES = (
    ".tif",
    ".tiff",
    ".csv",
    ".exr",
    ".json",
    ".html",
    ".png",
    ".svg",
    ".pdf",
    ".nc",
)


@options.command(
    "temperature",
    "mi-lcair temperature 305.2 --band LWIR --emissivity 0.92+-0.02 --reflected 293+-2",
    "mi-lcair temperature seen.exr --emissivity 0.92+-0.02 --reflected 285+-2 "
    "--distance 1000 -o object.tif",
    cls=Called,
)
@click.argument("image", metavar="IMAGE|K")
@options.of(
    "temperature",
    "band",
    "emissivity",
    "reflected",
    "transmittance",
    "air_temperature",
    "distance",
    "humidity",
    "sigma",
    "scale",
    "offset",
)
@options.output(
    "the temperatures to FILE (.tif, .csv, .exr with their uncertainty), or a picture",
    TEMPERATURE_SUFFIXES,
)
@options.json
@click.pass_obj
def temperature_command(call, image, output, **measurement):
    """Temperature of an object with its uncertainty.

    IMAGE holds apparent temperatures in K, as a camera shows them for an emissivity of 1: a TIFF,
    CSV or NPY file, an EXR with temperature.Y, or one number. Counts and degrees Celsius
    need --scale or --offset. A quantity may have a standard uncertainty: 0.92+-0.02. Printed are
    the temperature in K and what each quantity contributes to its uncertainty; written is the image
    in K.
    """
    result = mi_lcair.temperature(image, **options.given(measurement))
    write_and_print(result, {output: result.save})
    if not output and result.kelvin.ndim == 2:
        print_next([*call, "-o", f"{Path(image).stem}_object.png"])


# mi-lcair cavity: the effective emissivity of a cavity
# -----------------------------------------------------

CAVITY_SUFFIXES = (".csv", ".json", ".html", ".png", ".svg", ".pdf", ".nc")


@options.command("cavity", "mi-lcair cavity cavity.toml -o cavity.png")
@click.argument("cavity", metavar="CAVITY.toml")
@options.of("cavity", "tolerance", "seed")
@options.output(
    "the table to FILE (.csv, .json, .html, .nc), or a picture (.png, .svg, .pdf)", CAVITY_SUFFIXES
)
@options.json
def cavity_command(cavity, output, **arguments):
    """Effective emissivity of a cavity with its uncertainty.

    CAVITY.toml has the tables [shape], [wall], [view] and [sigma]. Printed are the effective
    emissivity by wavelength, and what each uncertain quantity contributes to its uncertainty.
    Emissivities are fractions.
    """
    result = mi_lcair.cavity(cavity, **arguments)
    write_and_print(result, {output: result.save})


# mi-lcair exchange: radiative conductors between the facets of a scene
# ---------------------------------------------------------------------

EXCHANGE_SUFFIXES = (".csv", ".json", ".html", ".nc", *PICTURES, *VTK)


@options.command(
    "exchange",
    "mi-lcair exchange box/scene.xml --sky-K 250 --ground-K 290 -o facets.csv",
    "mi-lcair exchange box/scene.xml --sun 40 120 -o exchange.nc",
)
@options.loading
@options.of(
    "exchange",
    *("paths", "sky_K", "ground_K"),
    sun_deg={"flag": "--sun", "nargs": 2, "metavar": "ELEVATION AZIMUTH"},
)
@options.output(
    "the facets (.csv, .json, .html, .vtp, .vtu), the facets and the sparse matrix of their "
    "conductors (.nc), or a picture (.png, .svg, .pdf)",
    EXCHANGE_SUFFIXES,
)
def exchange_command(scene, output, **arguments):
    """Heat that the facets of SCENE exchange by radiation.

    Printed are for each group the shares of what it emits that reach sky, ground, itself and other
    groups, and the conductors GR in m^2 between groups: the heat flow is GR sigma (T1^4 - T2^4).
    All values have standard errors.
    """
    loaded = scene.load(with_sensors=False, with_nothing=False)  # what escapes has its place
    result = mi_lcair.exchange(loaded, **scene.sampling, **arguments)
    write_and_print(result, {output: result.save}, [time_row(result)])


# mi-lcair heat: temperatures from what heats and cools a scene
# -------------------------------------------------------------

OF_HOUR = (".csv", ".vtp", ".vtu")  # files of the temperatures at one time
HEAT_SUFFIXES = (*OF_HOUR, ".series", ".nc", ".json", ".html", ".png", ".svg", ".pdf")


@options.command("heat", "mi-lcair heat heat.toml -o temperatures.csv --hour 14")
@click.argument("heat", metavar="HEAT.toml")
@options.output(f"the temperatures to FILE ({', '.join(HEAT_SUFFIXES)})", HEAT_SUFFIXES)
@options.option(
    "--hour",
    "Time of the temperatures in a .csv, .vtp or .vtu file (default: that of the warmest facet).",
    click.FloatRange(min=0),
)
@options.renderer
def heat_command(heat, output, hour):
    """Temperatures of facets from their heat balance.

    HEAT.toml has the tables [target], [weather], [groups.NAME], [sigma], [run] and [signature].
    Printed are the mean temperatures of the groups in K with their standard uncertainty, and what
    each uncertain input contributes. FILE.csv is what `mi-lcair import --temperatures` takes;
    FILE.nc has all times.
    """
    settings = {} if hour is None else {"hour": hour}
    if settings and (output is None or output.suffix.lower() not in OF_HOUR):
        raise InputError(f"--hour goes with an output {', '.join(OF_HOUR)}")
    result = mi_lcair.heat(heat)
    write_and_print(result, {output: partial(result.save, **settings)})


# mi-lcair pose: where a camera is, from points and their pixels
# --------------------------------------------------------------

POSE_SUFFIXES = (".toml", ".csv", ".json", ".html", ".nc")


@options.command(
    "pose",
    "mi-lcair pose box.toml corners.csv -D pose.yaw_deg=0 -o seen.toml",
    "mi-lcair image seen.toml --spp 4 -o seen.exr",
)
@click.argument("scenario")
@click.argument("points", type=options.FILE, metavar="POINTS.csv")
@options.changes("Change an entry of the scenario, such as camera.focal_length_mm=50")
@options.of("pose", sigma_px={"flag": "--sigma"})
@options.output(
    "the scenario with this camera to FILE.toml; or a table, .csv, .json, .html", POSE_SUFFIXES
)
@options.renderer
def pose_command(scenario, points, changes, sigma_px, output):
    """Find where a camera is from points and pixels.

    SCENARIO is a TOML file with a table [camera]. POINTS.csv has the columns x_m, y_m, z_m,
    column_px and row_px: four or more points, such as corners of facets, in the scene's axes, and
    where they are in the frame, whose upper left corner is (0, 0). Printed are position and
    pointing with 95 % intervals, in m and degrees. `image` and `invert` take FILE.toml.
    """
    result = mi_lcair.pose(scenario, points, sigma_px, parameters=dict(changes))
    write_and_print(result, {output: result.save})
    if output and output.suffix == ".toml":
        print_next(["image", output, "-o", f"{output.stem}.exr"])
