"""The program `mi-lcair`: signals are handled before anything slow is imported."""

import sys

from mi_lcair import interrupts


def main() -> None:
    """Run the command line and exit with its status."""
    interrupts.install()
    try:
        from mi_lcair.cli import main as run

        run()
    except KeyboardInterrupt:  # before or after the command line's own handling
        sys.stderr.write("mi-lcair: interrupted\n")
        sys.exit(130)
    finally:
        interrupts.release()


if __name__ == "__main__":
    main()
