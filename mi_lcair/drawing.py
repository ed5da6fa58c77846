"""Matplotlib figures, written as PNG, SVG or PDF files completely or not at all."""

import warnings
from contextlib import contextmanager
from functools import partial, wraps
from io import BytesIO

from mi_lcair.errors import printable
from mi_lcair.files import check_suffix, write_bytes

NOTEBOOK_DPI = 75  # pixels per inch of a picture in a notebook
# Sizes of texts in all pictures, points
STYLE = {
    "axes.labelsize": 9,
    "axes.titlesize": 10,
    "figure.titlesize": 11,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "legend.title_fontsize": 8,
}
TICK_SIZE = 8
LONGEST = 120  # characters of a name in a title or legend
PICTURES = (".png", ".svg", ".pdf")  # suffixes of the files that `write_figure` writes
# The entries that would hold the time of writing. Equal pictures are equal files without them.
NO_DATE = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}, ".png": {}}


def new_figure(size, dpi: int = 150, **options):
    """An empty Matplotlib figure. No display is needed, and a notebook shows it.

    size: (width, height) in inches. dpi: pixels per inch in a PNG. options: further arguments of
    Figure.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, dpi=dpi, **options)
    FigureCanvasAgg(figure)
    # IPython itself shows figures only after an import of pyplot, and then does not ask for this
    figure._repr_png_ = partial(notebook_png, figure)
    return figure


def styled(draw):
    """Decorator: the figure that a function draws has the sizes of texts of all pictures."""

    @wraps(draw)
    def drawn(*args, **options):
        from matplotlib import rc_context

        with rc_context(STYLE):
            figure = draw(*args, **options)
        for axes in figure.axes:  # Matplotlib makes most ticks only when it renders
            axes.tick_params(labelsize=TICK_SIZE)
        return figure

    return drawn


def content_of(figure, **options) -> bytes:
    """A figure as the content of a file. options: those of Matplotlib's savefig."""
    content = BytesIO()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")  # it is drawn as a box
        figure.savefig(content, **options)
    return content.getvalue()


def notebook_png(figure) -> bytes:
    """A figure as the content of a PNG file, in the size for a notebook."""
    return content_of(figure, format="png", dpi=NOTEBOOK_DPI)


def file_content(figure, suffix: str) -> bytes:
    """A figure as the content of a .png, .svg or .pdf file.

    Texts in SVG and PDF are texts, which can be searched and edited. Equal figures give equal
    files.
    """
    from matplotlib import rc_context

    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "mi_lcair", "pdf.fonttype": 42}):
        return content_of(figure, format=suffix[1:], metadata=NO_DATE[suffix])


def write_figure(figure, path) -> None:
    """Write a figure as a .png, .svg or .pdf file, completely or not at all.

    Raises InputError for another suffix, and if `path` cannot be written.
    """
    write_bytes(path, file_content(figure, check_suffix(path, PICTURES)))


@contextmanager
def drawing(path, size, dpi: int = 150, **options):
    """Context manager that gives a figure of `new_figure` and writes it to `path` at the end.

    Raises InputError as `write_figure`.
    """
    figure = new_figure(size, dpi, **options)
    yield figure
    write_figure(figure, path)


def plain(text: object) -> str:
    """Text for a title, label or legend, as one line and without Matplotlib's formulas."""
    line = printable(text, LONGEST).replace("$", r"\$")
    return f" {line}" if line.startswith("_") else line  # Matplotlib hides labels that begin so
