"""What a user did wrong, said in one line."""

import re
from difflib import SequenceMatcher


class InputError(ValueError):
    """An argument or input file that cannot be used.

    The message is one line: what is wrong, where, and what would be right. The command line prints
    it and exits with status 2.
    """


def unknown(kind: str, name: str, names) -> InputError:
    """The error for a `name` of some `kind` that is not among the known `names`, which it lists,
    nearest first.
    """
    nearest_first = sorted(
        names,
        key=lambda other: -SequenceMatcher(None, str(name).lower(), str(other).lower()).ratio(),
    )
    return InputError(f"unknown {kind} '{name}'; known: {', '.join(nearest_first) or 'none'}")


def mitsuba_error(error: BaseException) -> Exception:
    """The error that an exception of Mitsuba's loader stands for, in one line.

    An exception in a Python plugin arrives as "[file.cpp:123] At scene.xml (line 3, col 5): failed
    to ...: Traceback
    ...", with the exception itself as the last line. All that the loader refuses is the scene's fault, an InputError; an
    exception of another kind in a plugin is ours, a RuntimeError.
    """
    text = re.sub(r"^\[\w+\.cpp:\d+\] ", "", str(error))
    where, is_traceback, traceback = text.partition("Traceback (most recent call last):")
    if not is_traceback:
        return InputError(" ".join(text.split()))
    kind, _, message = traceback.strip().splitlines()[-1].partition(": ")
    if kind.endswith("KeyboardInterrupt"):
        return KeyboardInterrupt()
    place = re.search(r"At (.*?): failed", where)
    message = f"{place[1]}: {message}" if place else message
    return (
        InputError(message) if kind.endswith("InputError") else RuntimeError(f"{kind}: {message}")
    )
