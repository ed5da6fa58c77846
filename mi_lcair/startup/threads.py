"""Who uses Dr.Jit: one thread at a time, under a lock, and the plugins of one scene.

A thread that records or replays launches holds locks of Dr.Jit while it runs Python code. Another
thread that uses Dr.Jit meanwhile, if only to read an array, holds Python's own lock and waits for
Dr.Jit's: neither goes on. Two threads that record end the process. All that uses Dr.Jit therefore
takes turns, from the loading of a scene to the result of a public function. A scene that any other
thread discards is deleted in the next turn: the thread that has the turn may wait for the other, as
for the one that serves workers.

Mitsuba makes objects in threads of its own, if it may, and these would delete what garbage holds of
Dr.Jit. All objects are therefore made in the thread that loads (`parallel = False`).

Dr.Jit records calls of every plugin that is alive, also of other scenes. The plugins of the scene
that is being traced are therefore known to the process.
"""

from collections.abc import Callable
from contextlib import contextmanager
from functools import wraps
from threading import RLock
from typing import ParamSpec, TypeVar

Arguments = ParamSpec("Arguments")
Returned = TypeVar("Returned")

exclusive = RLock()  # held by the thread that uses Dr.Jit
discarded: list[dict] = []  # the attributes of scenes that wait for a turn to be deleted
_traced: set | None = None  # the plugins of the scene that is being traced


def exclusively(function: Callable[Arguments, Returned]) -> Callable[Arguments, Returned]:
    """Decorator: threads run the functions that have it one after the other."""

    @wraps(function)
    def in_turn(*arguments: Arguments.args, **options: Arguments.kwargs) -> Returned:
        with exclusive:
            discarded.clear()
            return function(*arguments, **options)

    return in_turn


@contextmanager
def tracing(plugins):
    """Context manager in which `is_traced` is True for these plugins and False for all others.

    The quantities that the plugins derive must be up to date. The thread must hold `exclusive`.
    """
    global _traced
    before, _traced = _traced, set(plugins)
    try:
        yield
    finally:
        _traced = before


def is_traced(plugin) -> bool | None:
    """Whether the plugin belongs to the scene being traced.

    None while `bounce_path` does not trace, for example under Mitsuba's integrators. A plugin's
    methods receive only the interaction, so that they cannot see it otherwise. The shape of another
    scene's emitter may be deleted.
    """
    return None if _traced is None else plugin in _traced
