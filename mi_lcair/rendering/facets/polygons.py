"""Facets as polygons, put together from their triangles."""

from dataclasses import dataclass
from os import PathLike

import numpy as np

from mi_lcair.formats import VTK, vtk

# `saved_by` of results with facets, whose files `write_vtk` writes
WRITERS = dict.fromkeys(VTK, f"{__name__}:write_vtk")
PLANAR = 1e-7  # largest relative error of the area for which an outline replaces its triangles


@dataclass(frozen=True)
class FacetPolygons:
    """Polygons of facets.

    vertices: corners (n, 3) [m], in Float64. faces: corners of each polygon, as rows of `vertices`,
    anticlockwise about the facet's normal. facet: number of each polygon's facet. A facet is one
    polygon, or its triangles where no single outline has its area: with holes, in several pieces,
    or out of a plane.
    """

    vertices: np.ndarray
    faces: list[np.ndarray]
    facet: np.ndarray

    @staticmethod
    def of(triangles: np.ndarray, triangle_facet: np.ndarray) -> "FacetPolygons":
        """The polygons of triangles (T, 3, 3) [m] that belong to the facets (T,)."""
        if not len(triangles):
            return FacetPolygons(np.zeros((0, 3)), [], np.zeros(0, np.int64))
        vertices, corners = np.unique(
            np.reshape(triangles, (-1, 3)).astype(np.float64) + 0.0, axis=0, return_inverse=True
        )
        corners = corners.reshape(-1, 3)
        order = np.argsort(triangle_facet, kind="stable")
        numbers, begins = np.unique(triangle_facet[order], return_index=True)
        faces, facet = [], []
        for number, of_facet in zip(numbers, np.split(order, begins[1:])):
            polygons = (
                [corners[of_facet[0]]]
                if len(of_facet) == 1
                else _merged(vertices, corners[of_facet])
            )
            faces += polygons
            facet += [number] * len(polygons)
        return FacetPolygons(vertices, faces, np.array(facet, dtype=np.int64))

    def write(self, path: str | PathLike[str], columns: dict[str, np.ndarray]) -> None:
        """Write the polygons as a .vtp or .vtu file with the columns of a table of facets.

        columns: `facet`, the number of each row's facet, and others by name with the unit. Facets
        without a row are left out. Raises InputError as `vtk.write_facets`.
        """
        row = np.full(1 + max(self.facet.max(initial=0), columns["facet"].max(initial=0)), -1)
        row[columns["facet"]] = np.arange(len(columns["facet"]))
        places = row[self.facet]
        faces = [face for face, place in zip(self.faces, places) if place >= 0]
        cells = {name: values[places[places >= 0]] for name, values in columns.items()}
        vtk.write_facets(path, self.vertices, faces, cells)


def write_vtk(path: str | PathLike[str], facets) -> None:
    """Write facets with all columns of their table as a .vtp or .vtu file.

    facets: what has `triangles`, `triangle_facet` and `columns`, such as a FacetTable.
    """
    FacetPolygons.of(facets.triangles, facets.triangle_facet).write(path, facets.columns())


def _merged(vertices: np.ndarray, triangles: np.ndarray) -> list[np.ndarray]:
    """The outline of some triangles (n, 3) as one polygon, or the triangles themselves."""
    loop = _outline(triangles.tolist())
    if loop is None:
        return list(triangles)
    # A polygon that is not quite planar has an area only with its triangles. Programs split a
    # polygon into a fan about its first corner, so that is the corner that most triangles share.
    corner, shared = np.unique(triangles, return_counts=True)
    start = loop.index(corner[shared.argmax()])
    loop = np.array(loop[start:] + loop[:start])
    area_of_triangles = np.linalg.norm(normals_of(vertices[triangles]), axis=1).sum()
    fan = normals_of(
        vertices[np.stack([np.full(len(loop) - 2, loop[0]), loop[1:-1], loop[2:]], axis=1)]
    )
    # The first holds for concave outlines too, the second also out of a plane
    for area in (np.linalg.norm(fan.sum(axis=0)), np.linalg.norm(fan, axis=1).sum()):
        if abs(area - area_of_triangles) <= PLANAR * area_of_triangles:
            return [loop]
    return list(triangles)


def _outline(triangles: list[list[int]]) -> list[int] | None:
    """Corners along the only outline of some triangles; None if there is no such outline."""
    following = {}
    edges = {(a, b) for p in triangles for a, b in zip(p, (*p[1:], p[0])) if a != b}
    for a, b in edges:
        if (b, a) not in edges:
            if a in following:
                return None
            following[a] = b
    if not following:
        return None
    loop = [next(iter(following))]
    while (corner := following.get(loop[-1])) not in (None, loop[0]):
        loop.append(corner)
        if len(loop) > len(following):
            return None
    return loop if len(loop) == len(following) > 2 else None


def normals_of(triangles: np.ndarray) -> np.ndarray:
    """Normals of triangles (n, 3, 3) whose lengths are twice their areas."""
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
