"""What ends the program from outside: Ctrl-C, SIGTERM and SIGHUP all raise KeyboardInterrupt, where
it can be handled.

An exception in the middle of an import leaves a half-made module behind: a later use of it fails
with a NameError or ends the process. The interrupt therefore waits until no import is under way,
and until `held_back` blocks have ended.

Python raises the exception only between two of its own steps, and a library may catch it. The
program therefore also ends without it, PATIENCE_S after the signal (`end_soon`).
"""

import os
import shutil
import signal
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

ENDING = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
RETRY_S = 0.02  # after which an interrupt that waits looks again
PATIENCE_S = 0.5  # from a signal until the program ends without the exception
INTERRUPTED = 130  # exit status
IMPORTING = "importlib._bootstrap"  # in the file name of the frames of an import

temporary = set()  # files and folders that are removed when the program ends without exception
_held = 0
_released = threading.Event()
_is_announced = False


def install() -> None:
    """Handle the signals in this process; the program calls it first of all."""
    for number in ENDING:
        if signal.getsignal(number) is not signal.SIG_IGN:  # as under nohup
            signal.signal(number, interrupt)
    if hasattr(signal, "SIGALRM"):
        signal.signal(signal.SIGALRM, interrupt)


def end_soon() -> None:
    """End the process PATIENCE_S after one of the signals, whatever it is doing then.

    A thread waits for the signals, so that this needs no answer of the main thread.
    """
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    threading.Thread(target=_wait, args=(reading,), daemon=True).start()


def _wait(pipe: int) -> None:
    """End the process PATIENCE_S after a signal whose number comes out of a pipe."""
    while not set(ENDING) & set(os.read(pipe, 64)):
        pass
    if _released.wait(PATIENCE_S):
        return
    while _held:
        time.sleep(RETRY_S)
    for path in list(temporary):
        remove(path)
    if not _is_announced:
        announce()
    os._exit(INTERRUPTED)


def remove(path: Path) -> None:
    """Remove a file or folder, if it exists."""
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def announce() -> None:
    """Say on stderr that the program was interrupted."""
    global _is_announced  # which the thread that waits for signals looks at
    _is_announced = True
    sys.stderr.write("mi-lcair: interrupted\n")
    sys.stderr.flush()


def release() -> None:
    """Let the signals end the process at once: nothing is left to clean up."""
    _released.set()
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
