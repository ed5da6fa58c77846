"""The facet model: what an OBJ file, its labels and a table of temperatures make together."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError, shown
from mi_lcair.models3d.label import Label, find_material, kelvin, parse, unlabelled
from mi_lcair.models3d.obj import read_obj
from mi_lcair.models3d.polygons import MOST_CLIPPED, triangulate
from mi_lcair.models3d.welding import weld
from mi_lcair.physics import materials as known_materials
from mi_lcair.table import read_table

FARTHEST = 1e9  # m; squares of such lengths are far from the limits of Float32
# from the origin; of a model at 10,000 times its size Float32 coordinates leave 1 % of error in
# intensity
SIZES_AWAY = 1000


@dataclass(frozen=True)
class Model:
    """A welded facet model, lengths in m.

    vertices (V, 3), of which welding leaves some unused; corners (N,): their indices, facet after
    facet, with the limits first (F + 1,); labels and label (F,): which of them holds; temperature
    (F,) in kelvin; triangles (T, 3) and triangle_facet (T,), without slivers; off_plane (F,): the
    greatest distance of a facet's corners from its mean plane.
    """

    vertices: np.ndarray
    corners: np.ndarray
    first: np.ndarray
    labels: list[Label]
    label: np.ndarray
    temperature: np.ndarray
    triangles: np.ndarray
    triangle_facet: np.ndarray
    off_plane: np.ndarray

    @property
    def count(self) -> int:
        """Number of facets."""
        return len(self.label)

    @property
    def box(self) -> np.ndarray:
        """Lowest and highest coordinates (2, 3) of the facets' corners [m]."""
        used = np.zeros(len(self.vertices), bool)
        used[self.corners] = True
        return np.stack([self.vertices[used].min(axis=0), self.vertices[used].max(axis=0)])

    def facets_of(self, kind: str) -> np.ndarray:
        """Mask (F,) of the facets of a type: f (model), s (sky) or t (terrain)."""
        return np.array([label.type == kind for label in self.labels])[self.label]


def read(
    path: str | Path,
    temperatures: str | Path | None = None,
    material: str | None = None,
    materials: str | Path | None = None,
    scale: float = 1.0,
) -> Model:
    """The model in a labelled OBJ file.

    temperatures: CSV facet,kelvin, which takes the place of the labels' temperatures. material:
    known name that takes the place of those on model facets (f). With both, facets without a label
    are model facets. materials: TOML file of the user's own. scale: metres in the file's unit of
    length. Raises InputError, one line, for a file, label or table that cannot be used.
    """
    known = known_materials.names(materials)
    material = material and find_material(material, known)
    if not 0 < scale < np.inf:
        raise InputError(
            f"scale {scale:g} must be positive: metres in the file's unit of length, such as 0.001"
        )
    obj = read_obj(path)
    labels, label = _labels(obj, known, material, bool(temperatures))
    if temperatures:
        temperature = _read_temperatures(Path(temperatures), len(label))
    else:
        temperature = np.array([one.temperature for one in labels])[label]

    vertices = obj.vertices * scale
    used = np.zeros(len(vertices), bool)
    used[obj.corners] = True
    used = np.flatnonzero(used)
    if abs(vertices[used]).max() > FARTHEST:
        raise InputError(
            f"{path}: a corner lies {abs(vertices[used]).max():g} m from the origin, more than {FARTHEST:g} m; "
            "see --scale"
        )
    away, size = abs(vertices[used]).max(), np.ptp(vertices[used], axis=0).max()
    if away > SIZES_AWAY * size > 0:
        raise InputError(
            f"{path}: the model, {size:g} m in size, lies {away:g} m from the origin, too far for the renderer's single "
            "precision; move it to the origin"
        )
    weld_to = np.arange(len(vertices))
    weld_to[used] = used[weld(vertices[used])]
    corners = weld_to[obj.corners]
    triangles, triangle_facet, off_plane, crossed = triangulate(vertices, corners, obj.first)
    if crossed.any():
        size = int(np.diff(obj.first)[crossed.argmax()])
        if size > MOST_CLIPPED:
            raise InputError(
                f"{path}, line {obj.lines[crossed.argmax()]}: the face has {size} corners and is not "
                f"convex; split it into polygons of at most {MOST_CLIPPED}"
            )
        raise InputError(
            f"{path}, line {obj.lines[crossed.argmax()]}: the face crosses itself or folds back on itself"
            f"{_others(int(crossed.sum()) - 1)}; split it into simple polygons"
        )
    if len(triangles) == 0:
        raise InputError(f"{path}: no face has an area; all corners of each lie on a line")
    return Model(
        vertices,
        corners,
        obj.first,
        labels,
        label,
        temperature,
        triangles,
        triangle_facet,
        off_plane,
    )


def _labels(obj, known, material, has_temperatures):
    """The Labels that faces use, and which of them (F,) holds for each face."""
    used, label = np.unique(obj.name, return_inverse=True)
    labels = []
    for name in used:
        if name >= 0:
            line, kind, text = obj.names[name]
            try:
                labels.append(parse(text, known, material, has_temperatures))
            except InputError as error:
                raise InputError(f"{obj.path}, line {line}: {kind} '{text}': {error}") from None
        elif material and has_temperatures:
            labels.append(unlabelled(material))
        else:
            missing = " and ".join(
                option
                for option, given in (
                    ("--material", material),
                    ("--temperatures", has_temperatures),
                )
                if not given
            )
            raise InputError(
                f"{obj.path}, line {obj.lines[np.argmin(obj.name)]}: the face has no label; name its object or "
                f"group {{f|s|t}}*{{material}}*{{kelvin}}*, such as f*bare_aluminum*300*, or give {missing}"
            )
    return labels, label


def _read_temperatures(path, count):
    """Temperatures (F,) in kelvin from a CSV facet,kelvin that names each facet once."""
    table = read_table(path, ("facet", "kelvin"))
    facet_column, kelvin_column = (table.columns.index(name) for name in ("facet", "kelvin"))
    temperature = np.zeros(count)
    for number, cells in table.rows:
        cell = cells[facet_column]
        try:
            facet = int(cell) if cell.isascii() and cell.isdecimal() and len(cell) < 10 else -1
            if not 0 <= facet < count:
                raise InputError(
                    f"facet {shown(cell)} does not exist; facets are numbered 0..{count - 1}"
                )
            if temperature[facet]:
                raise InputError(f"facet {facet} is given twice")
            mark = "." if table.separator == "," else ","
            temperature[facet] = kelvin(cells[kelvin_column].replace(mark, "."))
        except InputError as error:
            raise InputError(f"{path}, line {number}: {error}") from None
    missing = np.flatnonzero(temperature == 0)
    if len(missing):
        raise InputError(
            f"{path}: {count - len(missing)} temperatures for {count} facets; the first that is missing is "
            f"facet {missing[0]}"
        )
    return temperature


def _others(count):
    return f" ({count} more do{'es' * (count == 1)})" if count else ""
