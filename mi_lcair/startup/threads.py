"""The lock under which one thread at a time uses Dr.Jit.

A thread that records or replays launches holds locks of Dr.Jit while it runs Python code. Another
thread that uses Dr.Jit meanwhile, if only to read an array, holds Python's own lock and waits for
Dr.Jit's: neither goes on. Two threads that record end the process. All that uses Dr.Jit therefore
takes turns, from the loading of a scene to the result of a public function.

Mitsuba makes objects in threads of its own, if it may. One that collects garbage with a scene in it
would wait for its turn, while the thread that has the turn waits for the object. All objects are
therefore made in the thread that loads (`parallel = False`).
"""

from collections.abc import Callable
from functools import wraps
from threading import RLock
from typing import ParamSpec, TypeVar

Arguments = ParamSpec("Arguments")
Returned = TypeVar("Returned")

exclusive = RLock()  # held by the thread that uses Dr.Jit


def exclusively(function: Callable[Arguments, Returned]) -> Callable[Arguments, Returned]:
    """Decorator: threads run the functions that have it one after the other."""

    @wraps(function)
    def in_turn(*arguments: Arguments.args, **options: Arguments.kwargs) -> Returned:
        with exclusive:
            return function(*arguments, **options)

    return in_turn
