"""Derivatives of a surface's reflectance in its parameters, at a vertex of a path.

A call of a BSDF returns no derivatives inside a loop. The parameters of all surfaces of one kind
are therefore kept in tables here. The model's own equations are evaluated for a vertex, and
differentiated there in the few numbers that enter them.
"""

from dataclasses import dataclass
from operator import mul
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.physics import reflection
from mi_lcair.physics.reflection.directions import cos_theta, sin2_theta
from mi_lcair.plugins.bsdfs.plume import is_plume
from mi_lcair.plugins.bsdfs.reflection_bsdf import STEPS, is_reflection_bsdf, tables
from mi_lcair.plugins.bsdfs.uniform_table import interpolate_row
from mi_lcair.plugins.derivatives import children, flatten, own_memory
from mi_lcair.plugins.emission.triangles import pointer_id

DIFFUSE = "SmoothDiffuse"  # Mitsuba's `diffuse`
REFLECTANCE = "reflectance.value"  # its parameter


@dataclass(frozen=True)
class Kind:
    """What the code of a surface's derivatives depends on.

    model: name of the reflection model. form: form of its equations. lobe: brdf, mirror or diffuse.
    emissivity: kirchhoff, model or measured.
    """

    model: str
    form: str
    lobe: str
    emissivity: str


@dataclass
class Slopes:
    """Tables of all surfaces of one kind, with their derivatives.

    row: for twice the number of a BSDF, plus 1 for its back, the row of the surface in the tables,
    counted from 1; 0 for a BSDF of another kind. surface: the model's `Surface` of all rows.
    surface_slopes: its derivatives, for each parameter. HDR: the tables of the lobe's HDR, one
    after the other. HDR_slopes: their derivatives, for each parameter. columns: numbers of the
    columns, for each parameter. The others are those of `Kind`.
    """

    model: str
    form: str
    lobe: str
    emissivity: str
    row: mi.UInt32
    surface: Any
    surface_slopes: list
    HDR: mi.Float
    HDR_slopes: list[mi.Float]
    columns: list[mi.UInt32]

    @staticmethod
    def of(kind: Kind, surfaces: list[tuple], places: dict) -> "Slopes":
        """Tables of surfaces.

        Parameters
        ----------
        kind : Kind
        surfaces : list of tuple
            BSDFs of this kind, each with the numbers of the columns of its parameters.
        places : dict
            For each BSDF, the places in `row` that refer to it, see `places_of`.
        """
        # Paths also meet BSDFs of other kinds
        row = np.zeros(2 + max(max(of_bsdf) for of_bsdf in places.values()), dtype=np.uint32)
        for number, (bsdf, _) in enumerate(surfaces):
            row[places[bsdf]] = number + 1
        with_derivatives = [with_slopes(bsdf) for bsdf, _ in surfaces]
        count = len(surfaces[0][1])
        tables = Slopes(
            **vars(kind),
            row=mi.UInt32(row),
            surface=joined([S for (S, _), _ in with_derivatives]),
            surface_slopes=[
                joined([slopes[k][0] for _, slopes in with_derivatives]) for k in range(count)
            ],
            HDR=joined([table for (_, table), _ in with_derivatives]),
            HDR_slopes=[
                joined([slopes[k][1] for _, slopes in with_derivatives]) for k in range(count)
            ],
            columns=[mi.UInt32([numbers[k] for _, numbers in surfaces]) for k in range(count)],
        )
        own_memory(flatten(tuple(vars(tables).values())))
        return tables

    def at(self, bsdf, r) -> "Vertex":
        """The surface with which a path meets this kind, seen from the direction `r`."""
        back = r.z < 0
        place = 2 * dr.reinterpret_array(mi.UInt32, bsdf) + dr.select(back, mi.UInt32(1), 0)
        row = dr.gather(mi.UInt32, self.row, place)
        r = mi.Vector3f(r.x, r.y, dr.abs(r.z))
        return Vertex(self, (row > 0) & (r.z > 0), dr.maximum(row, 1) - 1, r, back)


class Vertex:
    """The surface at a vertex of each path, if it is of one kind, and its derivatives.

    known: whether the surface is of this kind. row: its row in the tables. r: direction to the
    observer, on the surface's upper side. back: whether that is the back of the shape.
    """

    def __init__(self, slopes: Slopes, known, row, r, back):
        self.slopes, self.known, self.row, self.r, self.back = slopes, known, row, r, back
        self.model = reflection.model(slopes.model)
        x = dr.sqrt(cos_theta(r))
        self.table = interpolate_row(slopes.HDR, row, STEPS, x)
        self.table_slopes = [interpolate_row(table, row, STEPS, x) for table in slopes.HDR_slopes]
        self.HDR = self.gradient(lambda S, floor, lobe: dr.minimum(floor + lobe, 1))

    def columns(self) -> list:
        """Number of the column of each parameter."""
        return [dr.gather(mi.UInt32, column, self.row) for column in self.slopes.columns]

    def emissivity(self) -> list:
        """Derivatives of the emissivity toward `r` in the parameters."""
        if self.slopes.emissivity == "kirchhoff":
            return [-slope for slope in self.HDR[1]]
        if self.slopes.emissivity == "measured":
            return [mi.Float(0) for _ in self.slopes.columns]
        cos, sin2 = cos_theta(self.r), sin2_theta(self.r)
        return self.gradient(lambda S, floor, lobe: self.model.emissivity(S, cos, sin2))[1]

    def along(self, i, is_delta=False) -> tuple:
        """BSDF times cosine for the direction `i` to the source [1/sr], and its derivatives.

        is_delta: where this is the reflectance of a delta lobe, or the transmittance of a plume.
        """
        i = mi.Vector3f(i.x, i.y, dr.select(self.back, -i.z, i.z))
        if self.slopes.lobe == "brdf":

            def f(S, floor, lobe):
                return self.model.f(S, i, self.r) / dr.maximum(floor + lobe, 1)

            (value, slopes), factor = self.gradient(f), cos_theta(i)
        else:
            (value, slopes), factor = self.HDR, dr.select(is_delta, 1, dr.inv_pi * cos_theta(i))
        return value * factor, [slope * factor for slope in slopes]

    def gradient(self, function) -> tuple:
        """A function of the surface and of floor and lobe of its raw HDR, and its derivatives.

        The function is differentiated with respect to the numbers of the `Surface` and the entry of
        the table. The chain rule leads from these to the parameters.
        """
        cos, sin2 = cos_theta(self.r), sin2_theta(self.r)

        def of_row(S):
            return S.map(lambda numbers: dr.gather(mi.Float, numbers, self.row))

        with dr.resume_grad():
            S, table = of_row(self.slopes.surface), mi.Float(self.table)
            dr.enable_grad(S, table)
            lobe = self.model.lobe_scale(S, cos, sin2) * table
            value = function(S, self.model.floor_HDR(S, cos, sin2), lobe)
            dr.backward_from(value)
            of_surface, of_table = S.map(dr.grad), dr.grad(table)
        slopes = [
            sum(map(mul, of_surface.numbers, of_row(S).numbers)) + of_table * slope
            for S, slope in zip(self.slopes.surface_slopes, self.table_slopes)
        ]

        def keep(number):
            return dr.select(self.known, dr.detach(number), 0)

        return keep(value), [keep(slope) for slope in slopes]


def kind_of(bsdf) -> Kind | None:
    """The kind of a BSDF; None if its derivatives are not known."""
    if is_reflection_bsdf(bsdf):
        emissivity = "measured" if bsdf.measured is not None else bsdf.emissivity
        return Kind(bsdf.model.name, bsdf.form, bsdf.lobe, emissivity)
    if is_plume(bsdf) or (bsdf.class_name() == DIFFUSE and REFLECTANCE in mi.traverse(bsdf)):
        return Kind("grey", "standard", "diffuse", "kirchhoff")
    return None


def names_of(bsdf) -> tuple[str, ...]:
    """Names of the parameters of a BSDF that has a kind."""
    if is_plume(bsdf):
        return ("transmittance",)
    return bsdf.model.names if is_reflection_bsdf(bsdf) else ("reflectance",)


def with_slopes(bsdf) -> tuple:
    """The `Surface` and the table of HDR of a BSDF, and their derivatives in each parameter."""
    if is_reflection_bsdf(bsdf):
        model, form, values = bsdf.model, bsdf.form, bsdf.values

        def function(*values):
            return tables(model, values, form)
    else:
        # A plume's transmittance has the same derivatives as a grey surface's reflectance.
        model, form = reflection.model("grey"), "standard"
        key = "transmittance" if is_plume(bsdf) else REFLECTANCE
        values = (float(dr.detach(mi.traverse(bsdf)[key])[0]),)
        # In Float32 the difference 1 - rho would be wrong for a small rho
        exact = dr.float64_array_t(mi.Float)

        def function(rho):
            return tables(model, (1 - exact(rho),), form)

    slopes = []
    for number in (None, *range(len(values))):
        with dr.resume_grad():
            parameters = [mi.Float(value) for value in values]
            dr.make_opaque(parameters)
            if number is None:
                plain = function(*parameters)
                continue
            dr.enable_grad(parameters[number])
            S, table = function(*parameters)
            dr.forward_from(parameters[number])
            slope = S.map(dr.grad), dr.grad(table)
        dr.eval(slope)
        slopes.append(slope)
    return plain, slopes


def joined(parts: list):
    """Arrays, or the numbers of `Surface`s, one after the other."""

    def join(arrays):
        return mi.Float(np.concatenate([array.numpy() for array in arrays]))

    if dr.is_array_v(parts[0]):
        return join(parts)
    columns = iter(zip(*(part.numbers for part in parts)))
    return parts[0].map(lambda _: join(next(columns)))


def places_of(bsdfs) -> dict:
    """For each BSDF, its places in a table with two entries for each BSDF: its front, its back.

    A `twosided` BSDF refers to those that it wraps. Both sides of a plume are the same.
    """
    places = {}
    for bsdf in bsdfs:
        number = 2 * pointer_id(mi.BSDFPtr(bsdf))
        if bsdf.class_name() == "TwoSidedBRDF":
            inner = children(bsdf)
            for side, layer in ((0, inner[0]), (1, inner[-1])):
                places.setdefault(layer, []).append(number + side)
        else:
            sides = [number, number + 1] if is_plume(bsdf) else [number]
            places.setdefault(bsdf, []).extend(sides)
    return places
