"""Surfaces of a scene in the band in which heat is exchanged or sunlight is absorbed.

The scene keeps its band. A material that has a name is taken from its materials file in the band
that is asked for. A surface that is given by numbers, or a BSDF of Mitsuba's, stays as it is.
"""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy import sparse

from mi_lcair.coincident import unique_rows
from mi_lcair.errors import InputError
from mi_lcair.heating.conductors import RINGS_DEG
from mi_lcair.physics import materials
from mi_lcair.physics.bands import Band, band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.bsdfs.plume import is_plume
from mi_lcair.plugins.bsdfs.reflection_bsdf import is_reflection_bsdf
from mi_lcair.plugins.derivatives import children, own_memory
from mi_lcair.plugins.emission.emissivity import emissivity_of
from mi_lcair.plugins.emission.triangles import normal_of, pointer_id, sphere_of
from mi_lcair.plugins.emitters.thermal_emitter import groups_of, is_thermal
from mi_lcair.plugins.samplers.lattice import VECTOR, Lattice
from mi_lcair.rendering.facets import FacetTable, FacetTracer, Radiator
from mi_lcair.rendering.measurands import check_free
from mi_lcair.rendering.scene import Scene

TOTAL, SOLAR = "total", "0.3-2.5"  # bands of the exchanged heat and of sunlight, um
STAND_IN = "LWIR"  # band that stands in for the total band
# What the radiation of a band is, and the temperature of its spectrum [K]
RADIATION = {TOTAL: ("heat", 300.0), SOLAR: ("sunlight", 5772.0)}
UNUSED = "its emissivity is not used; the emissivity is 1 minus the reflectance of its BSDF"


@dataclass
class Surfaces:
    """The different surfaces of a scene in a band.

    of_band: TOTAL or SOLAR. different: the surfaces. of_shape: index of each shape's surface.
    remarks: what stands in for what, one line each.
    """

    of_band: str
    different: list[Radiator] = field(default_factory=list)
    of_shape: list[int] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)

    @staticmethod
    def of(scene: Scene, of_band: str, grey: Mapping[str, float] = {}) -> "Surfaces":
        """The surfaces of a scene in the band TOTAL or SOLAR.

        grey: emissivities of groups that are grey in this band, in place of their materials.

        Raises InputError for a plume that transmits, for a BSDF whose emissivity cannot be known,
        and for a material without an entry that could be used.
        """
        surfaces, index = Surfaces(of_band), {}
        for shape in scene.mi.shapes():
            bsdf = shape.bsdf()
            if is_plume(bsdf) and bsdf.transmits:
                raise InputError(
                    f"shape '{shape.id()}': the transmittance of a plume holds in the band "
                    f"{scene.band.label} and not for heat; leave the plume out or make it opaque"
                )
            emitter = shape.emitter()
            if is_thermal(emitter) and emitter.given_emissivity is not None:
                surfaces.remarks.append(f"shape '{shape.id()}': {UNUSED}")
            if is_thermal(emitter) and (group := groups_of(emitter)[0]) in grey:
                is_sheet = bsdf.class_name() == "TwoSidedBRDF"
                key, make = grey_surface(grey[group], is_sheet)
            else:
                key, make = surfaces._in_band(bsdf, scene)
            if key not in index:
                index[key] = len(surfaces.different)
                made = make()
                surfaces.different.append(Radiator(made, partial(emissivity_of(made).eval, made)))
            surfaces.of_shape.append(index[key])
        surfaces.remarks = list(dict.fromkeys(surfaces.remarks))
        return surfaces

    def _in_band(self, bsdf, scene: Scene):
        """A key that is equal for equal surfaces, and a function that makes the BSDF."""
        layers = children(bsdf) if bsdf.class_name() == "TwoSidedBRDF" else [bsdf]
        if not all(is_reflection_bsdf(layer) for layer in layers):
            return bsdf, lambda: bsdf
        described = [self._described(layer, scene.band) for layer in layers]
        if layers[0] is not bsdf:
            described = [{"type": "twosided", **dict(zip(("front", "back"), described))}]
        return repr(described), lambda: mi.load_dict(described[0], parallel=False)

    def _described(self, layer, of_scene: Band) -> dict:
        """The plugin of a layer in the band; of_scene: the scene's band."""
        if layer.emissivity != "kirchhoff":
            self.remarks.append(f"bsdf '{layer.id()}': {UNUSED}")
        if layer.named is None:
            if not of_scene.is_total and layer.model.name != "grey":
                self._stands_in(f"bsdf '{layer.id()}'", of_scene)
            source, parameters = layer, dict(zip(layer.model.names, layer.values))
        else:
            source = self._material(*layer.named)
            parameters = source.parameters
        return {"type": source.model.name, **parameters, "form": source.form, "lobe": layer.lobe}

    def _material(self, name: str, file) -> materials.NamedMaterial:
        """The entry of a material for the band, or one that stands in."""
        used, entry = band(self.of_band), None
        with suppress(InputError):
            entry = materials.material(name, used, file)
        if entry is None:
            is_total = used.is_total
            try:
                used = band(STAND_IN) if is_total else used
                entry = materials.material(name, used, file, allow_band=not is_total)
            except InputError:
                raise InputError(
                    f"material '{name}': has no entry for the band {self.of_band}"
                    f"{f' or {STAND_IN}' * is_total}, only for "
                    f'{", ".join(materials.bands_of(name, file))}; add [{name}."{self.of_band}"] '
                    "to its materials file"
                ) from None
            used = band(entry.band)
            self._stands_in(f"material '{name}'", used)
        kelvin = RADIATION[self.of_band][1]
        return entry if entry.spectrum is None else entry.averaged(used, kelvin)

    def _stands_in(self, what: str, used: Band) -> None:
        of, kelvin = RADIATION[self.of_band]
        share = in_band_radiance(used, kelvin) / in_band_radiance(band(TOTAL), kelvin)
        self.remarks.append(
            f"{what}: its numbers for the band {used.label} are used for {self.of_band}, "
            f"although that band contains only {share:.0%} of the {of} at {kelvin:g} K"
        )


def grey_surface(emissivity: float, is_sheet: bool):
    """A key and a function as `Surfaces._in_band` has them, of a grey surface."""
    plugin = {"type": "grey", "emissivity": emissivity}
    plugin = {"type": "twosided", "front": plugin} if is_sheet else plugin
    return repr(plugin), lambda: mi.load_dict(plugin, parallel=False)


def hemispherical_emissivity(surface: Radiator, nodes: int = 64) -> np.ndarray:
    """Hemispherical emissivity of each side of a surface that emits, (sides,).

    For a texture it is approximately the average.
    """
    x, w = np.polynomial.legendre.leggauss(nodes)
    sin2 = np.tile((x + 1) / 2, len(surface.sides))  # cos sin d(theta) = d(sin^2) / 2
    side = np.repeat(surface.sides, nodes)
    si = dr.zeros(mi.SurfaceInteraction3f, len(side))
    si.n, si.sh_frame = mi.Normal3f(0, 0, 1), mi.Frame3f(mi.Normal3f(0, 0, 1))
    si.wi = mi.Vector3f(mi.Float(np.sqrt(sin2)), 0, mi.Float(side * np.sqrt(1 - sin2)))
    si.uv = mi.Point2f(np.random.default_rng(0).random((2, len(side))))
    own_memory([si.wi, si.uv])
    emitted = surface.emissivity(si, mi.Bool(True))
    return np.broadcast_to(emitted.numpy(), len(side)).reshape(-1, nodes).astype(float) @ w / 2


# Parts of facets, from which points of a facet are drawn, and which shapes are closed
# ------------------------------------------------------------------------------------

ROUND = ("Sphere", "Ellipsoids")  # shapes without triangles that are closed


@dataclass
class Parts:
    """Parts of the facets on which paths begin: triangles, or whole shapes that are no meshes.

    facet: index of each part's facet; it rises. until: share of the facet's area in its parts up to
    this one. shape, primitive, is_triangle: of each part. sphere: centre of a part that is a
    sphere, and 1 or, with flipped normals, -1; 0 for other parts.
    """

    facet: mi.UInt32
    until: mi.Float
    shape: mi.UInt32
    primitive: mi.UInt32
    is_triangle: mi.Bool
    sphere: mi.Vector4f

    @staticmethod
    def of(table: FacetTable, numbers: np.ndarray, shapes: list) -> "Parts":
        """The parts of the facets with these numbers, which rise."""
        shape = table.shape_index[table.triangle_facet]
        primitive = np.arange(len(shape)) - np.searchsorted(shape, shape)
        p0, p1, p2 = np.moveaxis(table.triangles, 1, 0)
        area = np.linalg.norm(np.cross(p1 - p0, p2 - p0), axis=1)
        whole = numbers[~np.isin(numbers, table.triangle_facet)]
        facet = np.concatenate([table.triangle_facet, whole])
        area = np.concatenate([area, np.ones(len(whole))])
        primitive = np.concatenate([primitive, np.zeros(len(whole), int)])
        of_facet = np.argsort(facet, kind="stable")
        of_facet = of_facet[np.isin(facet[of_facet], numbers)]
        index = np.searchsorted(numbers, facet[of_facet])
        share = area[of_facet] / np.bincount(index, area[of_facet])[index]
        of_part = table.shape_index[facet[of_facet]]
        ids = np.array([pointer_id(mi.ShapePtr(shape)) for shape in shapes])
        arrays = [
            mi.UInt32(index.astype(np.uint32)),
            mi.Float(np.cumsum(share) - index),  # the shares of a facet add up to 1
            mi.UInt32(ids[of_part].astype(np.uint32)),
            mi.UInt32(primitive[of_facet].astype(np.uint32)),
        ]
        own_memory(arrays)
        sphere = mi.Vector4f(np.array([sphere_of(shape) for shape in shapes])[of_part].T)
        return Parts(*arrays, mi.Bool(of_facet < len(table.triangle_facet)), sphere)

    def point(self, facet: mi.UInt32, u: mi.Float, sample: mi.Point2f) -> mi.SurfaceInteraction3f:
        """Uniform points of facets; `wi` is not set."""

        def is_before(k):
            part = dr.gather(Parts, self, k)
            return (part.facet < facet) | ((part.facet == facet) & (part.until < u))

        last = dr.width(self.facet) - 1
        part = dr.gather(Parts, self, dr.binary_search(0, last, is_before))
        pi = dr.zeros(mi.PreliminaryIntersection3f, dr.width(facet))
        pi.shape = shape = dr.reinterpret_array(mi.ShapePtr, part.shape)
        pi.prim_index, pi.prim_uv = part.primitive, mi.warp.square_to_uniform_triangle(sample)
        si = shape.compute_surface_interaction(
            dr.zeros(mi.Ray3f), pi, mi.RayFlags.All, part.is_triangle
        )
        ps = shape.sample_position(0, sample, ~part.is_triangle)
        n = normal_of(ps, part.sphere)
        whole = dr.zeros(mi.SurfaceInteraction3f, dr.width(facet))
        whole.p, whole.n, whole.uv, whole.sh_frame = ps.p, n, ps.uv, mi.Frame3f(n)
        si = dr.select(part.is_triangle, si, whole)
        si.sh_frame = mi.Frame3f(si.sh_frame.n)  # Mitsuba leaves out the tangents of a triangle
        si.shape, si.prim_index, si.t = shape, part.primitive, mi.Float(0)
        return si


def closed_shapes(table: FacetTable, shapes: list, one_sided: np.ndarray) -> np.ndarray:
    """Whether each shape is part of a closed surface, (shapes,).

    A closed surface has a triangle on both sides of each edge, which run through the edge in
    opposite directions. one_sided: whether each shape is; only these are put together.
    """
    shape = table.shape_index[table.triangle_facet]
    closed = np.array([shape.class_name() in ROUND for shape in shapes])
    closed[np.unique(shape)] = True
    used = one_sided[shape]
    if used.any():
        owner = np.repeat(shape[used], 3)
        _, corner = unique_rows(table.triangles[used].reshape(-1, 3))
        start, end = corner, np.roll(corner.reshape(-1, 3), -1, axis=1).ravel()
        edges = sparse.csr_array((np.ones(len(start)), (start, end)))
        surplus = (edges - edges.T)[start, end]
        closed[owner[surplus != 0]] = False
    return closed


# Paths that begin on facets, and what they meet
# ----------------------------------------------
# A path begins at a point on a side of a facet, in a direction drawn by the cosine. It is followed
# as from an observer, against the direction of the light: of what surface j emits, a side of facet
# i absorbs the part of the area
#
#     G_ij = A_i <eps_i(theta) W eps_j(theta')>,
#
# where W is the product of the weights of the reflections between. The mean is over the paths of
# the side, and A_i is its area.

# Part of a path's first weight below which half of the paths end, and the others count twice
FAINT = 1e-4
# Bound of the reflections in a closed cavity that absorbs hardly anything
MOST_REFLECTIONS = 10_000
RANDOMISATIONS = 8
# Paths of the first launch, most paths of a launch, and most hits that it keeps
PILOT, LANES, SLOTS = 2**16, 2**22, 2**23
# Memory for each number that is kept [bytes]: 123 on a bowl of 99,500 facets
BYTES = 150
RINGS = len(RINGS_DEG) - 1
# Ends of paths, the columns after those of the facets: the rings of the sky, then these. What meets
# the back of a closed surface began inside a body and is buried. Other backs, and surfaces that do
# not emit, take no part in the exchange: what meets them is lost.
ENDS = ("ground", "truncated", "buried", "lost")


def points_of(rays: int) -> int:
    """Number of points of each randomisation for at least so many paths."""
    return -(-rays // RANDOMISATIONS)


@dataclass(frozen=True, eq=False)
class Means:
    """Means of what the paths of some rows met of n facets, for each randomisation.

    between: sparse, (rows, n), what the paths of each row met of the facets. ends:
    (RANDOMISATIONS, rows, rings and ENDS). lost: (shapes,), sums over the rows of what was lost on
    each shape.
    """

    between: list[sparse.csr_array]
    ends: np.ndarray
    lost: np.ndarray

    def end(self, name: str) -> np.ndarray:
        """The means that ended in one of ENDS, (rows,)."""
        return self.ends[:, :, RINGS + ENDS.index(name)].mean(axis=0)

    def sums(self, weights: sparse.csr_array) -> "Means":
        """Sums over the rows with weights, (other rows, rows)."""
        ends = np.array([weights @ ends for ends in self.ends])
        return Means([weights @ between for between in self.between], ends, self.lost)


class FacetPaths:
    """Traces paths from the facets of a scene that emit. Each of their sides is a row of paths.

    Attributes
    ----------
    table : FacetTable
    number : (n,)
        Numbers of the facets that emit, in the table.
    rows : (rows,)
        Index of the facet of each row.
    areas : sparse, (n, rows)
        Area of the side of each row [m^2], in the row of its facet.
    reflected : bool
        Whether paths are of the light that a side has reflected, or else of what it absorbs.
    """

    def __init__(self, scene: Scene, surfaces: Surfaces, reflected: bool = False):
        self.table = table = FacetTable(scene)
        self.surfaces, self.reflected, self.shapes = surfaces, reflected, list(scene.mi.shapes())
        self.tracer = FacetTracer(scene, table, surfaces.different, surfaces.of_shape)
        self.number = emitting_facets(table, self.shapes, scene.name)
        n, index = len(self.number), np.arange(len(self.number))
        self.parts = Parts.of(table, self.number, self.shapes)
        of_shape = np.array(surfaces.of_shape)
        self.surface_of_facet = of_shape[table.shape_index[self.number]]
        self.rows = np.repeat(index, self.of_facets(lambda surface: len(surface.sides)))
        places = (self.rows, np.arange(len(self.rows)))
        area = table.area[self.number][self.rows]
        self.areas = sparse.csr_array((area, places), shape=(n, len(self.rows)))
        self.row_facet = mi.UInt32(self.rows.astype(np.uint32))
        self.row_side = mi.Float(self.of_rows(lambda surface: surface.sides))
        column = self.end("lost") + table.shape_index
        column[table.type == "sky"] = n
        column[self.number] = index
        self.column = mi.UInt32(column.astype(np.uint32))
        count = np.array([len(surface.sides) for surface in surfaces.different])[of_shape]
        is_closed = closed_shapes(table, self.shapes, count == 1)
        lost = self.end("lost") + np.arange(len(self.shapes))
        backs = np.where(is_closed, self.end("buried"), lost)[table.shape_index]
        self.back_of, self.vector = mi.UInt32(backs.astype(np.uint32)), mi.UInt32(VECTOR)
        dr.eval(self.column, self.back_of, self.row_facet, self.row_side)

    def end(self, name: str) -> int:
        """The column of one of ENDS. What is lost has one for each shape, from there on."""
        return len(self.number) + RINGS + ENDS.index(name)

    def of_facets(self, function) -> np.ndarray:
        """Values of a function of a surface, of the surface of each facet, (n,)."""
        values = [function(surface) for surface in self.surfaces.different]
        return np.array(values)[self.surface_of_facet]

    def of_rows(self, function) -> np.ndarray:
        """Values of a function that returns one for each side of a surface, (rows,)."""
        values = [function(surface) for surface in self.surfaces.different]
        return np.concatenate([values[k] for k in self.surface_of_facet])

    def sees_sky(self, si, to, active) -> mi.Bool:
        """Whether nothing but the sky is in the directions `to` from the active points."""
        met, facet = self.tracer.meet(self.tracer.leave(si, to), active)
        column = dr.gather(mi.UInt32, self.column, facet, met.is_valid())
        return active & (~met.is_valid() | (column == len(self.number)))

    def starts(self, place: mi.UInt32, point: mi.UInt32, seed) -> tuple:
        """Even points on the facets of rows, the sides of the rows, and the paths' samplers.

        place: number of the path's row plus the number of rows times that of its randomisation.
        point: number of the path among those of the place.
        """
        rows = dr.opaque(mi.UInt32, len(self.rows))
        row, seed = place % rows, dr.opaque(mi.UInt32, seed)
        sampler = Lattice.at(row * RANDOMISATIONS + place // rows, point, seed, self.vector)
        sample = sampler.next_2d()
        facet = dr.gather(mi.UInt32, self.row_facet, row)
        si = self.parts.point(facet, sampler.next_1d(), sample)
        return si, dr.gather(mi.Float, self.row_side, row), sampler

    def means(self, points: int, seed: int) -> Means:
        """What the paths of the rows meet.

        Parameters
        ----------
        points : int
            Paths of each row in each of the RANDOMISATIONS.
        seed : int

        Returns
        -------
        Means

        Raises
        ------
        InputError
            If the numbers that the first launches keep say that memory does not suffice for all.
        """
        n, rows, k = len(self.number), len(self.rows), self.end("lost")
        columns, paths = k + len(self.shapes), rows * points
        runs = [sparse.csr_array((rows, columns))] * RANDOMISATIONS
        begin, whole, lanes = 0, paths * RANDOMISATIONS, PILOT
        while begin < whole:
            end = min(begin + lanes, whole)
            count, *hits = self._launch(begin, end - begin, points, seed)
            count = int(count[0])
            lanes = min(LANES, (end - begin) * SLOTS // max(2 * count, 1))  # half of the slots
            if count > SLOTS:
                continue
            place, column, value = (array.numpy()[:count] for array in hits)
            shape = rows * RANDOMISATIONS, columns
            met = sparse.csr_array((value.astype(float), (place, column)), shape=shape) / points
            for run in range(begin // paths, (end - 1) // paths + 1):
                runs[run] = runs[run] + met[run * rows : (run + 1) * rows]
            begin = end
            check_free(
                BYTES * sum(run.nnz for run in runs) * whole / end,
                f"exchange of {n} facets with {points * RANDOMISATIONS} paths each",
                "trace fewer rays, or give the model larger facets",
            )
        ends = [np.column_stack([run[:, n:k].toarray(), run[:, k:].sum(axis=1)]) for run in runs]
        lost = sum(run[:, k:].sum(axis=0) for run in runs)
        return Means([run[:, :n] for run in runs], np.array(ends), lost)

    def _launch(self, begin: int, count: int, points: int, seed: int) -> tuple:
        """Trace some of the paths, counted through the `points` of the places of `starts`.

        Returns the number of hits, and of each its place, column, and value.
        """
        first, offset = (dr.opaque(mi.UInt32, k) for k in divmod(begin, points))
        lane, points = offset + dr.arange(mi.UInt32, count), dr.opaque(mi.UInt32, points)
        place = first + lane // points
        si, side, sampler = self.starts(place, lane % points, seed)
        si.wi = mi.warp.square_to_cosine_hemisphere(sampler.next_2d())
        si.wi.z = dr.mulsign(si.wi.z, side)
        _, absorbed, _, _ = self.tracer.respond(si, mi.Bool(True))
        # By reciprocity the absorbed share of sky light equals the emitted share. Light that a side
        # has reflected begins with the weight 1.
        weight = mi.Float(1) if self.reflected else absorbed
        of_escape = absorbed if self.reflected else mi.Float(1)
        ray = self.tracer.leave(si, si.to_world(si.wi))
        slots = dr.empty(mi.UInt32, SLOTS), dr.empty(mi.UInt32, SLOTS), dr.empty(mi.Float, SLOTS)
        hits = dr.zeros(mi.UInt32, 1), *slots
        self._follow(ray, weight, of_escape, sampler, place, hits)
        dr.eval(hits)
        return hits

    @dr.syntax
    def _follow(self, ray, weight, of_escape, sampler, place, hits):
        """Follow paths and keep what they meet.

        of_escape: factor of what escapes. place: of the paths' row and randomisation. hits: see
        `_launch`.
        """
        n, tracer = len(self.number), self.tracer
        weight, faint, active = mi.Float(weight), FAINT * weight, weight > 0
        reflections = mi.UInt32(0)
        while dr.hint(active, label="exchange"):
            si, facet = tracer.meet(ray, active)
            ends = reflections == MOST_REFLECTIONS
            meets = active & ~ends & si.is_valid()
            column = dr.gather(mi.UInt32, self.column, facet, meets)
            # The sky is what escapes, or a shape of that type
            escapes = active & ~ends & (~meets | (column == n))
            meets &= ~escapes
            u, v = sampler.next_1d(), sampler.next_2d()
            has_side, emissivity, to, factor = tracer.respond(si, meets, u, v)
            is_back = meets & ~has_side
            back = dr.gather(mi.UInt32, self.back_of, facet, meets)
            column = dr.select(is_back, back, column)
            column = dr.select(escapes, n + self.ring(ray.d), column)
            column = dr.select(ends, self.end("truncated"), column)
            part = weight * dr.select(meets & ~is_back, emissivity, 1)
            part *= dr.select(escapes, of_escape, 1)
            keep(hits, (place, column, part), active & (part > 0))

            weight *= factor
            # Russian roulette keeps the means
            weight *= dr.select(weight < faint, dr.select(sampler.next_1d() < 0.5, 2, 0), 1)
            reflections += 1
            active = meets & ~is_back & (weight > 0)
            ray = tracer.leave(si, si.to_world(to))

    def ring(self, d) -> mi.UInt32:
        """The ring of the sky in a direction, counted from the horizon; RINGS below it."""
        step = np.radians(RINGS_DEG[1])
        k = dr.minimum(mi.UInt32(dr.asin(dr.clip(d.z, 0, 1)) / step), RINGS - 1)
        return dr.select(d.z < 0, RINGS, k)


def keep(hits, values, active) -> None:
    """Append values to the slots of hits, as long as there are any."""
    count, *slots = hits
    slot = dr.scatter_inc(count, mi.UInt32(0), active)
    for kept, value in zip(slots, values):
        dr.scatter(kept, value, slot, active & (slot < SLOTS))


def emitting_facets(table: FacetTable, shapes: list, name: str) -> np.ndarray:
    """Numbers of the facets that emit and are no sky, (n,).

    name: of the scene. Raises InputError if there is none, or one without an area.
    """
    emits = np.array([is_thermal(shape.emitter()) for shape in shapes])
    exists = table.shape_index >= 0
    number = np.flatnonzero(exists & (table.type != "sky") & emits[table.shape_index])
    if not len(number):
        raise InputError(f"{name}: no surface emits, so that no heat is exchanged")
    for facet in number[~(table.area[number] > 0)]:
        shape = shapes[table.shape_index[facet]]
        raise InputError(f"{name}: facet {facet} of shape '{shape.id()}' has no area; remove it")
    return number


# Sunlight that facets absorb: directly, and after reflections
# ------------------------------------------------------------
# The sun's light falls on a side of a facet through shadow rays. What the facet does not absorb it
# reflects, and paths in the solar band say who absorbs that light. They begin with the cosine, as
# if the first reflection were diffuse; the later reflections are those of the surfaces.


@dataclass(frozen=True, eq=False)
class SolarAreas:
    """Areas by which m beams of sunlight and an even sky heat n facets [m^2].

    The absorbed power is the area times the irradiance of the beam on a surface across it. The
    areas have the R randomisations as their first axis.

    lit: (R, m, n), area across the beam that it lights. direct: of it, what is absorbed. reflected:
    area by which light that other facets, or the facet itself, have reflected is absorbed. sky,
    ground: (R, n), absorbed power by the irradiance of an even sky on a horizontal plane, and by
    that which the ground reflects. absorptance: (n,), hemispherical, of the lit sides. onward:
    (n, n), of the light that a facet (row) reflects, the share that each absorbs. remarks: on the
    materials.
    """

    lit: np.ndarray
    direct: np.ndarray
    reflected: np.ndarray
    sky: np.ndarray
    ground: np.ndarray
    absorptance: np.ndarray
    onward: sparse.csr_array
    remarks: tuple[str, ...] = ()


def solar_areas(
    scene: Scene,
    toward_sun: np.ndarray,
    rays: int,
    shadow_rays: int,
    seed: int = 0,
    absorptances: Mapping[str, float] = {},
) -> SolarAreas:
    """The absorption of sunlight by the facets of a scene, in the solar band.

    Parameters
    ----------
    scene : Scene
    toward_sun : ndarray, shape (m, 3)
        Unit vectors toward the sun.
    rays, shadow_rays : int
        Paths of each side of a facet, and rays from it toward each position of the sun.
    seed : int
    absorptances : mapping of str to float
        Those of groups, in place of their materials.
    """
    surfaces = Surfaces.of(scene, SOLAR, absorptances)
    paths = FacetPaths(scene, surfaces, reflected=True)
    means = paths.means(points_of(rays), seed)
    areas, area, n = means.sums(paths.areas), paths.areas.sum(axis=0), len(paths.number)
    points = points_of(shadow_rays)
    lane = dr.arange(mi.UInt32, len(paths.rows) * RANDOMISATIONS * points)
    where, side, _ = paths.starts(lane // points, lane % points, seed)
    dr.eval(where, side)
    step = max(1, LANES // dr.width(side))
    blocks = [
        lit_shares(paths, toward_sun[k : k + step], where, side, points)
        for k in range(0, len(toward_sun), step)
    ]
    lit, absorbed = np.concatenate(blocks, axis=2) * area
    # A sheet reflects from the side that is lit
    light = np.maximum(lit.sum(axis=(0, 1)), 1e-9 * area)
    share = light / np.bincount(paths.rows, light)[paths.rows]
    sides = sparse.csr_array((np.ones(len(area)), paths.areas.indices, paths.areas.indptr))

    def of_facets(values):
        return np.reshape((sides @ values.reshape(-1, len(area)).T).T, (*values.shape[:2], n))

    return SolarAreas(
        lit=of_facets(lit),
        direct=of_facets(absorbed),
        reflected=np.array([left @ g for left, g in zip(lit - absorbed, means.between)]),
        sky=areas.ends[:, :, :RINGS].sum(axis=2),
        ground=areas.ends[:, :, RINGS],
        absorptance=sides @ (share * paths.of_rows(hemispherical_emissivity)),
        onward=(sides * share) @ (sum(means.between) / RANDOMISATIONS),
        remarks=tuple(surfaces.remarks),
    )


def lit_shares(paths: FacetPaths, toward_sun: np.ndarray, where, side, points: int) -> np.ndarray:
    """Shares of the rows' areas across m beams, (2, RANDOMISATIONS, m, rows).

    First what is lit, then what is absorbed of it. where, side: from `FacetPaths.starts`.
    """
    m, count = len(toward_sun), dr.width(side)
    lane = dr.arange(mi.UInt32, m * count)
    si = dr.gather(mi.SurfaceInteraction3f, where, lane % count)
    to = dr.gather(mi.Vector3f, mi.Float(np.ravel(toward_sun)), lane // count)
    si.wi = si.to_local(to)
    lit = paths.sees_sky(si, to, si.wi.z * dr.gather(mi.Float, side, lane % count) > 0)
    cos = dr.select(lit, dr.abs(si.wi.z), 0)
    values = [cos, cos * paths.tracer.respond(si, lit)[1]]
    dr.eval(values)  # in one kernel; a sum alone would trace the rays again
    sums = [dr.block_sum(value, points).numpy() / points for value in values]
    shares = np.reshape(sums, (2, m, RANDOMISATIONS, len(paths.rows)))
    return np.moveaxis(shares.astype(float), 2, 1)
