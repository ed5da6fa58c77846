"""Tables of the parameters in which the radiance of paths is differentiated."""

from dataclasses import dataclass, replace
from operator import mul
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.physics import reflection
from mi_lcair.physics.reflection.interface import cos_theta, sin2_theta
from mi_lcair.plugins.bsdfs.plume import is_plume
from mi_lcair.plugins.bsdfs.reflection_bsdf import (
    STEPS,
    interpolate_row,
    is_reflection_bsdf,
    parts_of_HDR,
    tables,
)
from mi_lcair.plugins.columns.kinds import MaterialColumn
from mi_lcair.plugins.derivatives import attached, children, flatten, nodes, own_memory, variables
from mi_lcair.plugins.emission.triangles import pointer_id
from mi_lcair.plugins.emitters.thermal_emitter import is_thermal
from mi_lcair.plugins.paths.launch import Launch

# Derivatives of a surface's reflectance in its parameters, at a vertex of a path
# -------------------------------------------------------------------------------
# A call of a BSDF returns no derivatives inside a loop. The parameters of all surfaces of one kind
# are therefore kept in tables here. The model's own equations are evaluated for a vertex, and
# differentiated there in the few numbers that enter them.

DIFFUSE = "SmoothDiffuse"  # Mitsuba's `diffuse`
REFLECTANCE = "reflectance.value"  # its parameter


@dataclass(frozen=True)
class MaterialKind:
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
    columns, for each parameter. The others are those of `MaterialKind`.
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
    def of(kind: MaterialKind, surfaces: list[tuple], places: dict) -> "Slopes":
        """Tables of surfaces.

        Parameters
        ----------
        kind : MaterialKind
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


def kind_of(bsdf) -> MaterialKind | None:
    """The kind of a BSDF; None if its derivatives are not known."""
    if is_reflection_bsdf(bsdf):
        emissivity = "measured" if bsdf.measured is not None else bsdf.emissivity
        return MaterialKind(bsdf.model.name, bsdf.form, bsdf.lobe, emissivity)
    if is_plume(bsdf) or (bsdf.class_name() == DIFFUSE and REFLECTANCE in mi.traverse(bsdf)):
        return MaterialKind("grey", "standard", "diffuse", "kirchhoff")
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


# Surfaces at which a render of derivatives explores what they do not reflect
# ---------------------------------------------------------------------------
# A path ends where its weight becomes 0. The derivative with respect to a reflectance of 0 is not
# 0, and needs the radiance that the surface would reflect. A render of derivatives therefore
# explores such surfaces. Its paths go on from there as latent paths, which count for the derivative
# at that surface alone. The floor and the lobe of a reflection model are both sampled, also where
# one of them is 0.

SMALL = 0.02  # reflectance, or share of it, below which too few paths follow it for a derivative
DEGREES = (5, 30, 55, 75)  # angles of the observer at which reflectances are compared with SMALL


def needs_exploring(bsdf, names) -> bool:
    """Whether paths would miss a part of the derivatives of a surface where they are not explored.

    names: the parameters of the BSDF with respect to which it is differentiated.
    """
    if not is_reflection_bsdf(bsdf):
        # Of other BSDFs it is not known where they reflect nothing
        is_known = bsdf.class_name() == DIFFUSE or is_plume(bsdf)
        numbers = [
            value for key, value in mi.traverse(bsdf).items() if key.removesuffix(".value") in names
        ]
        return not is_known or any(np.min(np.array(number)) < SMALL for number in numbers)
    if bsdf.change:
        return False  # has no derivatives along paths
    theta = np.radians(DEGREES)
    cos, sin2 = own_memory([mi.Float(np.cos(theta)), mi.Float(np.sin(theta) ** 2)])
    floor, lobe = (dr.detach(part).numpy() for part in bsdf.raw_HDR(cos, sin2))
    if np.min(floor + lobe) < SMALL:
        return True
    if bsdf.lobe != "brdf":
        return False
    is_small = [np.min(part / (floor + lobe)) < SMALL for part in (floor, lobe)]
    return any(is_small) and any(
        np.any(np.array(is_small) & depends_on(bsdf, name, cos, sin2)) for name in names
    )


def depends_on(bsdf, name: str, cos, sin2) -> np.ndarray:
    """Whether the floor's and the lobe's HDR depend on a parameter of a reflection model, (2,)."""
    with dr.resume_grad():
        values = {key: mi.Float(value) for key, value in zip(bsdf.model.names, bsdf.values)}
        dr.make_opaque(values)
        dr.enable_grad(values[name])
        derived = tables(bsdf.model, tuple(values.values()), bsdf.form)
        parts = parts_of_HDR(bsdf.model, derived, cos, sin2)
        dr.forward_from(values[name])
        return np.array([np.abs(dr.grad(part).numpy()).max() > SMALL for part in parts])


def explored_by_gradients(objects) -> frozenset:
    """The BSDFs of a scene that a replay has to explore, for the parameters that have gradients."""
    names_by_bsdf = differentiated(objects)
    return frozenset(bsdf for bsdf, names in names_by_bsdf.items() if needs_exploring(bsdf, names))


def differentiated(objects) -> dict:
    """The BSDFs of a scene that have parameters with gradients, and the names of these."""
    names_by_bsdf = {}
    for bsdf in objects:
        if not isinstance(bsdf, mi.BSDF) or any(isinstance(c, mi.BSDF) for c in children(bsdf)):
            continue
        arrays = [(key, value) for key, value in mi.traverse(bsdf).items() if dr.is_array_v(value)]
        names = {key.removesuffix(".value") for key, v in arrays if attached(variables(v))}
        if names:
            names_by_bsdf[bsdf] = names
    return names_by_bsdf


# Numbers of columns of one launch. There are few, because each needs its own kernel.
SIZES = (4, 8, 16, 32, 64)
CELLS = 32  # cells along each side of the film that have their own mean incoming radiance
NARROW = 0.1  # width of a lobe below which the radiance in its mirror direction stands for it
PILOT_POINTS = 16  # paths of each randomisation and cell that measure the incoming radiance


@dataclass
class ColumnTables:
    """What a launch needs to record columns, as Dr.Jit arrays.

    size: number of columns; the columns of materials are the first `materials`. slopes: tables of
    the materials, one for each kind. first, stride: entry of an emitter's first facet in the
    following tables, and 1 if each facet has its own. radiance: radiance of the source before
    emissivity [W m^-2 sr^-1]; 0 where it does not depend on a material. weight: factor of the
    source's radiance in the recorded sum; None if all are 1. sources: columns of the emitters'
    parameters, and the relative derivative of the radiance. surface: for each BSDF its number,
    counted from 1; 0 for those without a column. incoming: mean incoming radiance of the cells of
    the film at the first reflection, and then of the surfaces at later ones [W m^-2 sr^-1]; None to
    measure it. has_mirrors: whether a surface with columns has a narrow lobe. mirrored: where
    that is so, the mean of what is emitted along the mirror direction, at the same places as
    `incoming`.
    """

    size: int
    materials: int
    slopes: list[Slopes]
    first: mi.UInt32
    stride: mi.UInt32
    radiance: mi.Float
    weight: mi.Float | None
    sources: list[tuple[mi.UInt32, mi.Float]]
    surface: mi.UInt32
    surfaces: int
    incoming: mi.Float | None
    has_mirrors: bool = False
    mirrored: mi.Float | None = None

    @staticmethod
    def of_surfaces(objects, surfaces) -> "ColumnTables":
        """Tables for the incoming radiance of some BSDFs of a scene alone, without columns."""
        none, zero = mi.UInt32(0), mi.Float(0)
        places = places_of([node for node in objects if isinstance(node, mi.BSDF)])
        numbers = surface_numbers(places, surfaces)
        return ColumnTables(0, 0, [], none, none, zero, None, [], numbers, len(surfaces), None)

    def with_incoming(self, incoming: np.ndarray, mirrored=None) -> "ColumnTables":
        tables = [mi.Float(table) for table in (incoming, mirrored) if table is not None]
        own_memory(tables)
        return replace(self, incoming=tables[0], mirrored=tables[-1])

    def entry(self, emitter, prim_index):
        """Entry of an emitter's facet in the tables; 0 if there is no emitter."""
        key = dr.reinterpret_array(mi.UInt32, emitter)
        facet = dr.gather(mi.UInt32, self.stride, key) * prim_index
        return dr.gather(mi.UInt32, self.first, key) + facet

    def weight_of(self, emission):
        """Factor of an emission in the recorded sum, from the weights of its parts."""
        return sum(
            share * dr.gather(mi.Float, self.weight, self.entry(emission.emitter, part))
            for part, share in emission.parts
        )

    def vertices(self, bsdf, wi) -> list[Vertex]:
        """The surfaces that paths meet, for each kind, seen from the direction `wi`."""
        return [slopes.at(bsdf, wi) for slopes in self.slopes]

    def surface_number(self, bsdf):
        """Number of a surface, counted from 1; 0 if it has no column."""
        return dr.gather(mi.UInt32, self.surface, dr.reinterpret_array(mi.UInt32, bsdf))


def column_tables(scene, columns: list, weights: dict | None = None) -> ColumnTables:
    """Tables of the columns of some parameters, without the incoming radiance.

    Parameters
    ----------
    scene : mi.Scene
    columns : list of MaterialColumn or SourceColumn
        The materials' parameters come first.
    weights : dict or None
        For each emitter, the factors of its radiance in the recorded sum: one number, or one for
        each facet.

    Returns
    -------
    ColumnTables
    """
    of_materials = [column for column in columns if isinstance(column, MaterialColumn)]
    size = next((size for size in SIZES if size >= len(columns)), None)
    if size is None:
        raise InputError(f"{len(columns)} columns; one launch records at most {SIZES[-1]}")
    numbers_of = {}  # for each BSDF the numbers of the columns of its parameters
    for number, column in enumerate(of_materials):
        for bsdf in column.surfaces:
            names = names_of(bsdf)
            numbers = numbers_of.setdefault(bsdf, [size] * len(names))
            numbers[names.index(column.parameter)] = number
    bsdfs = [node for node in nodes(scene) if isinstance(node, mi.BSDF)]
    places, by_kind = places_of(bsdfs), {}
    for bsdf, numbers in numbers_of.items():
        by_kind.setdefault(kind_of(bsdf), []).append((bsdf, numbers))
    return ColumnTables(
        size=size,
        materials=len(of_materials),
        slopes=[Slopes.of(kind, surfaces, places) for kind, surfaces in by_kind.items()],
        **emitter_tables(scene, columns[len(of_materials) :], len(of_materials), size, weights),
        surface=surface_numbers(places, numbers_of),
        surfaces=len(numbers_of),
        incoming=None,
        has_mirrors=any(map(is_mirror_like, numbers_of)),
    )


def is_mirror_like(bsdf) -> bool:
    """Whether a BSDF has a lobe so narrow that it reflects little but its mirror direction."""
    if not is_reflection_bsdf(bsdf) or bsdf.lobe != "brdf":
        return False
    return float(bsdf.model.lobe_width(dr.detach(bsdf.surface))[0]) < NARROW


def surface_numbers(places: dict, surfaces) -> mi.UInt32:
    """For the pointer to each BSDF, its number among some surfaces from 1 on; 0 for others.

    places: see `places_of`.
    """
    table = np.zeros(1 + max(place // 2 for of in places.values() for place in of), np.uint32)
    for number, bsdf in enumerate(surfaces):
        table[[place // 2 for place in places[bsdf]]] = number + 1
    numbers = mi.UInt32(table)
    own_memory([numbers])
    return numbers


def pilot_launch(seed: int, randomisations: int) -> Launch:
    """Paths through the cells of the film."""
    return Launch(CELLS, CELLS, seed, randomisations, PILOT_POINTS, windows=CELLS**2)


def incoming_radiance(found: dict, surfaces: int, name: str = "reflected") -> np.ndarray:
    """The table `ColumnTables.incoming` from the channels of a pilot through the cells.

    name: "reflected", or "mirrored" for the table `ColumnTables.mirrored`.
    """

    def measured(name):
        return np.array([found[f"{name}.{k}"].sum(axis=1) for k in range(surfaces + 1)])

    reflected, throughput = measured(name), measured("throughput")

    def ratio(a, b, otherwise):
        return np.where(b > 0, a / np.where(b > 0, b, 1), otherwise)

    means = ratio(reflected.sum(axis=1), throughput.sum(axis=1), 0.0)
    cells = ratio(reflected[0], throughput[0], means[0])
    # A surface without a column has the number 0 and no score
    return np.concatenate([cells, [0.0], means[1:]])


def emitter_tables(scene, columns: list, first_number: int, size: int, weights) -> dict:
    """The parts of `ColumnTables` that depend on the emitters' facets.

    columns: the `SourceColumn`s, which are numbered from `first_number` on. size: number that
    stands for no column.
    """
    emitters = [emitter for emitter in scene.emitters() if is_thermal(emitter)]
    ids = [pointer_id(mi.EmitterPtr(emitter)) for emitter in scene.emitters()]
    first, stride = np.zeros((2, max(ids, default=0) + 1), dtype=np.uint32)
    radiance, weight, of_columns = [np.zeros(1)], [np.ones(1)], [[np.zeros(1)] for _ in columns]
    entries = 1
    for emitter in emitters:
        key, depends = pointer_id(mi.EmitterPtr(emitter)), emitter.given_emissivity is None
        source = emitter.facet_radiance()
        if source is None:
            raise InputError(
                f"group {emitter.group}: its temperature varies inside the facets, so that there "
                "are no derivatives; give it a temperature per facet (face_temperature)"
            )
        source = dr.detach(source).numpy().astype(float)
        count = len(source)
        first[key], stride[key] = entries, count > 1
        entries += count
        radiance.append(source * depends)
        weight.append(np.broadcast_to(1.0 if weights is None else weights[emitter], count))
        for column, parts in zip(columns, of_columns):
            parts.append(np.broadcast_to(column.relative.get(emitter, 0.0), count))
    relative = np.array([np.concatenate(parts) for parts in of_columns]).reshape(-1, entries)
    # The columns that a facet belongs to, without gaps: most facets belong to one or two
    rank = np.cumsum(relative != 0, axis=0) * (relative != 0)
    tables = []
    for k in range(1, rank.max(initial=0) + 1):
        has_rank = rank == k
        numbers = np.where(has_rank.any(axis=0), has_rank.argmax(axis=0) + first_number, size)
        tables.append((mi.UInt32(numbers), mi.Float(np.sum(relative * has_rank, axis=0))))
    made = {
        "first": mi.UInt32(first),
        "stride": mi.UInt32(stride),
        "radiance": mi.Float(np.concatenate(radiance)),
        "weight": None if weights is None else mi.Float(np.concatenate(weight)),
        "sources": tables,
    }
    own_memory([array for array in made.values() if dr.is_array_v(array)])
    own_memory([array for pair in tables for array in pair])
    return made
