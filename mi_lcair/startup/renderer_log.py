"""Passes Mitsuba's log messages to Python's logging, so that stdout has only results."""

import logging
import re

from mi_lcair.errors import printable

# "2026-01-31 12:00:00 WARN  main  [PLYMesh] " before the text of a message
PREFIX = re.compile(r"^\S+ \S+ +[A-Z]+ +(\S+ +)?\[[^]]*\] *")


def pass_on() -> None:
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
