"""Which plugins are being traced.

It holds for the process, because Dr.Jit records calls of every plugin that is alive, also of other
scenes. This module does not use Mitsuba, so that it is not loaded again for another variant.
"""

from contextlib import contextmanager

_traced: set | None = None  # the plugins of the scene that is being traced


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
