"""A scene coloured facet by facet with the columns of a table."""

import csv
from pathlib import Path

import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.rendering.facet_table import FacetTable
from mi_lcair.rendering.scene import Scene

FACET = "facet"  # the column of facet numbers


def read_table(path: str | Path) -> dict[str, list[str]]:
    """The columns of a CSV file as text, by name; `#` lines are comments. InputError without rows
    or a column `facet`.
    """
    try:
        lines = Path(path).read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read: {getattr(error, 'strerror', error)}") from None
    numbered = [
        (number, row)
        for number, row in enumerate(csv.reader(lines), 1)
        if row and not row[0].startswith("#")
    ]
    if len(numbered) < 2 or FACET not in numbered[0][1]:
        raise InputError(f"{path}: must be a CSV with a column '{FACET}' and a row for each facet")
    names = numbered[0][1]
    for number, row in numbered[1:]:
        if len(row) != len(names):
            raise InputError(
                f"{path}, line {number}: has {len(row)} cells; the header has {len(names)}"
            )
    return dict(zip(names, map(list, zip(*(row for _, row in numbered[1:])))))


def by_facet(path: str | Path, table: dict[str, list[str]], name: str, count: int) -> np.ndarray:
    """The values (count,) of a column by facet number, NaN for a facet that has no row or an empty
    cell in it.
    """
    facet = numbers(path, table, FACET)
    bad = ~((facet >= 0) & (facet < count) & (facet == np.round(facet)))
    if bad.any():
        raise InputError(
            f"{path}: facet {table[FACET][bad.argmax()]} is not in the scene, whose facets are numbered from 0 to {count - 1}"
        )
    found, rows = np.unique(facet, return_counts=True)
    if rows.max() > 1:
        raise InputError(
            f"{path}: facet {found[rows.argmax()]:g} has {rows.max()} rows; it must have one"
        )
    values = np.full(count, np.nan)
    values[facet.astype(int)] = numbers(path, table, name)
    return values


def numbers(path, table: dict[str, list[str]], name: str) -> np.ndarray:
    try:
        return np.array([float(cell) if cell.strip() else np.nan for cell in table[name]])
    except ValueError as error:
        raise InputError(f"{path}: column '{name}' cannot be a colour: {error}") from None


def seen_facets(scene: Scene, facets: FacetTable, sensor: int = 0) -> np.ndarray:
    """The facet that each pixel of a sensor shows, (H, W), by the ray through the pixel's centre;
    -1: none.
    """
    ray, shape = pixel_rays(scene.sensor(sensor))
    hit = scene.mi.ray_intersect_preliminary(ray, coherent=True)
    return facets.number(hit.shape, hit.prim_index).numpy().astype(np.int32).reshape(shape)


def pixel_rays(camera) -> tuple[mi.Ray3f, tuple[int, int]]:
    """The rays through the pixels' centres, row by row, and (height, width)."""
    width, height = camera.film().crop_size()
    row, column = np.indices((height, width)).reshape(2, -1)
    ray, _ = camera.sample_ray(
        camera.shutter_open(),
        0,
        mi.Point2f((column + 0.5) / width, (row + 0.5) / height),
        mi.Point2f(0.5),
    )
    return ray, (height, width)


def facet_images(
    scene: Scene, path: str | Path, table: dict[str, list[str]], names, sensor: int = 0
) -> dict[str, np.ndarray]:
    """What a sensor sees, coloured by columns `names` of a table: (H, W) each, NaN where there is
    no facet or no value.
    """
    facets = FacetTable(scene)
    columns = {name: by_facet(path, table, name, facets.count) for name in names}
    seen = seen_facets(scene, facets, sensor)
    return {name: np.where(seen >= 0, values[seen], np.nan) for name, values in columns.items()}
