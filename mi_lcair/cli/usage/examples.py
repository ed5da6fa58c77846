"""Examples at the end of each command's help. A test runs all of them."""


def examples(*lines: str) -> str:
    """The epilog of a command: its example lines, which the help does not wrap.

    They run in a folder with copies of scenes/examples, in the order of the commands in the help.
    """
    return "\n".join(["\b", "Examples:", *(f"  {line}" for line in lines)])
