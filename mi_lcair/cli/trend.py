"""mi-lcair trend: intensity as a function of the aspect."""

from math import isfinite

import click

import mi_lcair
from mi_lcair.cli import options
from mi_lcair.cli.output import write_and_print

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
@options.option(
    "--resolution",
    "Pixels along each side of a view, to which --spp and --max-spp refer. The paths begin "
    "anywhere in the view.",
    options.POSITIVE,
    default=64,
)
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
def command(scene, azimuth, elevation, output, plot, areas, overwrite, **settings):
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
