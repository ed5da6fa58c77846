"""Pictures that appear complete or not at all."""

from contextlib import contextmanager

from mi_lcair.files import replacing


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
    yield figure
    with replacing(path) as partial:
        figure.savefig(partial, format="png")
