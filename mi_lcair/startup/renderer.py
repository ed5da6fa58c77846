"""What is changed in Mitsuba when it has been imported: two functions, its log, and one thread.

`mi.render` and `mi.traverse` take what `mi_lcair.load` returns. Mitsuba's functions take objects of
its own classes only. `mi.render` asserts the class and passes the scene on to C++, so that no class
written in Python can stand for it. Both functions are therefore replaced by ones that pass on the
`mi` of a loaded scene, and anything else as it is.

Log messages go to Python's logging, so that stdout has only results.

On one core Mitsuba's OpenEXR waits forever for the lines of a picture, so that Dr.Jit gets a second
thread there.
"""

import logging
import os
import re
from functools import wraps
from pathlib import Path

from mi_lcair.errors import printable

FUNCTIONS = ("render", "traverse")
THREADS = Path("/proc/self/task")  # Linux lists the threads of this process here


def take_loaded_scenes() -> None:
    """Let `mi.render` and `mi.traverse` take a `Scene`, in all variants."""
    import mitsuba as mi

    for name in FUNCTIONS:
        function = _with_scene(getattr(mi.util, name))
        setattr(mi.util, name, function)
        setattr(mi, name, function)


def _with_scene(function):
    """The function that gets the `mi` of each argument that has one, in the argument's place."""

    def of(value):
        return getattr(value, "mi", value)

    @wraps(function)
    def taking_scene(*arguments, **options):
        options = {name: of(value) for name, value in options.items()}
        return function(*map(of, arguments), **options)

    return taking_scene


# "2026-01-31 12:00:00 WARN  main  [PLYMesh] " before the text of a message
PREFIX = re.compile(r"^\S+ \S+ +[A-Z]+ +(\S+ +)?\[[^]]*\] *")


def log_to_python() -> None:
    """Send Mitsuba's messages to the logger "mitsuba" of Python's logging, and nowhere else.

    Warnings then appear on stderr, unless the program configures logging.
    """
    import mitsuba as mi

    levels = {
        mi.LogLevel.Trace: logging.DEBUG,
        mi.LogLevel.Debug: logging.DEBUG,
        mi.LogLevel.Info: logging.INFO,
        mi.LogLevel.Warn: logging.WARNING,
        mi.LogLevel.Error: logging.ERROR,
    }
    log = logging.getLogger("mitsuba")

    class PythonLogging(mi.Appender):
        def append(self, level, text):
            log.log(levels[level], "%s", printable(PREFIX.sub("", text)))

        def log_progress(self, *_):
            pass  # the commands draw their own bars

    mi.logger().clear_appenders()
    mi.logger().add_appender(PythonLogging())


def avoid_one_thread() -> None:
    """Let Dr.Jit have two threads, even on one core.

    After each kernel a thread of Dr.Jit asks for more work for 20 ms, without sleep. On one core it
    would take every second moment of the program then. Its priority there is the lowest.
    """
    import drjit

    if drjit.thread_count() > 1:
        return
    before = {*THREADS.glob("*")}
    drjit.set_thread_count(2)
    for thread in {*THREADS.glob("*")} - before:
        os.setpriority(os.PRIO_PROCESS, int(thread.name), 19)
