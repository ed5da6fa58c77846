"""The command line `mi-lcair`.

The module of a command is imported when the command is called. Every error becomes one line on
stderr. The exit status is 0 for success, 1 for a failure, 2 for unusable arguments or input, and
130 for an interruption. MI_LCAIR_DEBUG=1 shows tracebacks.
"""

import importlib
import os
import sys
from itertools import chain

import click

import mi_lcair
from mi_lcair import interrupts
from mi_lcair.cli import completion  # noqa: F401  registers its script for Bash
from mi_lcair.cli.output import quiet_option, warnings_as_notes
from mi_lcair.errors import InputError, in_shell, mitsuba_error, printable, unknown
from mi_lcair.interrupts import INTERRUPTED

# The commands of each module, by what they are for.
PURPOSES = {
    "Images and intensities": {
        "radiometry": (
            *("render", "signature", "trend", "chart", "contrast"),
            *("image", "sweep", "flight", "dataset"),
        ),
        "laboratory": ("temperature", "cavity", "exchange", "heat", "pose"),
    },
    "Scenes and materials": {
        "materials": ("scenes", "parameters", "materials", "import", "fit"),
    },
    "Pictures, pages and files": {"files": ("show", "report", "convert")},
    "Errors, and what they depend on": {
        "estimates": ("audit", "budget", "invert", "sensitivities", "shape-derivatives"),
    },
}
COMMANDS = {
    name: module
    for modules in PURPOSES.values()
    for module, names in modules.items()
    for name in names
}
# What may come next, by command: the first line of which all words are known (`words_of` in
# `mi_lcair/cli/output.py`). `show` may return none of them: an atmosphere is read by nothing else.
PAGE, PARAMETERS = "report {json} -o {json.stem}.html", "parameters {scene} {given}"
NEXT = {
    "render": ("show {exr}", PARAMETERS),
    "signature": ("render {scene} {given} -o {name}.exr",),
    "trend": ("show {csv}", "show {nc}", PARAMETERS),
    "chart": ("{recommended}", PARAMETERS),
    "contrast": (PAGE, "image {camera} {given} -o {name}.exr", "show {scenario} {given}"),
    "image": ("show {exr}", "contrast {scenario} {given}"),
    "sweep": ("report {nc} -o {nc.stem}.html", "report {csv} -o {csv.stem}.html"),
    "flight": ("report {nc} -o {nc.stem}.html", "report {csv} -o {csv.stem}.html"),
    "dataset": ("show {frame}",),
    "temperature": (PAGE, "{call} -o {file.stem}_object.png", "{call} -o temperature.html"),
    "cavity": (PAGE, "{call} -o {name}.png", "{call} -o {name}.html"),
    "exchange": (PAGE, "show {scene} {given} --facets {csv} -c environment_K", PARAMETERS),
    "heat": (PAGE, "show {target} --facets {csv} -c kelvin", "{call} -o {name}.html"),
    "pose": ("image {toml} -o {toml.stem}.exr", "{call} -o {name}_seen.toml"),
    "scenes": ("render cavity -o cavity.exr",),
    "parameters": ("sensitivities {scene} {given} {first}", "render {scene} {given} -o {name}.exr"),
    "materials": ("show {first} --band {band} {own}",),
    "import": (
        "signature {model}/scene.xml -D band={band}",
        "signature {model}/scene.xml",
        "render {thermal}/scene.xml -o {thermal.name}.exr",
        "{call} -o {name}",
    ),
    "fit": (
        "render furnace -D material={json} -D band={measured} -o {json.stem}_furnace.exr",
        PAGE,
        "{call} -o {name}.json",
    ),
    "show": (
        "report {result} -o {name}.html",
        "signature {scene} {given}",
        "contrast {scenario} {given}",
        "import {model} {given} --check",
        "render furnace -D material={material} -D band={band} -o {name}_furnace.exr",
    ),
    "audit": ("render {scene} {given} -o {name}.exr",),
    "budget": (PAGE, "{call} -o {name}_budget.json"),
    "invert": (PAGE, "heat {toml}", "{call} -o {name}_solution.json"),
    "sensitivities": (PAGE, "{call} -o {name}.html", PARAMETERS),
    "shape-derivatives": (
        PAGE,
        "show {scene} {given} --facets {csv} -c derivative_W_sr_m3",
        "{call} -o {name}_shape.png",
        "{call} -o {name}_shape.html",
    ),
}
# Options by their names of earlier versions
RENAMED = {
    "--photons": ["--paths"],
    "--rays": ["--paths"],
    "--resume": ["--overwrite"],
    "--plot": ["--output", "--spectrum"],
}
FAILED, UNUSABLE = 1, 2


class Main(click.Group):
    """Group of commands. `NAME_command` stands in its module, which is imported on use."""

    def list_commands(self, ctx):
        return list(COMMANDS)

    def get_command(self, ctx, name):
        if name not in COMMANDS:
            if ctx.resilient_parsing:  # the shell completes a line
                return None
            raise unknown("command", name, COMMANDS)
        module = importlib.import_module(f"{__name__}.{COMMANDS[name]}")
        command = vars(module)[f"{name.replace('-', '_')}_command"]
        if not any(option.name == "quiet" for option in command.params):
            quiet_option(command)
        command.next_lines = NEXT.get(name, ())
        return command

    def format_commands(self, ctx, formatter):
        """Write the commands by purpose into the help."""
        width = formatter.width - 4 - max(map(len, COMMANDS))
        for purpose, modules in PURPOSES.items():
            with formatter.section(purpose):
                names = chain.from_iterable(modules.values())
                commands = ((name, self.get_command(ctx, name)) for name in names)
                formatter.write_dl(
                    [(name, command.get_short_help_str(width)) for name, command in commands],
                    col_max=max(map(len, COMMANDS)),
                )

    def main(self, args=None, prog_name="mi-lcair", **extra):
        """Run the command line, report an error as one line, and exit with the status.

        click handles a closed pipe: `echo` flushes, and the program ends without a message.
        """
        try:
            with warnings_as_notes(), in_shell():
                status = super().main(args, prog_name, standalone_mode=False, **extra) or 0
        except (Exception, KeyboardInterrupt) as error:
            if os.environ.get("MI_LCAIR_DEBUG"):
                raise
            status, message = _verdict(error)
            if status == INTERRUPTED:
                interrupts.announce()
            else:
                click.echo(f"mi-lcair: {printable(message)}", err=True)
        sys.exit(status)


def _verdict(error: BaseException) -> tuple[int, str]:
    """Exit status and message for an exception that ended a command."""
    if isinstance(error, (click.Abort, KeyboardInterrupt)):
        return INTERRUPTED, "interrupted"
    if isinstance(error, click.NoSuchOption) and error.option_name in RENAMED and error.ctx:
        known = {name for option in error.ctx.command.params for name in option.opts}
        error.possibilities = known.intersection(RENAMED[error.option_name]) or error.possibilities
    if isinstance(error, click.UsageError):
        command = error.ctx.command_path if error.ctx else "mi-lcair"
        return UNUSABLE, f"{error.format_message().rstrip('.')}; see '{command} --help'"
    if isinstance(error, InputError):
        return UNUSABLE, str(error)
    if isinstance(error, RuntimeError) and "Traceback (most recent call last)" in str(error):
        # Mitsuba reports an exception of a plugin as text.
        return _verdict(mitsuba_error(error))
    status, message = FAILED, f"{type(error).__name__}: {error}"
    if error.__cause__ is not None:
        # Dr.Jit's loops wrap an exception of their body in a RuntimeError.
        status, cause = _verdict(error.__cause__)
        message = f"{message} ({cause})" if status == FAILED else cause
    return status, message


def _version(ctx, option, wanted):
    if wanted:
        click.echo(f"mi-lcair {mi_lcair.__version__}")
        ctx.exit()


@click.group(
    "mi-lcair",
    cls=Main,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"], "show_default": True},
)
@click.option(
    "-V",
    "--version",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_version,
    help="Show the version and exit.",
)
@quiet_option
@click.pass_context
def main(ctx):
    """Thermal-infrared radiance of Mitsuba 3 scenes, in W m^-2 sr^-1.

    Results go to stdout, with --json for programs. Warnings and progress go to stderr. `COMMAND -h`
    explains a command, with an example.
    """
    if ctx.invoked_subcommand is None:
        click.echo(ctx.get_help())
