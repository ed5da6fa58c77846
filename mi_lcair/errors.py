"""Errors of the user's input as one line, and safe printing of text from files and names."""

import re
from contextlib import contextmanager
from contextvars import ContextVar
from difflib import SequenceMatcher

LONGEST = 500  # largest length of a message [characters]
MOST_NAMED = 300  # largest length of a list of known names [characters]
# Of more known names than ALL, the message lists the NEAREST ones only.
ALL, NEAREST = 12, 5
_in_shell = ContextVar("in_shell", default=False)  # whether the command line is the caller
MOST_QUOTED = 60  # largest length of an unknown name in a message [characters]

EXCEPTION = re.compile(r"\w[\w.]*(: |:?$)")  # an exception's name in an unindented traceback line
OF_MITSUBA = re.compile(r"^\[\w+\.cpp:\d+\] ")  # beginning of the message of Mitsuba's exceptions


def escaped(text: object) -> str:
    r"""The text with every character that a terminal would act on written as an escape such as
    \x1b or \n.

    What a file, a name or a cell holds then stays one line and cannot move the cursor, colour the
    terminal, or turn the direction of writing.
    """
    return "".join(
        character if character.isprintable() else character.encode("unicode_escape").decode()
        for character in str(text)
    )


def printable(text: object, most: int = LONGEST) -> str:
    """The text as one line of at most `most` characters.

    Line breaks become blanks and other control characters become escapes. The middle of a longer
    text is left out.
    """
    text = shortened(str(text), 4 * most)
    return shortened(escaped(re.sub(r"\s*[^\S ]\s*", " ", text).strip()), most)


def shortened(text: str, most: int) -> str:
    """The beginning and the end of a text that is longer than `most` characters.

    It is cut between two clauses, else between two words, where one of these is near.
    """
    if len(text) <= most:
        return text
    end = most // 3
    front, back = text[: most - end - 5], text[-end:]
    for gap in (r"(?<=[,;:])\s+", r"\s+"):
        before = [cut.start() for cut in re.finditer(gap, front) if cut.start() > len(front) / 2]
        after = [cut.end() for cut in re.finditer(gap, back) if cut.end() < len(back) / 2]
        if before and after:
            front, back = front[: before[-1]], back[after[0] :]
            break
    return f"{front} ... {back}"


def shown(text: str) -> str:
    """A piece of a file as an error message quotes it: escaped and at most 30 characters long."""
    return repr(text if len(text) <= 30 else text[:27] + "...")


class InputError(ValueError):
    """An argument or input file that cannot be used.

    The message is one printable line: what is wrong, where, and what would be right. The command
    line prints it and exits with status 2.
    """

    def __init__(self, message: object):
        super().__init__(printable(message))


@contextmanager
def errors_of(where: object):
    """Context manager in which the message of an InputError begins with what it is about, once."""
    try:
        yield
    except InputError as error:
        text, front = str(error), f"{where}: "
        raise InputError(text if text.startswith(front) else front + text) from None


@contextmanager
def complete(what: str):
    """Context manager: what a damaged file lacks is an InputError that begins with `what`."""
    try:
        yield
    except InputError:
        raise
    except (LookupError, TypeError, AttributeError, ValueError) as error:
        problem = "an entry is of another kind than it must be"
        if isinstance(error, KeyError):
            problem = f"entry {error} is missing"
        elif isinstance(error, ValueError):
            problem = str(error)
        raise InputError(f"{what} is incomplete: {problem}; make it anew") from None


def unknown(kind: str, name: str, names) -> InputError:
    """The error for an unknown `name`, with a list of the known `names`, the most similar first.

    kind: what the name stands for, such as "material". Of many names, only the NEAREST are listed.
    """
    name = printable(name, MOST_QUOTED)
    nearest_first = sorted(
        (printable(known, MOST_QUOTED) for known in names),
        key=lambda known: -SequenceMatcher(None, name.lower(), known.lower()).ratio(),
    )
    listed = nearest_first if len(nearest_first) <= ALL else [*nearest_first[:NEAREST], "..."]
    known = ", ".join(listed) or "none"
    if len(known) > MOST_NAMED:
        known = known[: known.rindex(", ", 0, MOST_NAMED)] + ", ..."
    return InputError(f"unknown {kind} '{name}'; known: {known}")


def check_known(kind: str, known, *names) -> None:
    """Raise the error of `unknown` for the first name that is not one of the known ones or None."""
    for name in names:
        if name is not None and name not in known:
            raise unknown(kind, name, known)


def option(name: str, value: object = None) -> str:
    """An option as the caller writes it: --max-spp in the shell, max_spp in Python.

    value: what to give, such as "Z"; True for an option that is only switched on.
    """
    if _in_shell.get():
        dashed = f"--{name.replace('_', '-')}"
        return dashed if value in (None, True) else f"{dashed} {value}"
    return name if value is None else f"{name}={value!r}"


@contextmanager
def in_shell():
    """Context manager: messages that are made within it name the options of the command line."""
    token = _in_shell.set(True)
    try:
        yield
    finally:
        _in_shell.reset(token)


def mitsuba_error(error: BaseException) -> Exception:
    """The error, with a one-line message, for an exception of Mitsuba's loader.

    An exception in a Python plugin arrives as "[file.cpp:123] At scene.xml (line 3, col 5): failed
    to ...: Traceback
    ...", with the exception itself at the end, sometimes over several lines. Exceptions of the
    loader and of Mitsuba's base classes are errors in the scene and become an InputError. Any other
    exception in a plugin is an error in this project and becomes a RuntimeError.
    """
    text = OF_MITSUBA.sub("", str(error))
    where, is_traceback, traceback = text.partition("Traceback (most recent call last):")
    if not is_traceback:
        return InputError(text)
    lines = traceback.strip().splitlines()
    first = max((k for k, line in enumerate(lines) if EXCEPTION.match(line)), default=-1)
    kind, _, message = " ".join(lines[first:]).partition(": ")
    if kind.rstrip(":").endswith("KeyboardInterrupt"):  # with a colon and nothing after it
        return KeyboardInterrupt()
    is_of_scene = kind.endswith("InputError") or OF_MITSUBA.match(message)
    message = OF_MITSUBA.sub("", message)
    place = re.search(r"At (.*?): failed", where)
    message = f"{place[1]}: {message}" if place else message
    return InputError(message) if is_of_scene else RuntimeError(f"{kind}: {message}")
