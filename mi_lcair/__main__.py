"""The program `mi-lcair`: signals are handled before anything slow is imported."""

import os
import sys

from mi_lcair import interrupts


def open_streams() -> None:
    """Open stdin, stdout and stderr where the caller closed them, to and from nothing.

    The next file that is opened would otherwise take the place of the stream, and receive what is
    meant for it.
    """
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        os.set_inheritable(number, True)
    os.close(number)
    sys.stdin = sys.stdin or os.fdopen(0)
    sys.stdout = sys.stdout or os.fdopen(1, "w")
    sys.stderr = sys.stderr or os.fdopen(2, "w")


def main() -> None:
    """Run the command line and exit with its status."""
    open_streams()
    interrupts.install()
    interrupts.end_soon()
    try:
        from mi_lcair.cli import main as run

        run()
    except KeyboardInterrupt:  # before or after the command line's own handling
        interrupts.announce()
        sys.exit(interrupts.INTERRUPTED)
    finally:
        interrupts.release()


if __name__ == "__main__":
    main()
