"""The command line `mi-lcair`.

The module of a command is imported when the command is called. Every error becomes one line on
stderr. The exit status is 0 for success, 1 for a failure, 2 for unusable arguments or input, and
130 for an interruption. MI_LCAIR_DEBUG=1 shows tracebacks.
"""

import importlib
import os
import sys

import click

import mi_lcair
from mi_lcair.cli.output import warnings_as_notes
from mi_lcair.errors import InputError, mitsuba_error, printable, unknown

# Name of each command, and the module that holds it.
COMMANDS = {
    name: name
    for name in (
        "render",
        "signature",
        "trend",
        "fit",
        "scenes",
        "chart",
        "plan",
        "audit",
    )
}
COMMANDS |= {name: f"files.{name}" for name in ("show", "convert")}
COMMANDS["import"] = "import_model"  # a module cannot be named `import`
COMMANDS |= {name: f"scenarios.{name}" for name in ("contrast", "image")}
COMMANDS |= {name: f"estimates.{name}" for name in ("budget", "invert")}
FAILED, UNUSABLE, INTERRUPTED = 1, 2, 130


class Main(click.Group):
    """Group of commands. Each is named `command` in its module, which is imported on use."""

    def list_commands(self, ctx):
        return list(COMMANDS)

    def get_command(self, ctx, name):
        if name not in COMMANDS:
            raise unknown("command", name, COMMANDS)
        return importlib.import_module(f"{__name__}.{COMMANDS[name]}").command

    def main(self, args=None, prog_name="mi-lcair", **extra):
        """Run the command line, report an error as one line, and exit with the status.

        click handles a closed pipe: `echo` flushes, and the program ends without a message.
        """
        try:
            with warnings_as_notes():
                status = super().main(args, prog_name, standalone_mode=False, **extra) or 0
        except (Exception, KeyboardInterrupt) as error:
            if os.environ.get("MI_LCAIR_DEBUG"):
                raise
            status, message = _verdict(error)
            click.echo(f"mi-lcair: {printable(message)}", err=True)
        sys.exit(status)


def _verdict(error: BaseException) -> tuple[int, str]:
    """Exit status and message for an exception that ended a command."""
    if isinstance(error, (click.Abort, KeyboardInterrupt)):
        return INTERRUPTED, "interrupted"
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


@click.group("mi-lcair", cls=Main, invoke_without_command=True)
@click.option(
    "--version",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_version,
    help="Show the version and exit.",
)
@click.pass_context
def main(ctx):
    """Thermal-infrared radiance of Mitsuba 3 scenes, in W m^-2 sr^-1."""
    if ctx.invoked_subcommand is None:
        click.echo(ctx.get_help())
