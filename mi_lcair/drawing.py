"""Pictures that appear complete or not at all."""

import warnings
from contextlib import contextmanager

from mi_lcair.errors import printable
from mi_lcair.files import replacing

LONGEST = 120  # characters of a name in a title or legend


@contextmanager
def drawing(path, size, dpi: int = 150, **options):
    """A Matplotlib figure of `size` (width, height) inches, to be drawn in the block; at its end it
    becomes the PNG `path`.

    options: of Figure. Raises InputError where `path` cannot be written. Needs no display.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, dpi=dpi, **options)
    FigureCanvasAgg(figure)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")  # it is drawn as a box
        yield figure
        with replacing(path) as partial:
            figure.savefig(partial, format="png")


def plain(text: object) -> str:
    """Text from outside as a title, label or legend shows it: one line, no formula, not hidden."""
    line = printable(text, LONGEST).replace("$", r"\$")
    return f" {line}" if line.startswith("_") else line  # Matplotlib hides labels that begin so
