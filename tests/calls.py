"""Number of calls in a piece of work: a measure of its time that no processor changes."""

import sys


def calls_of(function, *arguments) -> int:
    """Number of calls and returns of Python functions and of built-in ones."""
    calls = 0

    def count(*_):
        nonlocal calls
        calls += 1

    sys.setprofile(count)
    try:
        function(*arguments)
    finally:
        sys.setprofile(None)
    return calls
