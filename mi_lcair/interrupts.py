"""What ends the program from outside: Ctrl-C, SIGTERM and SIGHUP all raise KeyboardInterrupt, where
it can be handled.

An exception in the middle of an import leaves a half-made module behind: a later use of it fails
with a NameError or ends the process. The interrupt therefore waits until no import is under way,
and until `held_back` blocks have ended.
"""

import signal
from contextlib import contextmanager

ENDING = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
RETRY_S = 0.02  # after which an interrupt that waits looks again
IMPORTING = "importlib._bootstrap"  # in the file name of the frames of an import

_held = 0


def install() -> None:
    """Handle the signals in this process; the program calls it first of all."""
    for number in ENDING:
        if signal.getsignal(number) is not signal.SIG_IGN:  # as under nohup
            signal.signal(number, interrupt)
    if hasattr(signal, "SIGALRM"):
        signal.signal(signal.SIGALRM, interrupt)


def release() -> None:
    """Let the signals end the process at once: nothing is left to clean up."""
    for number in ENDING:
        if signal.getsignal(number) is interrupt:
            signal.signal(number, signal.SIG_DFL)


def interrupt(number, frame) -> None:
    """Raises KeyboardInterrupt, now or soon."""
    if hasattr(signal, "SIGALRM") and (_held or is_importing(frame)):
        signal.setitimer(signal.ITIMER_REAL, RETRY_S)
        return
    raise KeyboardInterrupt


def is_importing(frame) -> bool:
    """Whether a frame belongs to an import, itself or by those that called it."""
    while frame is not None:
        if IMPORTING in frame.f_code.co_filename:
            return True
        frame = frame.f_back
    return False


@contextmanager
def held_back():
    """Interrupts wait until the block has ended; for a few steps that belong together."""
    global _held  # the one state that a signal handler can see
    _held += 1
    try:
        yield
    finally:
        _held -= 1
