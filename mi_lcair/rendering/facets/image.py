"""Images of a facet table: each pixel gets a column's value for the facet that it shows."""

import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError, shown
from mi_lcair.rendering.facets.table import FacetTable
from mi_lcair.rendering.scene import Scene
from mi_lcair.table import TextTable

FACET = "facet"  # the column of facet numbers


def by_facet(table: TextTable, name: str, count: int) -> np.ndarray:
    """Values of a column by facet number, (count,); NaN for a facet without a row or value.

    The table needs a column `facet`. Raises InputError, with the line, for a facet that is not one
    of `count` or has two rows, and for a cell that is no number.
    """
    columns = table.numbers([FACET, name], may_lack=True)
    facet = columns[FACET]
    bad = ~((facet >= 0) & (facet < count) & (facet == np.round(facet)))
    if bad.any():
        line, cells = table.rows[bad.argmax()]
        raise InputError(
            f"{table.file}, line {line}: facet "
            f"{shown(cells[table.columns.index(FACET)])} is not in the scene, "
            f"whose facets are numbered from 0 to {count - 1}"
        )
    numbers, rows = np.unique(facet, return_counts=True)
    if rows.max() > 1:
        raise InputError(
            f"{table.file}: facet {numbers[rows.argmax()]:g} has {rows.max()} rows; "
            "it must have one"
        )
    values = np.full(count, np.nan)
    values[facet.astype(int)] = columns[name]
    return values


def seen_facets(scene: Scene, facets: FacetTable, sensor: int = 0) -> np.ndarray:
    """Number of the facet that each pixel of a sensor shows, (H, W); -1 where there is none.

    The facet is the one that the ray through the pixel's centre hits.
    """
    ray, shape = pixel_rays(scene.sensor(sensor))
    hit = scene.mi.ray_intersect_preliminary(ray, coherent=True)
    return facets.number(hit.shape, hit.prim_index).numpy().astype(np.int32).reshape(shape)


def pixel_rays(camera) -> tuple[mi.Ray3f, tuple[int, int]]:
    """Rays through the pixels' centres, row by row, and the film's (height, width)."""
    width, height = camera.film().crop_size()
    row, column = np.indices((height, width)).reshape(2, -1)
    position = mi.Point2f((column + 0.5) / width, (row + 0.5) / height)
    ray, _ = camera.sample_ray(camera.shutter_open(), 0, position, mi.Point2f(0.5))
    return ray, (height, width)


def facet_images(scene: Scene, table: TextTable, names, sensor: int = 0) -> dict[str, np.ndarray]:
    """Images of some columns of a facet table, as a sensor sees the facets.

    Parameters
    ----------
    scene : Scene
    table : TextTable
        Table with a column `facet`.
    names : iterable of str
        Columns to show.
    sensor : int
        Number of the sensor, counted from 0.

    Returns
    -------
    dict
        An image (H, W) for each name; NaN where there is no facet or no value.
    """
    facets = FacetTable(scene)
    columns = {name: by_facet(table, name, facets.count) for name in names}
    seen = seen_facets(scene, facets, sensor)
    return {name: np.where(seen >= 0, values[seen], np.nan) for name, values in columns.items()}
