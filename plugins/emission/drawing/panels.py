"""The panels of emitting meshes, toward which directions are drawn: rectangles and triangles."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.emission.drawing.spherical_polygon import Receiver, SphericalPolygon
from mi_lcair.plugins.emission.drawing.spherical_rectangle import SphericalRectangle
from mi_lcair.plugins.emission.drawing.spherical_triangle import SphericalTriangle
from mi_lcair.plugins.emission.triangles import TriangleTable

ROUNDING = 1e-5  # relative error of a rectangle's sides and right angles that counts as rounding


class Panels:
    """The triangles of some meshes, of which two that form a rectangle are one panel.

    table: the `TriangleTable`. of_triangles: the panel of each triangle. first: the first triangle
    of each panel; is_rectangle: whether it has two; both NumPy. counts: number of panels of each
    mesh. area: of the panels [m^2]. radiance: bounds [W m^-2 sr^-1]. emits_behind: whether they
    emit on both sides. These three are NumPy, (n,).
    """

    def __init__(self, table: TriangleTable, radiance, emits_behind):
        """radiance, emits_behind: one for each triangle."""
        self.table = table
        rows = table.rows.numpy().astype(np.float64).reshape(-1, 3, 4)
        mesh = np.repeat(np.arange(len(table.counts)), table.counts)
        vertices, like = vertices_of(rows), np.stack([mesh, radiance, emits_behind], 1)
        corner = right_angle(vertices)
        pairs = rectangles(vertices, corner, like)
        is_second = np.zeros(len(rows), bool)
        is_second[pairs + 1] = True
        self.first = np.flatnonzero(~is_second)
        self.is_rectangle = np.isin(self.first, pairs)
        self.counts = np.bincount(mesh[self.first], minlength=len(table.counts)).tolist()
        self.area = table.area[self.first] * np.where(self.is_rectangle, 2, 1)
        self.radiance, self.emits_behind = radiance[self.first], emits_behind[self.first]
        vertices = vertices[self.first]
        # The corner of a rectangle is that of its right angle
        turn = (np.where(self.is_rectangle, corner[self.first], 0)[:, None] + np.arange(3)) % 3
        vertices = np.take_along_axis(vertices, turn[:, :, None], axis=1)
        edges = vertices[:, 1:] - vertices[:, :1]
        self.corners = np.concatenate([vertices, vertices[:, 1:2] + edges[:, 1:2]], axis=1)
        self.corners[~self.is_rectangle, 3] = vertices[~self.is_rectangle, 2]
        self.normal = rows[self.first, :, 3]
        panels = np.concatenate([vertices[:, :1], edges], axis=1)
        panels = np.concatenate([panels, self.normal[:, :, None]], axis=2)
        self.rows = mi.Float(panels.ravel())
        self.of_triangles = mi.UInt32(np.cumsum(~is_second) - 1)
        self.kinds = mi.UInt32(self.is_rectangle)
        dr.make_opaque(self.rows, self.of_triangles, self.kinds)

    def find(self, shape, prim_index, active=True) -> tuple[mi.UInt32, mi.Bool]:
        """The panel of a shape's triangle, and whether there is one."""
        triangle, known = self.table.find(shape, prim_index, active)
        return dr.gather(mi.UInt32, self.of_triangles, triangle, known), known

    def seen(self, panel, receiver: Receiver, active=True) -> "SeenPanel":
        """A panel as seen from a point of a surface."""
        corner, *edges = (
            dr.gather(mi.Vector4f, self.rows, 3 * panel + row, active) for row in range(3)
        )
        normal = mi.Vector3f(corner.w, *(edge.w for edge in edges))
        kinds = [SphericalTriangle, SphericalRectangle]
        if not self.is_rectangle.any():
            kinds = kinds[:1]
        elif self.is_rectangle.all():
            kinds = kinds[1:]
        forms = [
            kind.of(corner.xyz, *(edge.xyz for edge in edges), normal, receiver) for kind in kinds
        ]
        is_rectangle = dr.gather(mi.UInt32, self.kinds, panel, active) > 0
        return SeenPanel(forms, is_rectangle)


@dataclass
class SeenPanel:
    """A panel as seen from a point: a polygon for each kind that a scene has, and which it is."""

    forms: list[SphericalPolygon]
    is_rectangle: mi.Bool

    @property
    def n(self) -> mi.Vector3f:
        """The panel's normal."""
        return self.forms[0].n

    @property
    def distance(self) -> mi.Float:
        """Distance of its plane, negative in front of it [m]."""
        return self.forms[0].distance

    @property
    def projected(self) -> mi.Float:
        """Projected solid angle [sr]."""
        return self.of_kind(lambda form: form.projected)

    def draw(self, sample) -> tuple[mi.Vector3f, mi.Float, mi.Float]:
        """See `SphericalPolygon.draw`."""
        return self.of_kind(lambda form: form.draw(sample))

    def along(self, d, length) -> mi.Float:
        """See `SphericalPolygon.along`."""
        return self.of_kind(lambda form: form.along(d, length))

    def of_kind(self, result):
        values = [result(form) for form in self.forms]
        if len(values) == 1:
            return values[0]
        return dr.select(self.is_rectangle, values[1], values[0])


def vertices_of(rows) -> np.ndarray:
    """Vertices of triangles [m], (n, 3, 3). rows: those of a `TriangleTable`."""
    return rows[:, :1, :3] + np.pad(rows[:, 1:, :3], [(0, 0), (1, 0), (0, 0)])


def right_angle(vertices) -> np.ndarray:
    """Number of the corner of each triangle that is nearest to a right angle, (n,)."""
    after, before = (np.roll(vertices, k, axis=1) - vertices for k in (-1, 1))
    cos = np.abs(np.sum(after * before, axis=2))
    return np.argmin(cos / np.maximum(norms(after) * norms(before), 1e-300), axis=1)


def norms(vectors) -> np.ndarray:
    return np.linalg.norm(vectors, axis=-1)


def rectangles(vertices, corner, like) -> np.ndarray:
    """Numbers of the triangles that form a rectangle with the next one.

    corner: the result of `right_angle`. like: what both must have in common, (n, m).
    """
    turn = (corner[:, None] + np.arange(3)) % 3
    right, end_1, end_2 = np.moveaxis(np.take_along_axis(vertices, turn[:, :, None], 1), 1, 0)
    sides = end_1 - right, end_2 - right
    size = norms(end_1 - end_2)
    is_right = np.abs(np.sum(sides[0] * sides[1], axis=1)) < ROUNDING * norms(sides[0]) * norms(
        sides[1]
    )
    # The next triangle has its right angle opposite, and the same long side the other way round
    apart = [
        right[1:] - (end_1 + end_2 - right)[:-1],
        end_1[1:] - end_2[:-1],
        end_2[1:] - end_1[:-1],
    ]
    is_pair = is_right[:-1] & (like[:-1] == like[1:]).all(axis=1)
    for gap in apart:
        is_pair &= norms(gap) < ROUNDING * size[:-1]
    pairs, last = [], -2
    for number in np.flatnonzero(is_pair):
        if number > last + 1:
            pairs.append(number)
            last = number
    return np.array(pairs, dtype=int)
