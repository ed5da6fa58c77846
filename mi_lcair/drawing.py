"""Writing of Matplotlib figures as PNG files, completely or not at all."""

import warnings
from contextlib import contextmanager

from mi_lcair.errors import printable
from mi_lcair.files import replacing

LONGEST = 120  # characters of a name in a title or legend


@contextmanager
def drawing(path, size, dpi: int = 150, **options):
    """Context manager that gives a Matplotlib figure and writes it as the PNG `path` at the end.

    size: (width, height) in inches. dpi: pixels per inch. options: further arguments of Figure.
    Raises InputError if `path` cannot be written. No display is needed.
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
    """Text for a title, label or legend, as one line and without Matplotlib's formulas."""
    line = printable(text, LONGEST).replace("$", r"\$")
    return f" {line}" if line.startswith("_") else line  # Matplotlib hides labels that begin so
