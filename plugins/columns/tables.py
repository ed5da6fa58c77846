"""Tables of the parameters in which the radiance of paths is differentiated."""

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins.bsdfs.reflection_bsdf import is_reflection_bsdf
from mi_lcair.plugins.columns.kinds import MaterialColumn
from mi_lcair.plugins.columns.surface_slopes import Slopes, Vertex, kind_of, names_of, places_of
from mi_lcair.plugins.derivatives import nodes, own_memory
from mi_lcair.plugins.emission.triangles import pointer_id
from mi_lcair.plugins.emitters.thermal_emitter import is_thermal
from mi_lcair.plugins.paths.launch import Launch

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
