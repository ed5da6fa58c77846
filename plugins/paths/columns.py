"""Derivatives of the radiance of paths in parameters, recorded while the paths are traced.

A path's radiance is a sum over the emitters that it meets: L = sum_k beta_k Le_k. It depends on a
parameter of an emitter through Le_k alone, and on a parameter of a material through the throughput
beta_k and the emissivity. The sampled directions and their densities are constants. The derivative
of L in a material's parameter p is therefore, with the scores s_j = d log f_j / dp,

    dL/dp = sum_k beta_k dLe_k/dp + sum_j s_j (radiance after reflection j).

The radiance after reflection j is the whole radiance less that before it. Two sums along the path
suffice: A = sum_j s_j and E = sum_k beta_k dLe_k/dp - sum_j s_j (radiance before reflection j),
and dL/dp = E + A L. All columns come from the same paths.

For a narrow lobe the scores are large, and cancel only in the mean over many paths. The control
variate Z = sum_j beta_j c_j (d HDR_j/dp - w_j s_j), with w = f / pdf, has the mean 0 for any c that
does not depend on the sampled direction. Where c is the mean incoming radiance, E + A L + Z is free
of most of this noise.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins.derivatives import nodes, own_memory
from mi_lcair.plugins.emission.triangles import pointer_id
from mi_lcair.plugins.paths.channels import add_to, entries
from mi_lcair.plugins.paths.column_kinds import MaterialColumn
from mi_lcair.plugins.paths.surface_slopes import Slopes, Vertex, kind_of, names_of, places_of

# Numbers of columns of one launch. There are few, because each needs its own kernel.
SIZES = (4, 8, 16, 32, 64)
CELLS = 32  # cells along each side of the film that have their own mean incoming radiance


@dataclass
class ColumnTables:
    """What a launch needs to record columns, as Dr.Jit arrays.

    size: number of columns; the columns of materials are the first `materials`. slopes: tables of
    the materials, one for each kind. first, stride: entry of an emitter's first facet in the
    following tables, and 1 if each facet has its own. radiance: radiance of the source before
    emissivity [W m^-2 sr^-1]; 0 where it does not depend on a material. weight: factor of the
    source's radiance in the recorded sum; None if all are 1. sources: columns of the emitters'
    parameters, and the relative derivative of the radiance in the parameter. surface: for each BSDF
    its number, counted from 1; 0 for those without a column. incoming: mean incoming radiance of
    the cells of the film at the first reflection, and then of the surfaces at later ones
    [W m^-2 sr^-1]; None to measure it.
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

    def entry(self, emitter, prim_index):
        """Entry of an emitter's facet in the tables; 0 if there is no emitter."""
        key = dr.reinterpret_array(mi.UInt32, emitter)
        facet = dr.gather(mi.UInt32, self.stride, key) * prim_index
        return dr.gather(mi.UInt32, self.first, key) + facet

    def surface_number(self, bsdf):
        """Number of a surface, counted from 1; 0 if it has no column."""
        return dr.gather(mi.UInt32, self.surface, dr.reinterpret_array(mi.UInt32, bsdf))


@dataclass
class Columns:
    """Sums along each path from which its columns follow, see the top of this file.

    radiance: weighted radiance so far [W m^-2 sr^-1]. E, A, Z: the sums; their last entry takes
    what belongs to parameters without a column. cell: cell of the film in which the path begins.
    """

    radiance: mi.Float
    E: dr.Local
    A: dr.Local
    Z: dr.Local
    cell: mi.UInt32

    @staticmethod
    def empty(tables: ColumnTables, cell) -> "Columns | Incoming":
        if tables.incoming is None:
            return Incoming(mi.Float(0), *(zeros(tables.surfaces + 1) for _ in range(3)))
        return Columns(mi.Float(0), *(zeros(tables.size + 1) for _ in range(3)), mi.UInt32(cell))

    def vertices(self, tables: ColumnTables, bsdf, wi) -> list[Vertex]:
        """The surfaces that the paths meet, for each kind, seen from the direction `wi`."""
        return [slopes.at(bsdf, wi) for slopes in tables.slopes]

    def emit(self, tables, vertices, emitter, prim_index, Le, weight):
        """Add the emission at a vertex; returns its weighted part of the path's radiance.

        Parameters
        ----------
        tables : ColumnTables
        vertices : list of Vertex
            The emitting surface.
        emitter : mi.EmitterPtr
        prim_index : mi.UInt32
        Le : mi.Float
            The emission's part of the path's radiance [W m^-2 sr^-1].
        weight : mi.Float
            `Le` divided by the radiance that leaves the emitter; 0 where no surface emits.
        """
        entry = tables.entry(emitter, prim_index)
        if tables.weight is not None:
            factor = dr.gather(mi.Float, tables.weight, entry)
            Le, weight = Le * factor, weight * factor
        self.radiance += Le
        for columns, slopes in tables.sources:
            column = dr.gather(mi.UInt32, columns, entry)
            add_to(self.E, column, Le * dr.gather(mi.Float, slopes, entry))
        weight *= dr.gather(mi.Float, tables.radiance, entry)
        for vertex in vertices:
            for column, slope in zip(vertex.columns(), vertex.emissivity()):
                add_to(self.E, column, weight * slope)
        return Le

    def draw(self, vertices, wo, Lr):
        """Add the scores of a direction drawn toward an emitter.

        vertices: the reflecting surface. wo: the direction. Lr: the part of the path's radiance
        that it brings, weighted [W m^-2 sr^-1].
        """
        for vertex in vertices:
            for column, score in zip(vertex.columns(), vertex.relative(wo)):
                add_to(self.E, column, Lr * score)

    def reflect(self, tables, vertices, bsdf, bounce, beta, weight, wo, active):
        """Add the scores of a reflection.

        Parameters
        ----------
        tables : ColumnTables
        vertices : list of Vertex
            The reflecting surface.
        bsdf : mi.BSDFPtr
        bounce : mi.UInt32
            Number of reflections before this one.
        beta : mi.Float
            Throughput before the reflection.
        weight : mi.Float
            BSDF times cosine, divided by the density of the sampled direction.
        wo : mi.Vector3f
            The sampled direction.
        active : mi.Bool
        """
        later = CELLS * CELLS + tables.surface_number(bsdf)
        place = dr.select(bounce == 0, self.cell, later)
        c = beta * dr.gather(mi.Float, tables.incoming, place)
        for vertex in vertices:
            scores, slopes = vertex.relative(wo), vertex.HDR[1]
            for column, score, slope in zip(vertex.columns(), scores, slopes):
                score = dr.select(active, score, 0)
                add_to(self.A, column, score)
                add_to(self.E, column, -score * self.radiance)
                add_to(self.Z, column, dr.select(active, c * (slope - weight * score), 0))

    def samples(self, tables: ColumnTables) -> dict:
        """The columns of each path: column.N and, for materials, control.N.

        `weighted` is the weighted radiance, of which they are derivatives.
        """
        E, A, Z = (entries(local) for local in (self.E, self.A, self.Z))
        materials = range(tables.materials)
        found = {"weighted": self.radiance}
        found |= {f"column.{k}": E[k] + A[k] * self.radiance for k in materials}
        found |= {f"column.{k}": E[k] for k in range(tables.materials, tables.size)}
        return found | {f"control.{k}": Z[k] for k in materials}


@dataclass
class Incoming:
    """Measures the mean incoming radiance of reflections; used in place of `Columns`.

    The reflections are counted separately for the first one of each path and, after that, for each
    surface. radiance: as for `Columns`. number: number of reflections. before: radiance before
    them, summed. throughput: throughput after them, summed.
    """

    radiance: mi.Float
    number: dr.Local
    before: dr.Local
    throughput: dr.Local

    def vertices(self, tables, bsdf, wi) -> list:
        return []

    def emit(self, tables, vertices, emitter, prim_index, Le, weight):
        if tables.weight is not None:
            Le *= dr.gather(mi.Float, tables.weight, tables.entry(emitter, prim_index))
        self.radiance += Le
        return Le

    def draw(self, vertices, wo, Lr):
        """A drawn direction has no part in the incoming radiance of sampled directions."""

    def reflect(self, tables, vertices, bsdf, bounce, beta, weight, wo, active):
        place = dr.select(bounce == 0, 0, tables.surface_number(bsdf))
        counts = active & ((bounce == 0) | (place > 0))
        for sums, value in (
            (self.number, mi.Float(1)),
            (self.before, self.radiance),
            (self.throughput, beta * weight),
        ):
            add_to(sums, place, dr.select(counts, value, 0))

    def samples(self, tables: ColumnTables) -> dict:
        """reflected.N and throughput.N; N = 0 for the first reflection, then the surfaces."""
        number, before, throughput = map(entries, (self.number, self.before, self.throughput))
        found = {}
        for k in range(len(number)):
            found[f"reflected.{k}"] = number[k] * self.radiance - before[k]
            found[f"throughput.{k}"] = throughput[k]
        return found


def zeros(count: int) -> dr.Local:
    return dr.alloc_local(mi.Float, count, value=mi.Float(0))


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
    chosen = {}  # for each BSDF the numbers of the columns of its parameters
    for number, column in enumerate(of_materials):
        for bsdf in column.surfaces:
            names = names_of(bsdf)
            numbers = chosen.setdefault(bsdf, [size] * len(names))
            numbers[names.index(column.parameter)] = number
    bsdfs = [node for node in nodes(scene) if isinstance(node, mi.BSDF)]
    places, by_kind = places_of(bsdfs), {}
    for bsdf, numbers in chosen.items():
        by_kind.setdefault(kind_of(bsdf), []).append((bsdf, numbers))
    surface = np.zeros(1 + max(place // 2 for of in places.values() for place in of), np.uint32)
    for number, bsdf in enumerate(chosen):
        surface[[place // 2 for place in places[bsdf]]] = number + 1

    tables = ColumnTables(
        size=size,
        materials=len(of_materials),
        slopes=[Slopes.of(kind, surfaces, places) for kind, surfaces in by_kind.items()],
        **emitter_tables(scene, columns[len(of_materials) :], len(of_materials), size, weights),
        surface=mi.UInt32(surface),
        surfaces=len(chosen),
        incoming=None,
    )
    own_memory([tables.surface])
    return tables


def emitter_tables(scene, columns: list, first_number: int, size: int, weights) -> dict:
    """The parts of `ColumnTables` that depend on the emitters' facets.

    columns: the `SourceColumn`s, which are numbered from `first_number` on. size: number that
    stands for no column.
    """
    emitters = [emitter for emitter in scene.emitters() if hasattr(emitter, "group")]
    ids = [pointer_id(mi.EmitterPtr(emitter)) for emitter in scene.emitters()]
    first, stride = np.zeros((2, max(ids, default=0) + 1), dtype=np.uint32)
    radiance, weight, of_columns = [np.zeros(1)], [np.ones(1)], [[np.zeros(1)] for _ in columns]
    entries = 1
    for emitter in emitters:
        key, depends = pointer_id(mi.EmitterPtr(emitter)), emitter.given_emissivity is None
        source = emitter.radiance if emitter.derived is None else emitter.derived
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
        for column, found in zip(columns, of_columns):
            found.append(np.broadcast_to(column.relative.get(emitter, 0.0), count))
    relative = np.array([np.concatenate(found) for found in of_columns]).reshape(-1, entries)
    # The columns that a facet belongs to, without gaps: most facets belong to one or two
    rank = np.cumsum(relative != 0, axis=0) * (relative != 0)
    tables = []
    for k in range(1, rank.max(initial=0) + 1):
        found = rank == k
        numbers = np.where(found.any(axis=0), found.argmax(axis=0) + first_number, size)
        tables.append((mi.UInt32(numbers), mi.Float(np.sum(relative * found, axis=0))))
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
