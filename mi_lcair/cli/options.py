"""Options that commands share or take from public functions, and what carries them out."""

import ast
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, wraps
from importlib.util import find_spec
from pathlib import Path

import click

import mi_lcair
from mi_lcair import scenes
from mi_lcair.cli import completion
from mi_lcair.cli.output import JSON, QUIET, flag_option, is_set, note, print_notes
from mi_lcair.declared import fraction, listed
from mi_lcair.drawing import PICTURES
from mi_lcair.errors import InputError
from mi_lcair.files import check_suffix, check_writable

VARIANTS = ("llvm_ad_mono", "cuda_ad_mono")
POSITIVE = click.IntRange(min=1)
FILE = click.Path(path_type=Path)
MAX_SPP = "Largest --spp for --tolerance (default: 65536)."
# Arguments that let the renderer choose the number of samples. None of them goes with --spp.
CHOOSING = ("tolerance", "tolerance_W_m2", "max_spp")
CHOICE = ("tolerance", "max_spp")


@dataclass
class SceneOptions:
    """Options of a command with a SCENE.

    Attributes
    ----------
    scene : str
        Mitsuba XML file or name of a bundled scene.
    parameters : dict of str to str
        $-parameters of the scene.
    sampling : dict
        Keyword arguments of the function that `run` calls, such as seed and spp.
    solution : str or None
        Solution's file, and behind a colon a state.
    motions : Path or None
        TOML file with motions.
    """

    scene: str
    parameters: dict[str, str]
    sampling: dict
    solution: str | None = None
    motions: Path | None = None

    def __post_init__(self):
        scenes.file_of(self.scene)  # before the renderer is imported, which takes its time

    def run(self, function, **arguments):
        """Load the scene and return function(scene, **sampling, **arguments, progress=...).

        Remarks and the progress bar go to stderr.
        """
        scene = self.load()
        with progress_bar() as progress:
            return function(scene, **self.sampling, **arguments, progress=progress)

    def load(self, with_sensors: bool = True, with_nothing: bool = True):
        """Load the scene, and print its remarks on stderr.

        Without `with_sensors`, remarks on the scene's sensors are left out, and without
        `with_nothing` those on what is reflected of an empty space.
        """
        scene = mi_lcair.load(self.scene, **given({"motions": self.motions}), **self.parameters)
        if self.solution:
            self.apply_solution(scene)
        left_out = () if with_nothing else scene.of_nothing
        for remark in scene.remarks if with_sensors else scene.notes:
            if remark not in left_out:
                note(remark)
        return scene

    def apply_solution(self, scene) -> None:
        """Set the scene's parameters to those of the solution's file, and print their names."""
        from mi_lcair.rendering.parameters.values import apply_solution

        note(f"{self.solution}: sets {', '.join(apply_solution(scene, self.solution))}")


def read_scenario(name: str, changes: Mapping):
    """The Scenario with changes of its entries; raises InputError if its scene does not exist.

    name: TOML file or name of a bundled scenario. changes: values by dotted key.
    """
    from mi_lcair.detection.scenario import Scenario

    scenario = Scenario.read(name, **changes)
    scenario.check_scene()  # before the renderer is imported, which takes its time
    return scenario


def given(options: dict, prefix: str = "") -> dict:
    """The options that were given, by their names behind a prefix."""
    return {f"{prefix}{name}": value for name, value in options.items() if value is not None}


def prepare_renderer(variant: str | None, threads: int | None, plugins: tuple[Path, ...]) -> None:
    """Set Mitsuba's variant and the number of CPU threads, if they are given, and run plugins."""
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
        import mitsuba  # noqa: F401  its import sets the number of threads on one core

        drjit.set_thread_count(threads)
    if plugins:
        from mi_lcair.rendering.loading.parsing import run_plugin_files

        run_plugin_files(plugins)


@contextmanager
def progress_bar(unit="spp"):
    """Context manager: progress(done, total) draws a bar on stderr if that is a terminal.

    `unit` labels the bar; "spp" are samples per pixel.
    """
    from tqdm import tqdm

    # None draws the bar on a terminal only
    with tqdm(unit=unit, disable=True if is_set(QUIET) else None, leave=False) as bar:

        def progress(done, total):
            print_notes()
            bar.n, bar.total = done, total
            bar.refresh()

        yield progress


class Fraction(click.ParamType):
    """A fraction between 0 and 1, written 0.01 or 1%."""

    name = "fraction"

    def convert(self, value, param, ctx):
        try:
            return fraction(value)
        except InputError as error:
            self.fail(str(error), param, ctx)


class Assignment(click.ParamType):
    """key=value, as a pair of strings."""

    name = "key=value"

    def convert(self, value, param, ctx):
        key, equals, text = value.partition("=")
        if not (key and equals):
            self.fail(f"'{value}' is not of the form key=value", param, ctx)
        return key, text


class Output(click.Path):
    """Path of a file to write, which can be written and ends in one of the suffixes, if any."""

    def __init__(self, suffixes=()):
        super().__init__(path_type=Path)
        self.suffixes = suffixes

    def convert(self, value, param, ctx):
        path = super().convert(value, param, ctx)
        if self.suffixes:
            check_suffix(path, self.suffixes)
            check_writable(path)
        return path


def option(names: str, help: str, type=None, **settings):
    """Decorator that gives a command an option, with the arguments of click.option.

    names: its names with blanks between them, such as "-s --sensor".
    """
    return click.option(*names.split(), type=type, help=help, **settings)


# Entry of a NumPy docstring: names, and the indented lines below them
ENTRY = re.compile(r"^(\w[\w, ]*?)(?: : .*)?\n((?: {4}.*(?:\n|\Z))+)", re.MULTILINE)


@cache
def parameters(function: str) -> dict[str, tuple[str, object, str]]:
    """Annotation, default and description of each parameter of a public function.

    They are read from its source, because its import takes its time. The default is `...` if there
    is none. Keywords that a TypedDict declares follow the others.
    """
    home = Path(mi_lcair.__file__).parent.parent / mi_lcair._HOME[function].replace(".", "/")
    module = ast.parse(home.with_suffix(".py").read_text("utf-8"))
    named = {node.name: node for node in module.body if hasattr(node, "name")}
    constants = {
        node.targets[0].id: node.value
        for node in module.body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
    }
    texts = {
        name.strip(): " ".join(text.split())
        for names, text in ENTRY.findall(ast.get_docstring(named[function]))
        for name in names.split(",")
    }
    given = named[function].args
    defaults = [None] * (len(given.args) - len(given.defaults)) + given.defaults
    pairs = [*zip(given.args, defaults), *zip(given.kwonlyargs, given.kw_defaults)]
    read = {
        argument.arg: (
            ast.unparse(argument.annotation),
            ... if node is None else ast.literal_eval(constants.get(ast.unparse(node), node)),
        )
        for argument, node in pairs
    }
    if given.kwarg:
        declared = named[ast.unparse(given.kwarg.annotation.slice)].body
        fields = [node for node in declared if isinstance(node, ast.AnnAssign)]
        read |= {node.target.id: (ast.unparse(node.annotation), None) for node in fields}
    return {name: (*values, texts.get(name, "")) for name, values in read.items()}


def flag_of(parameter: str) -> str:
    """The option for a parameter of this name."""
    return f"--{parameter.replace('_', '-')}"


def of(function: str, *names: str, **settings: dict):
    """Decorator that gives a command options for these parameters of a public function.

    Name, type, default and help follow from the function's signature and its docstring. settings:
    arguments of click.option by parameter, for what does not follow, and "flag" for another name.
    """

    def decorator(command):
        for name in reversed(list(dict.fromkeys((*names, *settings)))):
            annotation, default, text = parameters(function)[name]
            kind = annotation.removesuffix(" | None")
            declared = {"help": re.sub("`(\\w+)`", lambda match: flag_of(match[1]), text)}
            if default is ...:
                declared["required"] = True
            elif default is not None:
                declared["default"] = default
            if kind == "int":
                least = 0 if default == 0 else 1
                declared["type"] = click.IntRange(least, 2**32 - 1 if name == "seed" else None)
            elif kind.startswith("Literal"):
                declared["type"] = click.Choice(ast.literal_eval(kind.removeprefix("Literal")))
            elif kind in ("float", "Sequence[float]"):
                declared["type"] = float
            elif kind == "bool":
                declared["is_flag"] = True
            elif kind == "str | PathLike[str]":
                declared["type"] = Output(re.findall(r"FILE(\.\w+)", text))
                declared["metavar"] = "FOLDER" if text.startswith("Folder") else "FILE"
            elif kind != "str":
                declared["metavar"] = kind.split()[-1].upper()
            declared |= settings.get(name, {})
            flag = declared.pop("flag", flag_of(name))
            command = click.option(flag, name, **declared)(command)
        return command

    return decorator


json = flag_option(JSON, "--json", help="Print the results as JSON.")


def renderer(command):
    """Give a command --variant, -t, --plugin and --json, and prepare the renderer before it."""

    @option("--variant", f"Mitsuba variant (default: {VARIANTS[0]}).", click.Choice(VARIANTS))
    @option("-t --threads", "CPU threads (default: all).", POSITIVE)
    @file(
        "--plugin",
        "Run a Python file that registers your BSDFs or emitters with Mitsuba, FILE.py; may be "
        "repeated.",
        multiple=True,
    )
    @json
    @wraps(command)
    def prepared(variant, threads, plugin, **arguments):
        prepare_renderer(variant, threads, plugin)
        return command(**arguments)

    return prepared


def workers(command):
    """Give a command --workers and --dask, and run it within `mi_lcair.workers`."""

    @option("--workers", "Work in this number of processes.", POSITIVE)
    @option("--dask", "Work on the workers of this Dask scheduler.", metavar="ADDRESS")
    @wraps(command)
    def on_workers(workers, dask, **arguments):
        with mi_lcair.workers(workers, dask):
            return command(**arguments)

    return on_workers


overwrite = option("--overwrite", "Replace an output that exists.", is_flag=True)


@contextmanager
def kept_areas(output: Path, areas: Path | None, overwrite: bool) -> Iterator[Path | None]:
    """Context manager that gives the folder of --areas; without one, a folder beside the output.

    That folder is removed if all goes well. None if xarray, which writes it, is not installed.
    Raises InputError if the output exists and is not to be replaced.
    """
    if output.exists() and not overwrite:
        raise InputError(f"output '{output}' exists; give --overwrite, or name another file")
    if areas is not None or find_spec("xarray") is None:
        yield areas
        return
    from mi_lcair.detection.sweeps.subject import AreasFolder

    yield (folder := Path(f"{output}.areas"))
    AreasFolder(folder).clear()


sensor = option(
    "-s --sensor", "Number of the scene's sensor, from 0.", click.IntRange(min=0), default=0
)


def seed(help: str = "Seed of the random numbers."):
    """Decorator that gives a command the option --seed."""
    return option("--seed", help, click.IntRange(0, 2**32 - 1), default=0)


def changes(help: str, name: str = "changes"):
    """Decorator that gives a command the option -D key=value.

    The command receives the pairs as its argument `name`.
    """
    return click.option(
        "-D",
        name,
        type=Assignment(),
        multiple=True,
        shell_complete=completion.keys,
        help=f"{help}; may be repeated.",
    )


def sampling(spp: str, tolerance: str, max_spp: str | None = None):
    """Decorator that gives a command --spp, --tolerance and --max-spp, with these help texts.

    In every command --spp sets the number of samples, and a tolerance lets the renderer choose it.
    Both together are refused. Without a text for max_spp there is no such option.
    """

    def decorator(command):
        @wraps(command)
        def checked(**values):
            chosen = [flag_of(name) for name in CHOOSING if values.get(name) is not None]
            if values["spp"] is not None and chosen:
                problem = "--spp sets a fixed number of samples; {} cannot go with it"
                raise click.UsageError(problem.format(listed(chosen)), click.get_current_context())
            return command(**values)

        if max_spp:
            checked = option("--max-spp", max_spp, POSITIVE)(checked)
        checked = option("--tolerance", tolerance, Fraction())(checked)
        return option("--spp", spp, POSITIVE)(checked)

    return decorator


def check_max_spp(max_spp, tolerance, **others) -> None:
    """Raise UsageError for a largest number of samples without a tolerance."""
    if max_spp and not tolerance:
        problem = "--max-spp needs --tolerance; --spp sets a fixed number of samples"
        raise click.UsageError(problem, click.get_current_context())


def check_given(ctx: click.Context, names, what: str) -> None:
    """Raise UsageError if an option beside `names` was given, which does not go with `what`."""
    for parameter in ctx.command.params:
        given = ctx.get_parameter_source(parameter.name) is click.core.ParameterSource.COMMANDLINE
        if given and parameter.name not in (*names, "quiet"):
            raise click.UsageError(f"{parameter.opts[-1]} does not go with {what}", ctx)


def output(what: str, suffixes=(), metavar: str = "FILE", **settings):
    """Decorator that gives a command the option -o. `what` is written, and to which file.

    suffixes: of the file; without any it is not checked. settings: further arguments of
    click.option.
    """
    help, kind = f"Write {what}.", Output(suffixes)
    return click.option("-o", "--output", type=kind, metavar=metavar, help=help, **settings)


def file(name: str, help: str, suffixes=(), metavar: str = "FILE", **settings):
    """Decorator that gives a command an option whose value is a path.

    suffixes: those of a file to write; without any it is not checked.
    """
    return click.option(name, type=Output(suffixes), metavar=metavar, help=help, **settings)


def plot(what: str):
    """Decorator that gives a command the option --plot FILE."""
    return file("--plot", f"Draw {what}, FILE.png, .svg or .pdf.", PICTURES)


areas = file(
    "--areas",
    "Keep what is traced in this folder. A later call that finds it there traces nothing again "
    "(default: FILE.areas, which is removed at the end).",
    metavar="FOLDER",
)


solution = option(
    "--solution",
    "Set temperatures, materials and radiances to those of a file that invert wrote, FILE.json or "
    "FILE.json:STATE.",
)
motions = file("--motions", "Declare motions of meshes, which -D then sets, FILE.toml.")


def scenario(example: str, spp: str, tolerance: str):
    """Decorator that gives a command the argument SCENARIO and the options of a measurement.

    The command receives the Scenario with all changes of its entries as `scenario`. `example` is an
    entry that -D changes; `spp` and `tolerance` are help texts.
    """

    def decorator(command):
        command = renderer(command)

        @click.argument("scenario", shell_complete=completion.scenarios)
        @changes(f"Change an entry of the scenario, such as {example}")
        @sampling(spp, tolerance, MAX_SPP)
        @solution
        @wraps(command)
        def with_scenario(scenario, changes, solution, **arguments):
            sampling = {name: arguments.pop(name, None) for name in ("spp", *CHOOSING)}
            changes = dict(changes) | given(sampling, "render.")
            changes |= given({"target.solution": solution or None})
            return command(scenario=read_scenario(scenario, changes), **arguments)

        return with_scenario

    return decorator


max_bounces = option(
    "--max-bounces",
    "Largest number of reflections. With auto, pilot paths choose it, so that at most a tenth "
    "of --tolerance (1%) is left out.",
    metavar="N|auto",
)


def scene(spp: str, tolerance: str):
    """Decorator that gives a command the argument SCENE and the options of a render.

    The command receives them as one argument `scene`, a SceneOptions. `spp` and `tolerance` are
    the help texts of these options: what they mean for the command.
    """

    def decorator(command):
        @sensor
        @sampling(spp, tolerance, MAX_SPP)
        @max_bounces
        @wraps(command)
        def with_sampling(scene, max_bounces, **arguments):
            sampling = {name: arguments.pop(name) for name in ("sensor", "spp", *CHOICE)}
            check_max_spp(**sampling)
            scene.sampling |= sampling | given({"max_bounces": max_bounces})
            return command(scene=scene, **arguments)

        return loading(with_sampling)

    return decorator


def loading(command):
    """Give a command the argument SCENE and the options that every scene needs.

    The options of sampling are not included. The command receives a SceneOptions, as with `scene`.
    """
    command = renderer(command)

    @click.argument("scene", shell_complete=completion.scenes)
    @changes(
        "Set a $-parameter of the scene, or one that mi_lcair.parameters lists, such as "
        "model.yaw_deg",
        "parameters",
    )
    @seed()
    @solution
    @motions
    @wraps(command)
    def with_scene(parameters, seed, **arguments):
        names = "scene", "solution", "motions"
        of_scene = {name: arguments.pop(name) for name in names}
        given = SceneOptions(parameters=dict(parameters), sampling={"seed": seed}, **of_scene)
        return command(scene=given, **arguments)

    return with_scene


def command(name: str, *lines: str, **settings):
    """Decorator that makes a function the command of this name, with these example lines.

    settings: further arguments of click.command.
    """
    return click.command(name, epilog=examples(*lines), **settings)


def examples(*lines: str) -> str:
    """The epilog of a command: its example lines, which the help does not wrap.

    They run in a folder with copies of scenes/examples, in the order of the commands in the help.
    """
    return "\n".join(["\b", "Examples:", *(f"  {line}" for line in lines)])
