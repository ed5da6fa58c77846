"""The command `mi-lcair`: finds a command's module when it is called, and turns every error into
one line.

Exit status: 0 done, 1 failed, 2 unusable arguments or input, 130 interrupted. MI_LCAIR_DEBUG=1
shows tracebacks.
"""

import importlib
import os
import sys

import click

import mi_lcair
from mi_lcair.cli.output import warnings_as_notes
from mi_lcair.errors import InputError, mitsuba_error, printable, unknown

COMMANDS = {
    name: name
    for name in (
        "render",
        "show",
        "signature",
        "contrast",
        "trend",
        "fit",
        "scenes",
        "chart",
        "plan",
        "audit",
    )
}  # name: its module
COMMANDS["import"] = "import_model"  # a file import.py could not be imported
FAILED, UNUSABLE, INTERRUPTED = 1, 2, 130


class Main(click.Group):
    """The group of commands: each is `command` in its module, imported at its call."""

    def list_commands(self, ctx):
        return list(COMMANDS)

    def get_command(self, ctx, name):
        if name not in COMMANDS:
            raise unknown("command", name, COMMANDS)
        return importlib.import_module(f"{__name__}.{COMMANDS[name]}").command

    def main(self, args=None, prog_name="mi-lcair", **extra):
        """Run the command line and exit with its status; the one place that decides what an error
        looks like.

        (A reader of stdout that has gone is click's business: `echo` flushes, and a broken pipe
        ends quietly.)
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
        # An exception in a plugin, which Mitsuba passes on as text.
        return _verdict(mitsuba_error(error))
    status, message = FAILED, f"{type(error).__name__}: {error}"
    if error.__cause__ is not None:
        # Dr.Jit's loops wrap what happens in their body in a RuntimeError of their own.
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
