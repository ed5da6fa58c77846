"""What a user did wrong, said in one line."""
from difflib import SequenceMatcher


class InputError(ValueError):
    """An argument or input file that cannot be used.

    The message is one line: what is wrong, where, and what would be right. The command line prints it and exits with
    status 2.
    """


def unknown(kind: str, name: str, names) -> InputError:
    """The error for a `name` of some `kind` that is not among the known `names`, which it lists, nearest first."""
    nearest_first = sorted(names, key=lambda other: -SequenceMatcher(None, str(name).lower(), str(other).lower()).ratio())
    return InputError(f"unknown {kind} '{name}'; known: {', '.join(nearest_first) or 'none'}")
