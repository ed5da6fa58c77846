"""A rectangular source of one temperature, or with one hot spot, in four ways to write it."""

import numpy as np

from docs.studies.claims import planck
from docs.studies.claims.case import Draw
from docs.studies.claims.scene_file import BLACK, SceneFile, of_texture, thermal

WAYS = {"thermal": 0.7, "area": 0.1, "texture": 0.1, "facets": 0.1}
SIGNS = ((-1, -1), (1, -1), (1, 1), (-1, 1))  # corners of a rectangle, in order


def corners(rectangle) -> np.ndarray:
    centre, u, v = rectangle
    return np.array([centre + s * u + t * v for s, t in SIGNS])


def cell(rectangle, count: int, i: int, j: int) -> tuple:
    """The part i, j of count x count equal parts, along u and v."""
    centre, u, v = rectangle
    middle = centre + (2 * i + 1 - count) / count * u + (2 * j + 1 - count) / count * v
    return middle, u / count, v / count


def add_source(draw: Draw, file: SceneFile, name: str, rectangle, T: dict) -> dict:
    """Add a source to the scene, and its temperatures to T.

    Returns the rectangle of each of its radiances by the name in T; the first one lies within the
    second one and hides its part of it.
    """
    way = str(draw.rng.choice(list(WAYS), p=list(WAYS.values())))
    if way == "thermal":
        T[name] = draw.temperature()
        file.rectangle(*rectangle, BLACK + thermal(name, T[name]))
        return {name: rectangle}
    if way == "area":
        name = f"other@{name}"
        T[name] = draw.temperature(300)
        radiance = planck.in_band_radiance(draw.band, T[name])
        emitter = (
            f'<emitter type="area"> <spectrum name="radiance" value="{radiance!r}"/> </emitter>'
        )
        file.rectangle(*rectangle, BLACK + emitter)
        return {name: rectangle}
    return add_spotted(draw, file, name, rectangle, T, way)


def add_spotted(
    draw: Draw, file: SceneFile, name: str, rectangle, T: dict, way: str, surface: str = BLACK
) -> dict:
    """Add a rectangle with one hot spot, as a texture or as facets; returns as `add_source`."""
    hot, cold = f"{name}@hot", f"{name}@cold"
    T[hot], T[cold] = draw.temperature(300), draw.background()
    count = int(draw.rng.choice([4, 32]))
    i, j = draw.whole(0, count - 1), draw.whole(0, count - 1)
    if way == "texture":
        image = np.full((count, count), T[cold])
        image[j, i] = T[hot]
        file.bitmaps[f"{name}.exr"] = image
        texture = (
            '<texture name="temperature" type="bitmap"> '
            f'<string name="filename" value="{name}.exr"/> <string name="filter_type" '
            'value="nearest"/> <boolean name="raw" value="true"/> </texture>'
        )
        file.rectangle(*rectangle, surface + of_texture(name, texture))
    else:
        polygons = [
            corners(cell(rectangle, count, a, b)) for a in range(count) for b in range(count)
        ]
        temperatures = np.full(count**2, T[cold])
        temperatures[i * count + j] = T[hot]
        texture = (
            '<texture name="temperature" type="mesh_attribute"> '
            '<string name="name" value="face_temperature"/> </texture>'
        )
        file.mesh(polygons, surface + of_texture(name, texture), temperatures)
    return {hot: cell(rectangle, count, i, j), cold: rectangle}
