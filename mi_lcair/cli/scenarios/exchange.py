"""mi-lcair exchange: radiative conductors between the facets of a scene."""

import mi_lcair
from mi_lcair.cli import options
from mi_lcair.cli.output import time_row, write_and_print
from mi_lcair.drawing import PICTURES
from mi_lcair.formats import VTK

SUFFIXES = (".csv", ".json", ".html", ".nc", *PICTURES, *VTK)


@options.command(
    "exchange",
    "mi-lcair exchange box/scene.xml --sky-K 250 --ground-K 290 -o facets.csv",
    "mi-lcair exchange box/scene.xml --sun 40 120 -o exchange.nc",
)
@options.loading
@options.option(
    "--paths", "Number of paths of each side of a facet (default: 1024).", options.POSITIVE
)
@options.option("--sky-K sky_K", "Temperature of the sky, for irradiances [K].", float)
@options.option("--ground-K ground_K", "Temperature of the ground [K].", float)
@options.option(
    "--sun sun_deg",
    "Position of the sun in degrees, for the sunlight that facets absorb.",
    float,
    nargs=2,
    metavar="ELEVATION AZIMUTH",
)
@options.output(
    "the facets (.csv, .json, .html, .vtp, .vtu), the facets and the sparse matrix of their "
    "conductors (.nc), or a picture (.png, .svg, .pdf)",
    SUFFIXES,
)
def command(scene, paths, sky_K, ground_K, sun_deg, output):
    """Heat that the facets of SCENE exchange by radiation.

    Printed are for each group the shares of what it emits that reach sky, ground, itself and other
    groups, and the conductors GR in m^2 between groups: the heat flow is GR sigma (T1^4 - T2^4).
    All values have standard errors.
    """
    arguments = {"paths": paths, "sky_K": sky_K, "ground_K": ground_K, "sun_deg": sun_deg}
    loaded = scene.load(with_sensors=False, with_nothing=False)  # what escapes has its place
    result = mi_lcair.exchange(loaded, **scene.sampling, **options.given(arguments))
    write_and_print(result, {output: result.save}, [time_row(result)])
