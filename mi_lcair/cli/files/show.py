"""mi-lcair show: pictures of what the commands read and write."""

import click

from mi_lcair.cli import completion, options
from mi_lcair.cli.files import pictures
from mi_lcair.drawing import PICTURES
from mi_lcair.errors import InputError

FACET, COLUMNS, PIXEL, TWO = "--facet", "--facets", "--pixel", "two images"


@options.command(
    "show",
    "mi-lcair show open_box.exr -o open_box.png",
    "mi-lcair show gloss_black --band LWIR -o brdf.png",
)
@click.argument("what", nargs=-1, required=True, metavar="WHAT", shell_complete=completion.pictured)
@options.output("the picture, FILE.png, .svg or .pdf (default: named after WHAT)", PICTURES)
@options.option(
    "-c --channel channels",
    "Channel of FILE.exr (default: Y or temperature.Y) or column of FILE.csv, or a pattern "
    "such as 'bounce*'; may be repeated.",
    multiple=True,
)
@options.option("--log", "Logarithmic colours.", is_flag=True)
@options.option("--vmin", "Value at the lower end of the colour scale.", float)
@options.option("--vmax", "Value at the upper end of the colour scale.", float)
@options.option("--cmap", "Colour map of Matplotlib, such as gray or viridis.", metavar="NAME")
@options.option(
    "--common-scale/--own-scales",
    "One scale for all panels of a quantity (default), or one for each panel.",
    default=True,
    show_default=False,
)
@options.option("--outlines", "Draw lines between the facets.", is_flag=True)
@options.option("--scene", "With --outlines: the scene of FILE.exr, if it is not a bundled one.")
@options.option(
    "--facet",
    "Number of the facet whose view is shown, from 0.",
    click.IntRange(min=0),
    metavar="N",
)
@options.option(
    "--facets",
    "Table with a column `facet` and others to colour the facets by.",
    options.FILE,
    metavar="FILE.csv",
)
@options.option(
    "--pixel",
    "Pixel of a spectral image whose spectrum is drawn, from 0 at the upper left.",
    (int, int),
    metavar="ROW COLUMN",
)
@options.changes("Set a $-parameter of the scene, or change an entry of the scenario", "parameters")
@options.sensor
@options.option("--band", "Band (default: that of a fit of one band, or MWIR).")
@options.option("--materials", "Your own materials.", options.FILE, metavar="TOML")
@options.option(
    "--theta-deg",
    "Angle of incidence in degrees.",
    click.FloatRange(0, 90, max_open=True),
    default=30,
)
@options.json
@click.pass_context
def command(ctx, what, output, **settings):
    """Write a picture of WHAT.

    WHAT is one of these, with its options:

    \b
    FILE.exr                            channels of an image
    FILE.exr FILE.exr                   two images with one scale, and their
                                        difference
    FILE.exr --pixel ROW COLUMN         the spectrum of a pixel of an image
                                        that render --bins has written
    FILE.csv, FILE.nc                   a trend, or a spectrum of a signature
    FILE.json                           a solution of invert, a budget, or a
                                        contrast
    SCENE, MODEL.obj, FOLDER            three views of a model; FOLDER is
                                        what import wrote
    SCENE --facet N                     what a facet sees, its neighbours'
                                        solid angles and view factors
    SCENE --facets FILE.csv -c COLUMN   the facets, coloured by a table
    SCENARIO.toml                       what it states, and its target
    MATERIAL --band BAND                the BRDF over the hemisphere
    260K,300K --band BAND               spectra of blackbodies
    AIR --band BAND                     transmittance and path radiance of
                                        clear air, such as us_standard
    SKY --band BAND                     a sky by wavelength and elevation,
                                        such as us_standard_clear
    """
    if len(what) == 1:
        (what,) = what
    kind = _kind(
        what, **{name: settings[name] for name in ("facet", "facets", "materials", "pixel")}
    )
    draw, names = _drawn(kind)
    options.check_given(ctx, ("what", "output", *names), kind)
    if settings["scene"] and not settings["outlines"]:
        raise InputError("--scene names the scene whose facets --outlines draws; give that too")
    draw(what, output, **{name: settings[name] for name in names if name in settings})


def _kind(what, facet, facets, materials, pixel) -> str:
    """What is drawn, a kind or an option; raises InputError for what has no picture."""
    from mi_lcair.formats.kinds import IMAGE, KINDS, kind_of

    if isinstance(what, tuple):
        if len(what) > 2 or {kind_of(file, materials) for file in what} != {IMAGE}:
            raise InputError("show takes one WHAT, or two images (.exr) to compare")
        return TWO
    if facet is not None or facets is not None:
        return COLUMNS if facet is None else FACET
    kind = kind_of(what, materials)
    if kind == IMAGE and pixel is not None:
        return PIXEL
    if not KINDS[kind].drawn:
        raise InputError(f"'{what}' is {kind}; {KINDS[kind].hint.format(what)}")
    return kind


def _drawn(kind: str):
    """The function that draws a kind, or for an option, and its options beside --output."""
    from mi_lcair.formats.kinds import KINDS, SCALE

    special = {
        FACET: (pictures.facet_view, ("facet", "parameters", "json")),
        COLUMNS: (pictures.facet_columns, ("facets", "channels", *SCALE, "parameters", "sensor")),
        PIXEL: (pictures.pixel_spectrum, ("pixel",)),
        TWO: (pictures.comparison, ("channels", *SCALE[:-1])),
    }
    if kind in special:
        return special[kind]
    return getattr(pictures, KINDS[kind].drawn), KINDS[kind].options
