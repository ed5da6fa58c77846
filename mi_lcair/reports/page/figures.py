"""Figures of plotly as panels, with the axes that all of them share."""

from html import escape

from mi_lcair.errors import printable
from mi_lcair.extras import optional
from mi_lcair.reports.line_charts import COLOURS
from mi_lcair.reports.page.panel import LONGEST, Panel

LINE = {"width": 1.6}
BAND = 0.18  # opacity of a band of errors


def graph_objects():
    """plotly's classes of traces and figures, which check every property."""
    return optional("plotly.graph_objects", "a report page")


def subplots(**options):
    """An empty figure with subplots, as `plotly.subplots.make_subplots`."""
    return optional("plotly.subplots", "a report page").make_subplots(**options)


def figure_panel(figure, height: int) -> Panel:
    """A panel that shows a plotly figure. Arrays must be Float64 or text."""
    figure.update_layout(height=height, template=None)
    return Panel("figure", plain(figure.to_dict()), height)


def plain(entries):
    """The figure's dictionary without the template, which the page's script sets."""
    entries["layout"].pop("template", None)
    return entries


def colour(number: int) -> str:
    """Colour of the curve with this number, from 0."""
    return COLOURS[number % len(COLOURS)]


def faded(colour: str) -> str:
    """A colour as #rrggbb with the opacity of a band of errors."""
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return f"rgba({red},{green},{blue},{BAND})"


def name(text: object) -> str:
    """Name for a curve or title without markup. plotly takes quotes as they are."""
    return escape(printable(text, LONGEST), quote=False)
