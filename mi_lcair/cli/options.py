"""Options that commands share or take from public functions, and what carries them out."""

import ast
import re
from collections.abc import Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, wraps
from importlib.util import find_spec
from inspect import signature
from pathlib import Path

import click

import mi_lcair
from mi_lcair import scenes
from mi_lcair.cli import completion
from mi_lcair.cli.output import (
    CHOOSING,
    JSON,
    QUIET,
    Called,
    flag_option,
    is_set,
    note,
    print_notes,
    write_and_print,
)
from mi_lcair.declared import fraction
from mi_lcair.errors import InputError
from mi_lcair.files import check_suffix, check_writable
from mi_lcair.startup import VARIANTS

FILE = click.Path(path_type=Path)


class WholeNumber(click.IntRange):
    """A whole number within bounds."""

    def convert(self, value, param, ctx):
        try:
            int(value)
        except ValueError:
            self.fail(f"'{value}' is not a whole number", param, ctx)
        return super().convert(value, param, ctx)


POSITIVE = WholeNumber(min=1)


@dataclass
class SceneOptions:
    """Options of a command with a SCENE.

    Attributes
    ----------
    scene : str
        Mitsuba XML file or name of a bundled scene.
    parameters : dict of str to str
        $-parameters of the scene.
    solution : str or None
        Solution's file, and behind a colon a state.
    motions : Path or None
        TOML file with motions.
    """

    scene: str
    parameters: dict[str, str]
    solution: str | None = None
    motions: Path | None = None

    def __post_init__(self):
        scenes.file_of(self.scene)  # before the renderer is imported, which takes its time

    def run(self, function, **arguments):
        """Load the scene and return function(scene, **arguments, progress=...).

        Remarks and the progress bar go to stderr.
        """
        scene = self.load()
        with progress_bar() as progress:
            return function(scene, **arguments, progress=progress)

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

        note(f"{self.solution}: sets {', '.join(apply_solution(scene, self.solution))}", "note")


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
                "GPU and its driver, metal_ad_mono an Apple GPU); leave it out or use "
                f"{VARIANTS[0]}"
            ) from error
    if threads:
        import drjit
        import mitsuba  # noqa: F401  its import sets the number of threads on one core

        drjit.set_thread_count(threads)
    if plugins:
        from mi_lcair.rendering.loading.parsing import run_plugin_files

        mi_lcair.trust(*plugins)
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

AS_FOR = re.compile(r"^As for `(\w+)`[.;]?")  # in place of a text: that of another function


@cache
def parameters(function: str) -> dict[str, tuple[str, object, str]]:
    """Annotation, default and description of each parameter of a public function.

    They are read from its source, because its import takes its time. The default is `...` if there
    is none. Keywords that a TypedDict declares follow the others. function: its name, or that of
    any function or dataclass as "module:name".
    """
    place, _, name = function.rpartition(":")
    home = Path(mi_lcair.__file__).parent.parent / (place or mi_lcair._HOME[name]).replace(".", "/")
    module = ast.parse(home.with_suffix(".py").read_text("utf-8"))
    named = {node.name: node for node in module.body if hasattr(node, "name")}
    constants = {
        node.targets[0].id: node.value
        for node in module.body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
    }
    texts = {
        name: AS_FOR.sub(lambda as_for: parameters(as_for[1])[name][2], " ".join(text.split()))
        for names, text in ENTRY.findall(ast.get_docstring(named[name]))
        for name in names.split(", ")
    }
    read, declared = {}, named[name]
    if isinstance(declared, ast.FunctionDef):
        given = declared.args
        defaults = [None] * (len(given.args) - len(given.defaults)) + given.defaults
        pairs = [*zip(given.args, defaults), *zip(given.kwonlyargs, given.kw_defaults)]
        read = {
            argument.arg: (
                ast.unparse(argument.annotation),
                ... if node is None else ast.literal_eval(constants.get(ast.unparse(node), node)),
            )
            for argument, node in pairs
        }
        declared = given.kwarg and named[ast.unparse(given.kwarg.annotation.slice)]
    if declared:
        fields = [node for node in declared.body if isinstance(node, ast.AnnAssign)]
        read |= {node.target.id: (ast.unparse(node.annotation), None) for node in fields}
    return {name: (*values, texts.get(name, "")) for name, values in read.items()}


def flag_of(parameter: str) -> str:
    """The option for a parameter of this name."""
    return f"--{parameter.replace('_', '-')}"


def of(function: str, *names: str, **settings: dict):
    """Decorator that gives a command options for these parameters of a function, see `parameters`.

    Name, type, default and help follow from the function's signature and its docstring. settings:
    arguments of click.option by parameter, for what does not follow, and "flag" for another name.
    """

    def decorator(command):
        for name in reversed(list(dict.fromkeys((*names, *settings)))):
            annotation, default, text = parameters(function)[name]
            own = settings.get(name, {})
            kind = annotation.removesuffix(" | None")
            declared = {"help": re.sub("`(\\w+)`", lambda match: flag_of(match[1]), text)}
            if default is ...:
                declared["required"] = True
            elif default is not None:
                declared["default"] = default
            if kind == "int":
                least = 0 if name in ("seed", "sensor") or default == 0 else 1
                declared["type"] = WholeNumber(least, 2**32 - 1 if name == "seed" else None)
            elif kind.startswith("Literal"):
                declared["type"] = click.Choice(ast.literal_eval(kind.removeprefix("Literal")))
            elif kind == "float | str":
                declared["type"] = Fraction()
            elif kind == "int | str":
                declared["metavar"] = "N|auto"
            elif kind in ("float", "Sequence[float]"):
                declared["type"] = float
            elif kind == "bool":
                declared["is_flag"] = True
            elif kind == "str | PathLike[str]":
                declared["type"] = Output(re.findall(r"FILE(\.\w+)", text))
                declared["metavar"] = "FOLDER" if text.startswith("Folder") else "FILE"
            elif kind != "str" and "type" not in own:
                declared["metavar"] = kind.split()[-1].upper().removesuffix("LIKE")
            declared |= own
            flag = declared.pop("flag", "-s --sensor" if name == "sensor" else flag_of(name))
            command = click.option(*flag.split(), name, **declared)(command)
        return command

    return decorator


# Parameters that are options wherever the function of a command has them
SAMPLING = ("sensor", "spp", *CHOOSING, "max_bounces", "seed")


def sampling(function: str, *names: str, **settings: dict):
    """Decorator that gives a command the options of the sampling, and others as `of` does."""
    known = [name for name in SAMPLING if name in parameters(function)]
    return of(function, *names, *known, **settings)


def calls(function: str, *names: str, unit: str = "spp", load=None, **settings: dict):
    """Decorator that gives a command its body: call a public function, print and write its result.

    names, settings: parameters that are options, as for `sampling`. A SceneOptions is loaded, with
    the arguments `load`, and progress is drawn in `unit`. `outputs` are files that `Result.save`
    writes. The decorated function runs at the end. It receives those of the arguments and `result`
    that it names.
    """

    def decorator(finish):
        known = parameters(function)

        @sampling(function, *names, **settings)
        @wraps(finish)
        def body(outputs=(), **arguments):
            passed = {name: value for name, value in arguments.items() if name in known}
            if isinstance(passed.get("scene"), SceneOptions):
                passed["scene"] = passed["scene"].load(**load or {})
            with progress_bar(unit) as progress:
                if "progress" in known:
                    passed["progress"] = progress
                result = getattr(mi_lcair, function)(**passed)
            write_and_print(result, dict.fromkeys(outputs, result.save))
            everything = arguments | {"outputs": outputs, "result": result}
            return finish(**{name: everything[name] for name in signature(finish).parameters})

        return body

    return decorator


json = flag_option(JSON, "--json", help="Print the results as JSON.")


def plugins(command):
    """Give a command --plugin, and run the files before it."""

    @plugin
    @wraps(command)
    def prepared(*context, plugin, **arguments):
        prepare_renderer(None, None, plugin)
        return command(*context, **arguments)

    return prepared


def renderer(command):
    """Give a command --variant, -t, --plugin and --json, and prepare the renderer before it."""

    @option("--variant", f"Mitsuba variant (default: {VARIANTS[0]}).", click.Choice(VARIANTS))
    @option("-t --threads", "CPU threads (default: all).", POSITIVE)
    @plugin
    @json
    @wraps(command)
    def prepared(variant, threads, plugin, **arguments):
        prepare_renderer(variant, threads, plugin)
        return command(**arguments)

    return prepared


def workers(command):
    """Give a command --workers and --dask, and run it within `mi_lcair.workers`."""

    @option("--workers", "Number of worker processes.", POSITIVE)
    @option("--dask", "Address of a Dask scheduler whose workers do the work.", metavar="ADDRESS")
    @wraps(command)
    def on_workers(workers, dask, **arguments):
        with mi_lcair.workers(workers, dask):
            return command(**arguments)

    return on_workers


def areas(command):
    """Give a command --areas and --overwrite, and a folder beside its first output without --areas.

    That folder is removed if all goes well. `areas` is None if xarray, which writes it, is not
    installed. Raises InputError if an output exists and is not to be replaced.
    """

    @file(
        "--areas",
        "Keep the traced results in this folder. A later call reuses them (default: FILE.areas, "
        "which is removed at the end).",
        metavar="FOLDER",
    )
    @option("--overwrite", "Replace an output that exists.", is_flag=True)
    @wraps(command)
    def kept(outputs, areas, overwrite, **arguments):
        for output in outputs:
            if output.exists() and not overwrite:
                raise InputError(
                    f"output '{output}' exists; give --overwrite, or name another file"
                )
        folder = areas
        if areas is None and find_spec("xarray"):
            folder = Path(f"{outputs[0]}.areas")
        command(outputs=outputs, areas=folder, **arguments)
        if folder != areas:
            from mi_lcair.detection.sweeps.subject import AreasFolder

            AreasFolder(folder).clear()

    return kept


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


def check_given(ctx: click.Context, names, what: str) -> None:
    """Raise UsageError if an option that is not in `names` was given with `what`."""
    for parameter in ctx.command.params:
        given = ctx.get_parameter_source(parameter.name) is click.core.ParameterSource.COMMANDLINE
        if given and parameter.name not in (*names, "quiet"):
            raise click.UsageError(f"{parameter.opts[-1]} cannot be combined with {what}", ctx)


def output(what: str, suffixes=(), metavar: str = "FILE", name: str = "output", **settings):
    """Decorator that gives a command the option -o. `what` is written, and to which file.

    suffixes: of the file; without any it is not checked. settings: further arguments of
    click.option.
    """
    help, kind = f"Write {what}.", Output(suffixes)
    return click.option("-o", "--output", name, type=kind, metavar=metavar, help=help, **settings)


def file(name: str, help: str, suffixes=(), metavar: str = "FILE", **settings):
    """Decorator that gives a command an option whose value is a path.

    suffixes: those of a file to write; without any it is not checked.
    """
    return option(name, help, Output(suffixes), metavar=metavar, **settings)


def outputs(what: str, *suffixes: str, **settings):
    """Decorator that gives a command the option -o, which may be repeated.

    The command receives the paths as `outputs`. `what` is written to files with these suffixes, or
    drawn.
    """
    return output(
        f"{what}, FILE{', '.join(suffixes)}; may be repeated",
        suffixes,
        name="outputs",
        multiple=True,
        **settings,
    )


solution = option(
    "--solution",
    "Set temperatures, materials and radiances to the values in a file that invert wrote, "
    "FILE.json or FILE.json:STATE.",
)
motions = file("--motions", "Read motions of meshes from FILE.toml. -D then sets their values.")
plugin = file(
    "--plugin",
    "Run a Python file that registers your BSDFs or emitters with Mitsuba, FILE.py; may be "
    "repeated. A scenario that names it may then run it, too.",
    multiple=True,
)


def scenario(example: str):
    """Decorator that gives a command the argument SCENARIO and the options of a measurement.

    The command receives the Scenario with all changes of its entries as `scenario`. Options of the
    sampling are entries of its [render]. `example` is an entry that -D changes.
    """

    def decorator(command):
        command = renderer(command)

        @click.argument("scenario", shell_complete=completion.scenarios)
        @changes(f"Change an entry of the scenario, such as {example}")
        @solution
        @wraps(command)
        def with_scenario(scenario, changes, solution, **arguments):
            sampling = {name: arguments.pop(name, None) for name in ("spp", *CHOOSING)}
            changes = dict(changes) | given(sampling, "render.")
            changes |= given({"target.solution": solution or None})
            return command(scenario=read_scenario(scenario, changes), **arguments)

        return with_scenario

    return decorator


def loading(command):
    """Give a command the argument SCENE and the options that every scene needs.

    The options of sampling are not included. The command receives a SceneOptions as `scene`.
    """
    command = renderer(command)

    @click.argument("scene", shell_complete=completion.scenes)
    @changes(
        "Set a $-parameter of the scene, or one that `mi-lcair parameters` lists, such as "
        "model.yaw_deg",
        "parameters",
    )
    @solution
    @motions
    @wraps(command)
    def with_scene(scene, parameters, solution, motions, **arguments):
        given = SceneOptions(scene, dict(parameters), solution, motions)
        return command(scene=given, **arguments)

    return with_scene


def command(name: str, *lines: str, **settings):
    """Decorator that makes a function the command of this name, with these example lines.

    settings: further arguments of click.command.
    """
    return click.command(name, cls=Called, epilog=examples(*lines), **settings)


def examples(*lines: str) -> str:
    """The epilog of a command: its example lines, which the help does not wrap.

    They run in a folder with copies of scenes/examples, in the order of the commands in the help.
    """
    return "\n".join(["\b", "Examples:", *(f"  {line}" for line in lines)])
