"""Panel of a facet model: its facets in space, coloured by a column of the facets table."""

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.formats import or_nan
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.show.page.line_panel import Panel, column_data
from mi_lcair.show.pictures import image_channels

# Panel of images: the channels of a radiance image, with a read-out of every channel
# -----------------------------------------------------------------------------------

SEEN = "seen."


def image_panel(channels: dict[str, np.ndarray], shown=(), orthographic_m=None) -> Panel:
    """The panel of an image.

    Parameters
    ----------
    channels : dict of str to ndarray, shape (H, W)
        Channels by name. NaN, infinite values and, in temperatures and ranges, 0 are no values.
    shown : sequence of str
        Names of the channels that are shown first (the first two).
    orthographic_m : tuple of float, optional
        Width and height of the window that an orthographic sensor sees, m.
    """
    # As the page holds them
    values = {n: or_nan(n, pixels.astype("<f4").astype(float)) for n, pixels in channels.items()}
    part = image_channels.around_target(channels)
    height, width = next(iter(values.values())).shape
    names = list(values)
    first = [name for name in shown if name in values] or names[:2]
    groups = {
        name.removeprefix(SEEN).removesuffix(".Y"): names.index(name)
        for name in names
        if name.startswith(SEEN)
    }
    return Panel(
        "image",
        {
            "width": width,
            "height": height,
            "size_m": orthographic_m,
            "channels": [
                {
                    "name": name,
                    "quantity": image_channels.channel_quantity(name)[0],
                    "unit": image_channels.channel_quantity(name)[1],
                    "values": pixels.ravel(),
                    **scales(name, pixels[part]),
                    "extent": extent(pixels),
                }
                for name, pixels in values.items()
            ],
            "part": part != image_channels.WHOLE,
            "shown": [names.index(name) for name in first],
            "seen": {"names": list(groups), "channels": list(groups.values())},
        },
        height=620,
    )


def scales(name: str, values: np.ndarray, weights=None) -> dict[str, tuple[float, float]]:
    """Ends of the linear and the logarithmic scale of a channel or column, as in pictures.

    weights: of each value, such as the areas of facets; equal ones by default.
    """
    is_known = np.isfinite(values)

    def ends(is_drawn, log: bool):
        of_drawn = None if weights is None else weights[is_drawn]
        limits = image_channels.limits_of_channel(name, [values[is_drawn]], log, weights=of_drawn)
        return limits.lower, limits.upper

    return {"limits": ends(is_known, False), "log_limits": ends(is_known & (values > 0), True)}


def extent(values: np.ndarray) -> tuple[float | None, float | None]:
    """Smallest and largest value; None without any."""
    values = values[np.isfinite(values)]
    return (float(values.min()), float(values.max())) if values.size else (None, None)


EMISSIVITY = "emissivity_toward_the_sensor"
FIRST = (
    "derivative_W_sr_m3",
    "radiance_W_m2_sr",
    "temperature_K",
    "group",
)  # columns to colour by at first, if present


def model_panel(triangles, triangle_facet, columns: dict[str, np.ndarray], toward=None) -> Panel:
    """The panel of a model.

    Parameters
    ----------
    triangles : ndarray, shape (T, 3, 3)
        Corners of the triangles, m. Those of facets without a row are not shown.
    triangle_facet : ndarray, shape (T,)
        Number of each triangle's facet.
    columns : dict of str to ndarray, shape (rows,)
        Facets table: `facet`, the number, and other columns by name with unit.
    toward : ndarray, shape (3,), optional
        Direction toward the sensor, from which the model is seen at first.

    Raises
    ------
    InputError
        If the table has a facet that the model lacks.
    """
    of_triangle = rows_by_facet(columns["facet"], triangle_facet)[triangle_facet]
    is_shown = of_triangle >= 0
    described = [
        described_column(name, values, columns.get("area_m2")) for name, values in columns.items()
    ]
    names = [column["name"] for column in described]
    first = next((names.index(name) for name in FIRST if name in names), 0)
    return Panel(
        "model",
        {
            "corners": np.asarray(triangles)[is_shown].ravel(),
            "rows": of_triangle[is_shown],
            "columns": described,
            "shown": first,
            "toward": None if toward is None else [float(value) for value in toward],
        },
        height=640,
    )


def rows_by_facet(facet, triangle_facet) -> np.ndarray:
    """Row of the table for each facet of a model, -1 without one.

    facet: the column of facets' numbers. triangle_facet: the facet of each triangle. Raises
    InputError if the table has a facet that the model lacks.
    """
    facet, count = np.asarray(facet), int(np.max(triangle_facet, initial=-1)) + 1
    whole = (facet >= 0) & (facet < count) & (facet == np.round(facet))
    if not whole.all() or len(np.unique(facet)) < len(facet):
        raise InputError(
            f"the facets table does not fit the model, whose facets are 0 to {count - 1}, each in "
            "one row; give the scene and the parameters from which the table was made"
        )
    row = np.full(count, -1)
    row[facet.astype(int)] = np.arange(len(facet))
    return row


def described_column(name: str, values, areas=None) -> dict:
    """A column for the script, with the limits of its scale if it holds numbers.

    areas: areas of the facets, by which the quantiles of the limits are weighted.
    """
    column = column_data(name, values)
    if "names" in column:
        return column
    numbers = np.asarray(values, "<f4").astype(float)  # as the page holds them
    return column | scales(name, numbers, areas) | {"extent": extent(numbers)}


def with_emissivity(columns: dict[str, np.ndarray], band) -> dict[str, np.ndarray]:
    """The columns with the emissivity toward the sensor, if it can be known.

    It is what a facet emits divided by a blackbody's radiance at its temperature, both in the band.
    """
    if not {"emitted_W_m2_sr", "temperature_K"} <= columns.keys():
        return columns
    emitted = np.asarray(columns["emitted_W_m2_sr"], dtype=float)
    kelvin = np.asarray(columns["temperature_K"], dtype=float)
    radiance = np.full(len(kelvin), np.nan)
    for value in np.unique(kelvin[np.isfinite(kelvin) & (kelvin > 0)]):
        radiance[kelvin == value] = in_band_radiance(band, float(value))
    with np.errstate(divide="ignore", invalid="ignore"):
        emissivity = emitted / radiance
    names = list(columns)
    at = names.index("temperature_K") + 1
    return {
        **{name: columns[name] for name in names[:at]},
        EMISSIVITY: np.where(np.isfinite(emissivity), emissivity, np.nan),
        **{name: columns[name] for name in names[at:]},
    }
