"""Pictures that many kinds of results have, as data: line charts, polar ones among them, and bars.

A result names the columns, and `mi_lcair/show` draws them, for files and for pages.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypedDict

import numpy as np

from mi_lcair.extras import named
from mi_lcair.formats import check_channels
from mi_lcair.sections import (
    Drawing,
    LongTable,
    Picture,
    Section,
    quantity_of,
    typeset_unit,
    unit_of,
    words_of,
)

INK = "#1c2430"  # colour of the main curve
COLOURS = (
    "#1f5fa8",
    "#d1495b",
    "#2e8b57",
    "#e08e0b",
    "#6a4c93",
    "#0fa3b1",
    "#8d5a2b",
    "#c2569c",
    "#6b7280",
    "#9aa800",
)


@dataclass(frozen=True)
class Curve:
    """A curve of a chart.

    name: in the legend. values: over the chart's abscissa. unit: of the values, as UDUNITS has it.
    colour: number of its colour; None for the main curve. on_right: the values are fractions, over
    an axis of their own on the right. errors: lengths of error bars, NaN where a value has none;
    None for a curve without them. half: half of the width of a band around it, likewise.
    """

    name: str
    values: np.ndarray
    unit: str
    colour: int | None = None
    on_right: bool = False
    errors: np.ndarray | None = None
    half: np.ndarray | None = None

    @property
    def line(self) -> dict:
        """Width and colour, as Matplotlib and plotly both name them."""
        if self.colour is None:
            return {"width": 2.2, "color": INK}
        return {"width": 1.6, "color": COLOURS[self.colour % len(COLOURS)]}


@dataclass(frozen=True)
class LineChart:
    """Curves over one abscissa.

    title: as plain text. x: abscissa. x_label, y_label: of its axes, with units. curves: the main
    one has the unit of the ordinate. from_zero: whether the ordinate begins at 0. is_close: whether
    it spans the positive values alone. is_polar: whether the abscissa is an angle [degrees], with 0
    up and 90 on the left. is_log: whether the ordinate is logarithmic.
    """

    title: str
    x: np.ndarray
    x_label: str
    y_label: str
    curves: list[Curve]
    from_zero: bool = False
    is_close: bool = False
    is_polar: bool = False
    is_log: bool = False


def by_wavelength(
    title: str, x, quantity: str, unit: str, curves: list[Curve], from_zero=True, is_close=False
) -> LineChart:
    """A chart of curves over wavelength [um]."""
    axes = "wavelength (µm)", label(quantity, unit)
    return LineChart(title, x, *axes, curves, from_zero and not is_close, is_close)


def label(quantity: str, unit: str) -> str:
    """Label of an axis, with a unit of UDUNITS."""
    return f"{quantity} ({typeset_unit(unit)})"


@dataclass(frozen=True)
class LineCharts(Picture):
    """Line charts one below the other or, with `across`, side by side, with a title."""

    charts: list[LineChart]
    title: str
    across: bool = False

    def draw(self) -> Any:
        """The picture as a Matplotlib Figure."""
        return named("mi_lcair.show.line_charts:figure_of")(self.charts, self.title, self.across)

    def panel(self) -> Any:
        """The charts for a page."""
        return named("mi_lcair.show.page.line_panel:line_panel")(self.charts, self.across)


@dataclass(frozen=True)
class BarChart:
    """Bars of several series beside each other or, with `stacked`, one behind the other.

    title: as plain text. names: of the places. label: of the values' axis, with the unit. bars:
    values of each series by its name, (places,). errors: standard errors of a series, likewise.
    places: label of the other axis. stacked: bars lie and follow each other. shades: how
    many of the first series are steps of one quantity, which have shades of one colour.
    """

    title: str
    names: Sequence[str]
    label: str
    bars: Mapping[str, np.ndarray]
    errors: Mapping[str, np.ndarray] = field(default_factory=dict)
    places: str = ""
    stacked: bool = False
    shades: int = 0


@dataclass(frozen=True)
class BarCharts(Picture):
    """Bar charts side by side, with a title."""

    charts: list[BarChart]
    title: str

    def draw(self) -> Any:
        """The picture as a Matplotlib Figure."""
        return named("mi_lcair.show.bar_charts:figure_of")(self.charts, self.title)


class Scale(TypedDict, total=False):
    """Options of the colour scales of a picture.

    Attributes
    ----------
    log : bool
        Logarithmic colours, over six decades at most.
    vmin : float, optional
        Value at the lower end of the colour scale.
    vmax : float, optional
        Value at the upper end of the colour scale.
    cmap : str, optional
        Colour map of Matplotlib, such as gray or viridis.
    common_scale : bool
        One scale for all panels of a quantity (default), or one for each panel.
    part : tuple of slice
        Rows and columns of the pixels that set the ends.
    """

    log: bool
    vmin: float | None
    vmax: float | None
    cmap: str | None
    common_scale: bool
    part: tuple[slice, slice]


@dataclass(frozen=True)
class ChannelImages(Picture):
    """Images of channels, each with its colour bar, with a title.

    channels: (H, W) each, by name. window_m: width and height of an orthographic sensor's window.
    shown: names of the channels that a page shows first. outlines: number of the facet in each
    pixel. scale: options of the colour scales.
    """

    channels: Mapping[str, np.ndarray]
    title: str
    window_m: tuple[float, float] | None = None
    shown: Sequence[str] = ()
    outlines: np.ndarray | None = None
    scale: Scale = field(default_factory=Scale)

    def draw(self) -> Any:
        """The picture as a Matplotlib Figure."""
        draw = named("mi_lcair.show.pictures.image_channels:figure")
        how = {"window_m": self.window_m, "outlines": self.outlines}
        return draw(self.channels, self.title, **how, **self.scale)

    def panel(self) -> Any:
        """The images for a page, which shows the values of a pixel."""
        panel = named("mi_lcair.show.page.model_panel:image_panel")
        return panel(self.channels, self.shown, self.window_m)


def named_channels(known: Mapping[str, np.ndarray], channels, scene_name: str) -> dict:
    """The named channels of `known`; raises InputError for a name that it does not have."""
    names = [channels] if isinstance(channels, str) else list(channels)
    check_channels(f"channel of the image of {scene_name}", known, *names)
    return {name: known[name] for name in names}


def lines_of(
    columns: Mapping[str, np.ndarray],
    x: str,
    *charts: Sequence[str],
    half: Mapping[str, str] | None = None,
    title: str = "",
    words: Mapping[str, str] | None = None,
) -> LineCharts:
    """The picture of columns of a table over another one: a chart for each sequence of names.

    x: name of the abscissa. The axes have the units of the names. half: names of the columns with
    half of the width of the bands around others. words: what the legend says in place of a name.
    """
    half, words, made = half or {}, words or {}, []
    for names in charts:
        curves = [
            Curve(
                words.get(name, quantity_of(name)),
                np.asarray(columns[name], float),
                unit_of(name),
                number or None,
                half=columns[half[name]] if name in half else None,
            )
            for number, name in enumerate(names)
        ]
        made.append(LineChart("", np.asarray(columns[x]), words_of(x), words_of(names[0]), curves))
    return LineCharts(made, title)


def facets_section(
    columns: Mapping[str, np.ndarray], model=None, toward=None, band=None
) -> Section:
    """The section of a table of facets: their model in space, if it is known, and the table.

    model: triangles and their facets' numbers, as `model_panel` takes them. toward: direction
    toward the sensor. band: Band of the radiances, for the emissivity.
    """
    module = "mi_lcair.show.page.model_panel"
    if band is not None:
        columns = named(f"{module}:with_emissivity")(columns, band)

    def panel():
        return named(f"{module}:model_panel")(*model, columns, toward)

    sort_by = "intensity_W_sr" if "intensity_W_sr" in columns else None
    drawing = [] if model is None else [Drawing(panel)]
    return Section("Facets", [*drawing, LongTable(columns, sort_by)])
