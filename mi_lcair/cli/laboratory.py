"""Commands about temperatures, heat, cavities and the pose of a camera."""

from functools import partial
from pathlib import Path

import click

import mi_lcair
from mi_lcair.cli import options
from mi_lcair.cli.output import write_and_print
from mi_lcair.drawing import PICTURES
from mi_lcair.errors import InputError
from mi_lcair.files import FACET_FILES

# mi-lcair temperature: the temperature of an object from an image of a thermographic camera
# ------------------------------------------------------------------------------------------

ANY = (".csv", ".json", ".html", ".nc", *PICTURES)  # files of every result that has a picture


@options.command(
    "temperature",
    "mi-lcair temperature 305.2 --band LWIR --emissivity 0.92+-0.02 --reflected 293+-2",
    "mi-lcair temperature photo.jpg --emissivity 0.95+-0.02 --spot 40,30 --spot 20,30",
    "mi-lcair temperature seen.exr --emissivity 0.92+-0.02 --reflected 293+-2 "
    "--distance 800+-10 --humidity 0.6+-0.1 -o object.csv",
)
@click.argument("image", metavar="IMAGE|K")
@options.outputs("or draw the temperatures, with their uncertainty", ".tif", ".tiff", ".exr", *ANY)
@options.json
@options.calls(
    "temperature",
    *("band", "emissivity", "reflected", "transmittance", "air_temperature", "distance"),
    *("humidity", "window", "window_temperature", "sigma", "scale", "offset"),
    spots={"flag": "--spot", "multiple": True, "metavar": "X,Y", "show_default": False},
    areas={"flag": "--area", "multiple": True, "metavar": "X,Y,W,H", "show_default": False},
)
def temperature_command(image, result):
    """Temperature of an object with its uncertainty.

    IMAGE contains apparent temperatures in K, as a camera shows them for an emissivity of 1. It is
    a TIFF, CSV or NPY file, an EXR with temperature.Y, or one number. A radiometric file, such as
    FLIR's JPEG or .fff, contains the conditions of the measurement. Options replace them. Counts
    and degrees Celsius need --scale or --offset. A quantity may have a standard uncertainty:
    0.92+-0.02. The command prints the temperature in K and the contribution of each quantity to its
    uncertainty. It writes the image in K.
    """
    return {"file": Path(image) if result.kelvin.ndim == 2 else None}


# mi-lcair cavity: the effective emissivity of a cavity
# -----------------------------------------------------


@options.command("cavity", "mi-lcair cavity cavity.toml -o cavity.png")
@click.argument("description", metavar="CAVITY.toml")
@options.outputs("or draw the table", *ANY)
@options.json
@options.calls("cavity")
def cavity_command():
    """Effective emissivity of a cavity with its uncertainty.

    CAVITY.toml has the tables [shape], [wall], [view] and [sigma]. The command prints the effective
    emissivity at each wavelength, and the contribution of each uncertain quantity to its
    uncertainty. Emissivities are fractions.
    """


# mi-lcair exchange: radiative conductors between the facets of a scene
# ---------------------------------------------------------------------


@options.command(
    "exchange",
    "mi-lcair exchange box/scene.xml --sky-K 250 --ground-K 285 -o facets.csv",
    "mi-lcair exchange box/scene.xml --sun 40 120 -o exchange.nc",
)
@options.loading
@options.calls(
    "exchange",
    *("paths", "sky_K", "ground_K"),
    load={"with_sensors": False, "with_nothing": False},  # what escapes has its place
    sun_deg={"flag": "--sun", "nargs": 2, "metavar": "ELEVATION AZIMUTH"},
)
@options.outputs(
    "or draw the facets, with the sparse matrix of their conductors in .nc", *ANY, *FACET_FILES
)
def exchange_command():
    """Heat that the facets of SCENE exchange by radiation.

    The command prints which shares of each group's emission reach sky, ground, the group itself and
    other groups. It also prints the conductors GR in m^2 between groups: the heat flow is GR sigma
    (T1^4 - T2^4). All values have standard errors.
    """


# mi-lcair heat: temperatures from what heats and cools a scene
# -------------------------------------------------------------

OF_HOUR = (".csv", *FACET_FILES)  # files of the temperatures at one time


@options.command("heat", "mi-lcair heat heat.toml -o noon.csv --hour 12")
@click.argument("description", metavar="HEAT.toml")
@options.outputs(
    "or draw the temperatures", *OF_HOUR, ".series", ".nc", ".json", ".html", *PICTURES
)
@options.option(
    "--hour",
    "Time of the temperatures in a .csv, .vtp, .vtu or .usd file (default: the time of the "
    "warmest facet).",
    click.FloatRange(min=0),
)
@options.renderer
def heat_command(description, outputs, hour):
    """Temperatures of facets from their heat balance.

    HEAT.toml has the tables [target], [weather], [groups.NAME], [sigma], [run] and [signature]. The
    command prints the mean temperatures of the groups in K with their standard uncertainty, and the
    contribution of each uncertain input. FILE.csv is the input of `mi-lcair import --temperatures`.
    FILE.nc has all times.
    """
    files = [path for path in outputs if path.suffix.lower() in OF_HOUR]
    if hour is not None and not files:
        raise InputError(f"--hour needs an output {', '.join(OF_HOUR)}")
    result = mi_lcair.heat(description)
    at_hour = dict.fromkeys(files, partial(result.save, hour=hour))
    write_and_print(result, dict.fromkeys(outputs, result.save) | at_hour)
    from mi_lcair.heating.temperatures.description import HeatDescription

    return {"target": HeatDescription.read(description).target.scene}


# mi-lcair pose: where a camera is, from points and their pixels
# --------------------------------------------------------------


@options.command(
    "pose",
    "mi-lcair pose box.toml corners.csv -D pose.yaw_deg=0 -o seen.toml",
    "mi-lcair image seen.toml --spp 4 -o seen.exr",
)
@click.argument("scenario")
@click.argument("points", type=options.FILE, metavar="POINTS.csv")
@options.changes("Change an entry of the scenario, such as camera.focal_length_mm=50", "parameters")
@options.outputs(
    "the scenario with this camera, or a table of it", ".toml", ".csv", ".json", ".html", ".nc"
)
@options.renderer
@options.calls("pose", sigma_px={"flag": "--sigma"})
def pose_command():
    """Find the position of a camera from points in an image.

    SCENARIO is a TOML file with a table [camera]. POINTS.csv has the columns x_m, y_m, z_m,
    column_px and row_px. Each row is a point in the scene's axes, such as a corner of a facet, and
    its position in the frame. The frame's upper left corner is (0, 0). Four or more points are
    needed. The command prints the camera's position and pointing with 95 % intervals, in m and
    degrees. Use FILE.toml in `image` and `invert`.
    """
