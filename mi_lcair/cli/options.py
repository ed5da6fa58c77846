"""The options that every command with a SCENE shares, and what they set in motion: variant,
threads, load, progress.
"""

from contextlib import contextmanager
from dataclasses import dataclass
from functools import wraps

import click

import mi_lcair
from mi_lcair.cli.output import note
from mi_lcair.errors import InputError

VARIANTS = ("llvm_ad_mono", "cuda_ad_mono")
POSITIVE = click.IntRange(min=1)
DEFAULT_TOLERANCE = 0.01


@dataclass
class SceneOptions:
    """What the user asked of a scene; `sampling` holds the keywords of the function that will run."""

    scene: str
    parameters: dict[str, str]
    sampling: dict
    variant: str | None
    threads: int | None
    json: bool
    plan: object = None

    def run(self, function, **own):
        """Load the scene and return function(scene, **sampling, **own, progress=...); remarks and
        progress go to stderr.
        """
        scene = self.load()
        with progress_bar() as progress:
            return function(scene, **self.sampling, **own, progress=progress)

    def run_planned(self, function, each_pixel: bool, **own):
        """As `run`, but where --plan was given find one first, keep it as `plan`, and follow it."""
        if self.plan is None:
            return self.run(function, **own)
        scene, sampling = self.load(), dict(self.sampling)
        tolerance = sampling.pop("tolerance") or DEFAULT_TOLERANCE
        with progress_bar("probes") as progress:
            self.plan = mi_lcair.plan(
                scene, tolerance, each_pixel, sampling["seed"], sampling["sensor"], progress
            )
        with self.plan.applied(scene), progress_bar() as progress:
            return function(scene, **(sampling | {"spp": self.plan.spp}), **own, progress=progress)

    def planned(self) -> dict:
        """The plan that was followed, for JSON: an entry `plan`, or none."""
        return {"plan": self.plan.as_dict()} if self.plan else {}

    def load(self, own_sensors: bool = True):
        """The scene, with variant and threads set; remarks go to stderr, those on its own sensors
        only if they will be used.
        """
        prepare_renderer(self.variant, self.threads)
        scene = mi_lcair.load(self.scene, **self.parameters)
        for remark in scene.remarks if own_sensors else scene.notes:
            note(remark)
        return scene


def prepare_renderer(variant: str | None, threads: int | None) -> None:
    """Sets Mitsuba's variant and the number of CPU threads, where asked for."""
    if variant:
        import mitsuba

        try:
            mitsuba.set_variant(variant)
        except ImportError as error:
            raise InputError(
                f"variant '{variant}' cannot start on this machine (cuda_ad_mono needs an NVIDIA "
                f"GPU and its driver); leave it out or use {VARIANTS[0]}"
            ) from error
    if threads:
        import drjit

        drjit.set_thread_count(threads)


@contextmanager
def progress_bar(unit="spp"):
    """A callable progress(done, total), by default in samples per pixel, that draws a bar on stderr
    when that is a terminal.
    """
    from tqdm import tqdm

    with tqdm(unit=unit, disable=None, leave=False) as bar:

        def progress(done, total):
            bar.n, bar.total = done, total
            bar.refresh()

        yield progress


class Fraction(click.ParamType):
    """A fraction between 0 and 1, written 0.01 or 1%."""

    name = "fraction"

    def convert(self, value, param, ctx):
        number, percent, rest = value.partition("%")
        try:
            fraction = float(number) / (100 if percent else 1)
        except ValueError:
            fraction = 0
        if rest.strip() or not 0 < fraction < 1:
            self.fail(
                f"'{value}' is not a fraction between 0 and 1, such as 0.01 or 1%", param, ctx
            )
        return fraction


class Assignment(click.ParamType):
    """key=value, as a pair of strings."""

    name = "key=value"

    def convert(self, value, param, ctx):
        key, equals, text = value.partition("=")
        if not (key and equals):
            self.fail(f"'{value}' is not of the form key=value", param, ctx)
        return key, text


def json_option(command):
    """--json, for every command that prints results."""
    return click.option("--json", is_flag=True, help="Print the results as JSON.")(command)


def renderer_options(command):
    """--variant and -t, for commands that render; see prepare_renderer."""
    threads = click.option("-t", "--threads", type=POSITIVE, help="CPU threads (default: all).")
    return click.option(
        "--variant", type=click.Choice(VARIANTS), help=f"Mitsuba variant (default: {VARIANTS[0]})."
    )(threads(command))


def sensor_option(command):
    """-s, for commands that look through a sensor."""
    return click.option(
        "-s",
        "--sensor",
        type=click.IntRange(min=0),
        default=0,
        show_default=True,
        help="Which of the scene's sensors, counted from 0.",
    )(command)


def scene_options(command):
    """Give a command SCENE and the options of a render; it receives them as one argument `options`,
    a SceneOptions.
    """

    @sensor_option
    @click.option("--spp", type=POSITIVE, help="Samples per pixel (default: the scene's own).")
    @click.option(
        "--tolerance",
        type=Fraction(),
        help="Render until the rms standard error is below this fraction of the mean, such as 0.01 or 1%.",
    )
    @click.option(
        "--max-spp",
        type=POSITIVE,
        help="Where --tolerance gives up, in samples per pixel (default: 65536).",
    )
    @click.option(
        "--plan",
        type=click.Choice(["auto"]),
        help="Let probes choose lobes, reflections, closure, emitter sampling and samples for --tolerance (1%).",
    )
    @wraps(command)
    def with_sampling(options, sensor, spp, tolerance, max_spp, plan, **own):
        if max_spp and not tolerance:
            raise click.UsageError(
                "--max-spp needs --tolerance; --spp sets a fixed number of samples",
                click.get_current_context(),
            )
        if plan and (spp or max_spp):
            raise click.UsageError(
                "--plan chooses the samples per pixel; --spp and --max-spp do not go with it",
                click.get_current_context(),
            )
        options.plan = plan
        options.sampling |= dict(sensor=sensor, spp=spp, tolerance=tolerance, max_spp=max_spp)
        return command(options=options, **own)

    return loading_options(with_sampling)


def loading_options(command):
    """Give a command SCENE and what every scene takes, without the sampling of a sensor; as
    `scene_options` does.
    """

    @click.argument("scene")
    @click.option(
        "-D",
        "parameters",
        type=Assignment(),
        multiple=True,
        help="Set a $-parameter of the scene; may be repeated.",
    )
    @click.option(
        "--seed",
        type=click.IntRange(0, 2**32 - 1),
        default=0,
        show_default=True,
        help="Seed of the random numbers.",
    )
    @renderer_options
    @json_option
    @wraps(command)
    def with_scene(scene, parameters, variant, threads, json, seed, **own):
        return command(
            options=SceneOptions(scene, dict(parameters), dict(seed=seed), variant, threads, json),
            **own,
        )

    return with_scene
