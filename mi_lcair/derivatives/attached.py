"""Derivatives of an intensity with respect to all vertices, from paths attached to the surfaces.

A path keeps its triangles and its places on them when the vertices move. Its directions, distances
and angles then change smoothly, and their derivatives are found by reverse mode. What it misses is
that nearer surfaces hide more or less of farther ones: integrals over the silhouettes, as the
sensor and as points of reflecting surfaces see them.
"""

from copy import copy
from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.coincident import SINGLE
from mi_lcair.derivatives.edges import FLAT, GRAZING, Contacts, ModelEdges
from mi_lcair.plugins.bsdfs.reflection_bsdf import is_reflection_bsdf
from mi_lcair.plugins.derivatives import flatten, own_memory
from mi_lcair.plugins.emission.draw_table import PREFERENCE, DrawTable, is_mesh
from mi_lcair.plugins.emission.sources import at_pointer
from mi_lcair.plugins.emission.spherical_polygons import LARGE
from mi_lcair.plugins.emission.triangles import (
    Choice,
    is_faceted,
    numbers_of_triangles,
    pointer_id,
    table_size,
    vertex_positions,
)
from mi_lcair.plugins.emitters.thermal_emitter import facet_type_of
from mi_lcair.plugins.paths.launch import FacetStarts, Launch, ParallelRays
from mi_lcair.plugins.paths.sheets import nearest_hit
from mi_lcair.plugins.paths.walk import mis_weight
from mi_lcair.plugins.recorders.recorder import Recorders
from mi_lcair.rendering.facets import meshes_of_model
from mi_lcair.rendering.statistics import check_valid, edge_share
from mi_lcair.rendering.window import RANDOMISATIONS, window, window_size

TURN = 1e-3  # change of a direction from which the slope of a reflection or an emission is taken
NARROW = 30.0  # largest density of a lobe's directions from which on it is narrow [1/sr]
MIRRORS = 3  # mirrors that a ray in a mirror direction follows
BESIDE = 2e-5  # distance of a ray from a silhouette, in parts of the model's extent
MOST_PATHS = 2**19  # paths of one pass, times their reflections, whose derivatives are kept
ONWARD = 0.25  # share of the paths from the film that go on from a drawn point
EDGES = 0x27D4EB2F  # changes the seed of paths that begin beside silhouettes


def can_attach(scene, tracer) -> bool:
    """Whether paths can be attached: there are only meshes with flat triangles, and the sky.

    The meshes reflect by smooth lobes.
    """
    emitters, walk, shapes = tracer.emitters, tracer.paths, list(scene.mi.shapes())
    plain = not emitters.passes and emitters.sun is None
    plain &= walk.by_bin is None and walk.ambient_radiance is None
    unfit = [mi.has_flag(shape.bsdf().flags(), mi.BSDFFlags.Delta) for shape in shapes]
    unfit += [shape.is_mesh() and shape.has_vertex_normals() for shape in shapes]
    unfit += [not is_faceted(shape) for shape in shapes]
    return bool(plain and not any(unfit) and meshes_of_model(scene) is not None)


def is_narrow(bsdf) -> bool:
    """Whether a BSDF is one of a reflection model that reflects into a narrow lobe."""
    along = mi.Vector3f(0, 0, 1)
    return is_reflection_bsdf(bsdf) and bsdf.density(along, along)[0] > NARROW


@dataclass(frozen=True)
class PathSums:
    """What attached paths bring.

    gradient: derivatives of the mean radiance of the window by all coordinates of vertices, without
    the growth of the triangles, of independent blocks, (R, V, 3). silhouettes: the part of those
    that the sensor sees. hiding: number of paths beside these that meet something behind them.
    sums, counts: radiance of the paths by the triangle on which they begin, and their number, (R,
    T).
    """

    gradient: np.ndarray
    silhouettes: np.ndarray
    hiding: int
    sums: np.ndarray
    counts: np.ndarray

    def along(self, velocities: np.ndarray) -> np.ndarray:
        """Derivatives by the vertices with these velocities (V, 3), of each block, (R, V)."""
        return np.einsum("bvk,vk->bv", self.gradient, velocities)

    def of_one_path(self, velocities: np.ndarray) -> float:
        """Standard error from where the visible part of a silhouette ends, see `edge_share`.

        All blocks may have the same number of points there.
        """
        moved = np.abs(np.einsum("bvk,vk->bv", self.silhouettes, velocities)).sum()
        return edge_share(RANDOMISATIONS) * float(moved) / max(self.hiding, 1)


def mean_radiances(sums: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean radiance of each triangle over all paths (T,), and of each block, (R, T).

    sums: of the radiance by block and triangle (R, T). counts: numbers of paths.
    """
    pooled = sums.sum(axis=0) / np.maximum(counts.sum(axis=0), 1)
    return pooled, np.where(counts > 0, sums / np.maximum(counts, 1), pooled)


@dataclass
class EdgePoint:
    """A point of an edge: the edge and its ends, position along it, and density [1/m].

    side: 1 or -1, the side of a curve that is looked at.
    """

    edge: mi.UInt32
    a: mi.UInt32
    b: mi.UInt32
    t: mi.Float
    density: mi.Float
    side: mi.Float


class AttachedPaths:
    """Paths that are attached to the triangles of a `MovedMesh`, and their derivatives.

    surface: the MovedMesh. starts: the `Choice` of the triangles on which paths begin; None for
    paths that begin on the film. kinds: see `ModelEdges`. Call its methods while the scene is
    prepared. tracer: the scene's `PathTracer`.
    """

    def __init__(self, surface, sensor, tracer, starts: Choice | None, kinds=None):
        self.surface, self.sensor, self.tracer, self.starts = surface, sensor, tracer, starts
        self.scene, self.walk, self.emitters = tracer.scene, tracer.paths, tracer.emitters
        narrow = filter(is_narrow, {mesh.bsdf() for mesh in surface.meshes})
        ids = [pointer_id(mi.BSDFPtr(bsdf)) for bsdf in narrow]
        # 1 for narrow lobes, by the pointer
        numbers = np.isin(np.arange(table_size(ids)), ids).astype(np.uint32)
        self.narrow = mi.UInt32(numbers) if ids else None
        self.rays, self.number = ParallelRays.of(sensor), numbers_of_triangles(surface.meshes)
        vertices = surface.vertices
        self.corners = mi.UInt32(np.ravel(surface.as_traced).astype(np.uint32))
        of_model, self.extent = vertices[: surface.of_model], surface.extent
        self.edges = ModelEdges(surface, kinds)
        self.contacts = Contacts(surface, self.edges, starts is not None)
        none = np.zeros((0, 2, 5), int), np.zeros((0, 2), int)
        pierced, self.crossing = self.contacts.curves or none
        self.lines = self.edges.ends, vertices
        if len(pierced):
            p, q, a, b, c = np.moveaxis(vertices[pierced.reshape(-1, 5)], 1, 0)
            normal = np.cross(b - a, c - a)
            along = np.sum(normal * (a - p), axis=1) / np.sum(normal * (q - p), axis=1)
            numbers = len(vertices) + np.arange(len(p)).reshape(-1, 2)
            points = np.concatenate([vertices, p + along[:, None] * (q - p)])
            self.lines = np.concatenate([self.edges.ends, numbers]), points
        a, b = self.lines[1][self.lines[0]].swapaxes(0, 1)
        self.length = np.linalg.norm(b - a, axis=1)
        self.pierced, self.ends, self.opposite, self.sides = (
            mi.UInt32(np.ravel(of).astype(np.int64) % 2**32)
            for of in (pierced, self.lines[0], self.edges.opposite, self.crossing + 1)
        )
        # Far ones are seen at smaller angles
        away = np.linalg.norm((a + b) / 2 - of_model.mean(axis=0), axis=1) / self.extent
        seen = self.length / np.maximum(away, 1)
        self.by_length = self.choice(seen) if len(seen) else None
        self.prepare_drawing()
        if starts is not None:
            area, _ = surface.in_view(sensor, vertices)
            self.aim = FacetStarts.at(surface.meshes, vertices[surface.triangles], area, starts)
            self.aim.tables.extent = dr.opaque(mi.Float, self.extent)
            self.silhouettes = self.seen_by_sensor()

    def prepare_drawing(self) -> None:
        """Prepare what draws panels of emitting meshes; the radiance of the sky stays as it is."""
        self.drawing, known = copy(self.emitters), (self.emitters.bounds, self.emitters.brightest)
        surface = self.surface
        of_model = surface.vertices[: surface.of_model]
        low, high = of_model.min(axis=0), of_model.max(axis=0)
        meshes = []
        for of in filter(is_mesh, self.emitters.emitters):
            place = vertex_positions(of.get_shape())
            around = (place.min(axis=0) < high) & (place.max(axis=0) > low)
            if facet_type_of(of) == "model" or not around.all():
                meshes.append(of)
        table = DrawTable(meshes, *known, PREFERENCE)
        own_memory(flatten(table))  # so that one kernel serves every copy
        self.drawing.tables = [table] if table.panel_count else []
        # Few reflected ones graze triangles, and the derivatives there are large
        goes_on = self.starts is None and self.drawing.tables and self.narrow is None
        self.onward = ONWARD if goes_on else 0.0
        if table.panel_count:
            panels, faces = table.panel_choice.panels, [m.face_count() for m in surface.meshes]
            of_mesh = dict(zip(surface.meshes, np.cumsum([0, *faces])))
            before = np.cumsum([0, *panels.table.counts])
            shift = [of_mesh[of.get_shape()] - first for of, first in zip(meshes, before)]
            of_panels = panels.first + np.repeat(shift, panels.counts)
            self.of_panels = mi.UInt32(of_panels.astype(np.uint32))

    def choice(self, lengths: np.ndarray) -> tuple:
        """What draws an edge by a length of each, (E,), and the density along each edge [1/m]."""
        choice = Choice(lengths)
        density = choice.probability / np.maximum(self.length, 1e-300)
        density[len(self.edges.ends) :] /= 2  # one side of a curve
        return choice, mi.Float(density)

    def seen_by_sensor(self) -> tuple | None:
        """What draws an edge that the sensor may see as a silhouette, by its projected length."""
        direction = window(self.sensor)[-1]
        (ends, vertices), opposite = self.lines, self.edges.opposite
        opposite = np.pad(opposite, [(0, len(self.crossing)), (0, 0)], constant_values=-1)
        a, b = vertices[ends].swapaxes(0, 1)
        normal = np.cross(direction, b - a)
        length = np.linalg.norm(normal, axis=1)
        side = np.einsum("ek,ejk->ej", normal, vertices[opposite] - a[:, None])
        flat = FLAT * self.extent * length[:, None]
        some = opposite >= 0
        one_side = ~((some & (side > flat)).any(axis=1) & (some & (side < -flat)).any(axis=1))
        if not (length * one_side).any():
            return None
        return self.choice(length * one_side)

    # -------------------------------------------------------------------- Attached geometry

    def vertex(self, number) -> mi.Point3f:
        """A vertex in the copy of the block of each path."""
        first = 3 * (number + self.block * mi.UInt32(len(self.surface.vertices)))
        return mi.Point3f(*(dr.gather(mi.Float, self.positions, first + k) for k in range(3)))

    def end(self, number) -> mi.Point3f:
        """An end of an edge, or of a curve: a point where an edge meets a triangle."""
        count = len(self.surface.vertices)
        if not len(self.crossing):
            return self.vertex(number)
        of_curve = number >= count
        first = 5 * dr.select(of_curve, number - count, 0)
        p, q, a, b, c = (
            self.vertex(dr.gather(mi.UInt32, self.pierced, first + k)) for k in range(5)
        )
        normal = dr.cross(b - a, c - a)
        point = p + dr.dot(normal, a - p) / dr.dot(normal, q - p) * (q - p)
        return dr.select(of_curve, point, self.vertex(dr.select(of_curve, 0, number)))

    def triangle(self, number) -> tuple:
        """The vertices of a triangle."""
        corners = (dr.gather(mi.UInt32, self.corners, 3 * number + k) for k in range(3))
        return tuple(map(self.vertex, corners))

    def attach(self, si, pi, active) -> "AttachedPlace":
        """Where rays have hit triangles: point and frame with derivatives; others stay."""
        triangle = self.number.at(pi.shape, pi.prim_index, active & pi.is_valid())
        known = triangle > 0
        a, b, c = self.triangle(dr.maximum(triangle, 1) - 1)
        u, v = pi.prim_uv
        p = a + u * (b - a) + v * (c - a)
        n = dr.cross(b - a, c - a)
        twice_area = dr.select(known, dr.norm(n), 1)
        n = dr.normalize(n) * dr.sign(dr.dot(dr.detach(n), si.sh_frame.n))
        p, n = dr.select(known, p, si.p), dr.select(known, n, si.sh_frame.n)
        s = dr.normalize(si.sh_frame.s - n * dr.dot(n, si.sh_frame.s))
        return AttachedPlace(
            si, p, mi.Vector3f(s), mi.Vector3f(dr.cross(n, s)), mi.Vector3f(n), twice_area, triangle
        )

    def edge_point(self, choice: tuple, sample) -> EdgePoint:
        draws, density = choice
        edge, rest = draws.pick_and_rest(sample)
        a, b = (dr.gather(mi.UInt32, self.ends, 2 * edge + k) for k in range(2))
        # Both sides of a curve have evenly spaced points
        twice, of_curve = 2 * rest.x, edge >= len(self.edges.ends)
        side = dr.select(twice < 1, mi.Float(1), -1)
        t = dr.select(of_curve, dr.select(twice < 1, twice, twice - 1), rest.x)
        return EdgePoint(edge, a, b, t, dr.gather(mi.Float, density, edge), side)

    def outward(self, point: EdgePoint, normal) -> mi.Vector3f:
        """The unit normal of a plane through the edge, toward where none of its triangles is.

        It is 0 where the edge is no silhouette, and half as long where a triangle lies in the
        plane: the edge is one if that triangle turns to one side. normal: a normal of the plane.
        """
        a, columns = self.end(point.a), self.edges.opposite.shape[1]
        of_curve = point.edge >= len(self.edges.ends)
        above, below, within = mi.Bool(False), mi.Bool(False), mi.Bool(False)
        flat, normal = FLAT * self.extent, dr.normalize(normal)
        for k in range(columns):
            third = dr.gather(mi.UInt32, self.opposite, columns * point.edge + k, ~of_curve)
            exists = ~of_curve & (third != 0xFFFFFFFF)
            side = dr.dot(normal, self.vertex(dr.select(exists, third, 0)) - a)
            above, below = above | (exists & (side > flat)), below | (exists & (side < -flat))
            within |= exists & (dr.abs(side) <= flat)
        size = dr.select(above == below, 0.0, dr.select(within, 0.5, 1.0))
        size = dr.select(of_curve, point.side, dr.select(above, -size, size))
        return dr.detach(normal * size)

    def aside(self, z) -> mi.Float:
        """Distance from an edge at a point in which a ray passes it [m]."""
        return BESIDE * self.extent + SINGLE * dr.max(dr.abs(z))

    def is_beside(self, edge, pi, active) -> mi.Bool:
        """Whether rays have hit one of the two triangles that pass through each other there."""
        if not len(self.crossing):
            return mi.Bool(False)
        first, count = 2 * (edge - len(self.edges.ends)), len(self.edges.ends)
        active = active & (edge >= count)
        met = self.number.at(pi.shape, pi.prim_index, active & pi.is_valid())
        sides = (dr.gather(mi.UInt32, self.sides, first + k, active) for k in range(2))
        return active & pi.is_valid() & (sum(mi.UInt32(met == side) for side in sides) > 0)

    # ------------------------------------------------------------------------ Paths

    def run(self, seed: int, points: int, progress=None) -> "PathSums":
        """Independent estimates from paths on the model, and as many beside its silhouettes.

        points: paths of each block.
        """
        vertices = np.ravel(self.surface.vertices).astype(np.float32)
        step = max(1, MOST_PATHS // RANDOMISATIONS // max(self.walk.max_bounces, 1))
        count, invalid, hiding = len(self.surface.triangles), 0, 0
        gradients = np.zeros((2, RANDOMISATIONS * len(vertices)))
        sums, counts = np.zeros((2, RANDOMISATIONS * count))
        for first in range(0, points, step):
            here = min(step, points - first)
            launch = Launch(1, 1, seed, RANDOMISATIONS, here, first, aim=self.aim)
            block = np.repeat(np.arange(RANDOMISATIONS), here)
            self.block = mi.UInt32(block.astype(np.uint32))
            self.positions = mi.Float(np.tile(vertices, RANDOMISATIONS))
            dr.enable_grad(self.positions)
            L, weight, start = self.paths(launch)
            valid = dr.isfinite(L)
            totals = [dr.sum(dr.select(valid, dr.detach(weight) * L, 0))]
            if self.silhouettes is not None:
                beside = self.beside_silhouettes(replace(launch, seed=seed ^ EDGES, aim=None))
                hiding += int(dr.count(self.hides)[0])
                totals.append(dr.sum(beside))
            for gradient, total in zip(gradients, totals):
                if dr.grad_enabled(total):
                    dr.backward(total)
                    gradient += dr.grad(self.positions).numpy()
                    dr.clear_grad(self.positions)
            radiance = dr.select(valid & (weight > 0), self.radiance, 0).numpy()
            begins = block * count + start.numpy()
            invalid += int(np.sum(~valid.numpy()))
            sums += np.bincount(begins, np.broadcast_to(radiance, block.shape), len(sums))
            counts += np.bincount(begins, minlength=len(counts))
            if progress is not None:
                progress(first + here, points)
        check_valid(invalid, RANDOMISATIONS * points, self.surface.scene.name)
        interior, silhouettes = gradients.reshape(2, RANDOMISATIONS, -1, 3) / points
        shape = RANDOMISATIONS, -1
        return PathSums(
            interior + silhouettes, silhouettes, hiding, sums.reshape(shape), counts.reshape(shape)
        )

    def paths(self, launch: Launch) -> tuple:
        """Radiance of paths on the model with its derivatives, their weights and triangles."""
        paths = launch.paths_from(self.sensor.sampler())
        sampler, column, row, _, weight, facet = paths.begin()
        start = self.number.at(facet.shape, facet.primitive) - 1
        position = self.rays.position(facet.p, column)
        weight = dr.select(dr.all((position >= 0) & (position < 1)), weight, 0)
        ray = self.rays.at(column, row, position, paths.columns, paths.rows)
        pi, active = facet.first_hit(self.scene, self.emitters.sheets, ray)
        weight = dr.select(active, weight, 0)
        si = pi.compute_surface_interaction(ray, mi.RayFlags.All, active)
        return self.follow(sampler, ray, si, self.attach(si, pi, active), active), weight, start

    def follow(self, sampler, ray, si, place, active) -> mi.Float:
        """Radiance of paths from the first place that they meet, with its derivatives."""
        most, throughput, toward = self.walk.max_bounces, mi.Float(1), mi.Vector3f(-ray.d)
        L = place.emission(self.scene, toward, active)
        at_edge, number = None, sampler.next_1d()
        for bounce in range(most):
            active &= si.is_valid()
            bsdf = si.bsdf(ray)
            bs, _ = bsdf.sample(mi.BSDFContext(), si, sampler.next_1d(), sampler.next_2d(), active)
            mirrored = self.mirrored(si, bsdf, most - bounce, active)
            choice, point, onward = sampler.next_2d(), sampler.next_2d(), sampler.next_1d()
            drawn, of_drawn, other = self.drawn(place, toward, bsdf, choice, point, active)
            L += throughput * drawn
            # One reflection of each path looks for silhouettes, an early one more often
            share = 0.5 ** min(bounce + 1, most - 1)
            here = (number >= share) & (number < 2 * share) if bounce + 1 < most else number < share
            value, rest = dr.detach(throughput) / share, mi.UInt32(most - 1 - bounce)
            visit = Visit(place, toward, bsdf, value, mirrored, rest, active)
            at_edge = visit if at_edge is None else dr.select(here, visit, at_edge)
            reflects, active = active, active & (bs.pdf > 0)
            ray = self.emitters.spawn_ray(si, si.to_world(bs.wo))
            pi = nearest_hit(self.scene, self.emitters.sheets, ray, active=active)
            si = pi.compute_surface_interaction(ray, mi.RayFlags.All, active)
            there = self.attach(si, pi, active)
            hits = active & si.is_valid()
            to = dr.select(hits, dr.normalize(there.p - place.p), ray.d)
            density = self.density_of(there, place)
            f = place.reflection(bsdf, toward, to, active)
            f *= dr.select(hits, there.growth(place), 1)
            share = dr.select(hits, mis_weight(bs.pdf, density), 1) / bs.pdf
            emitted = f * share * there.emission(self.scene, -to, active)
            L += dr.select(active, throughput * emitted, 0)
            if self.narrow is not None:
                weight = of_drawn + dr.select(active, f * share, 0)
                change = place.reflectance(bsdf, toward, reflects) - derivative_of(weight)
                L += dr.detach(throughput) * mirrored * change
            turn = self.turn(there, to, f, bs.pdf, density, active)
            if other is not None:
                turn = dr.select(onward < self.onward, other, turn)
            (place, toward, value, active), si = turn, turn[0].si
            throughput = dr.select(active, throughput * value, 0)
            if self.starts is not None:  # so that the kernels of reverse mode are smaller
                dr.eval(L, throughput, place, toward, si, pi, ray, active, at_edge)
        self.radiance = dr.detach(L)
        if at_edge is not None and self.by_length is not None:
            L += self.beside_edges(at_edge, sampler)
        return L

    def mirrored(self, si, bsdf, bounces: int, active) -> mi.Float:
        """Radiance that reaches places if everything reflects as a mirror; 0 for broad lobes.

        It takes noise away: a lobe's reflection of the same radiance from all sides has the
        derivative of the reflectance. bounces: reflections that may follow, with this one.
        """
        L, weight = mi.Float(0), mi.Float(1)
        if self.narrow is None:
            return L
        with dr.suspend_grad():
            active = active & (at_pointer(self.narrow, bsdf) > 0)
            for _ in range(min(bounces, MIRRORS)):
                ray = self.emitters.spawn_ray(si, si.to_world(mi.reflect(si.wi)))
                pi = nearest_hit(self.scene, self.emitters.sheets, ray, active=active)
                si = pi.compute_surface_interaction(ray, active=active)
                L += dr.select(active, weight * si.emitter(self.scene).eval(si, active)[0], 0)
                active &= si.is_valid()
                weight *= si.bsdf(ray).eval_diffuse_reflectance(si, active)[0]
        return L

    def drawn(self, place, toward, bsdf, choice, point, active) -> tuple:
        """What a direction drawn toward an emitting panel brings, with its derivatives.

        The point that it meets keeps its place on its triangle. It shares its radiance with the
        reflected rays that meet it. Also its weight, and the `turn` of a path that goes on there.
        """
        if not self.drawing.tables:
            return mi.Float(0), mi.Float(0), None
        with dr.suspend_grad():
            (table,) = self.drawing.tables
            direction = self.drawing.draw(table, place.si, choice, point, active)
            f = place.detached(bsdf, toward, direction.ds.d, active)
            traced, sheets = active & (f > 0), self.emitters.sheets
            nearest = lambda ray, on: nearest_hit(self.scene, sheets, ray, active=on)  # noqa: E731
            direct = self.drawing.trace(table, nearest, place.si, direction, traced)
            dr.eval(direction, direct)  # so that the kernels of derivatives are smaller
        even = self.evenly(table, place, toward, bsdf, direction, active)
        active = direct.counts
        there = self.attach(direct.hit, direct.met, active)
        to = dr.normalize(there.p - place.p)
        density = place.density(bsdf, toward, to, active)
        share = mis_weight(direction.compared, density) / direction.ds.pdf
        f = place.reflection(bsdf, toward, to, active) * there.growth(place)
        weight = dr.select(active, f * share, 0)
        # The density that is compared is only nearly that of the draw
        f *= direction.compared / (PREFERENCE * direction.ds.pdf)
        turn = self.turn(there, to, f, density, direction.compared, active)
        return weight * there.emission(self.scene, -to, active) + even, weight, turn

    def turn(self, there, to, reflection, reflected, compared, active) -> tuple:
        """How a path goes on: place, direction back, reflection by its density, whether it does.

        reflected, compared: densities of reflected and of drawn directions [1/sr].
        """
        density = dr.lerp(reflected, compared / PREFERENCE, self.onward)
        return there, mi.Vector3f(-to), dr.select(active, reflection / density, 0), active

    def evenly(self, table, place, toward, bsdf, direction, active) -> mi.Float:
        """0, with the derivative of what a whole panel brings, less that at the drawn point.

        Its mean is 0. Where nothing hides the panel, and directions do not matter to what it emits
        and the place reflects, it takes the noise of the point away. In pixels that is little.
        """
        if self.starts is None:
            return mi.Float(0)
        panel, ds, panels = direction.index, direction.ds, table.panel_choice.panels
        first, x = dr.gather(mi.UInt32, self.of_panels, panel), place.p
        pairs = dr.gather(mi.UInt32, panels.kinds, panel) > 0
        n = dr.mulsign(place.n, dr.detach(dr.dot(place.n, toward)))
        whole, point, rest, above = mi.Float(0), mi.Float(0), mi.Bool(True), mi.Bool(False)
        of_panel = [(first, mi.Bool(True)), (first + 1, pairs)]
        for number, counts in of_panel[: 1 + panels.is_rectangle.any()]:
            a, b, c = self.triangle(dr.select(counts, number, first))
            corners = [corner - x for corner in (a, b, c)]
            whole += dr.select(counts, cosines_above(n, corners), 0)
            for corner in corners:
                above |= dr.dot(n, dr.normalize(corner)) > GRAZING
            N = dr.cross(b - a, c - a)
            with dr.suspend_grad():
                of, to = dr.detach(N) / dr.squared_norm(N), ds.p - dr.detach(a)
                u = dr.dot(of, dr.cross(to, dr.detach(c - a)))
                v = dr.dot(of, dr.cross(dr.detach(b - a), to))
                here = rest & (
                    ~pairs | (number != first) | (dr.minimum(dr.minimum(u, v), 1 - u - v) >= 0)
                )
                rest &= ~here
            y = a + u * (b - a) + v * (c - a) - x
            facing = dr.abs(dr.dot(N, y)) / (dr.squared_norm(y) * dr.norm(y))
            moved = dr.dot(n, dr.normalize(y)) * facing / dr.maximum(dr.detach(facing), 1e-30)
            point = dr.select(here & (dr.detach(moved) > 0), moved, point)
        with dr.suspend_grad():
            seen = panels.seen(panel, self.drawing.receiver(place.si), active)
            probability = direction.compared / (table.preference * seen.along(ds.d, ds.dist))
            active = active & above & (ds.pdf > 0) & (dr.dot(ds.n, ds.d) < 0)
            active &= seen.solid_angle > LARGE
            to = dr.normalize((a + b + c) / 3 - x)
            to = dr.select(dr.dot(to, n) > GRAZING, to, n)
            # As large as that of a white surface, for narrow lobes
            f = dr.minimum(place.detached(bsdf, toward, to, active) / dr.dot(to, n), dr.inv_pi)
            of_all = dr.select(active, f * direction.bound / probability, 0)
            of_point = dr.select(active, f * direction.bound / ds.pdf, 0)
            dr.eval(of_all, of_point)
        change = of_all * (whole - dr.detach(whole)) - of_point * (point - dr.detach(point))
        return dr.select(active, change, 0)

    def density_of(self, there: "AttachedPlace", place: "AttachedPlace") -> mi.Float:
        """Density that `drawn` compares for the direction to a place; a constant [1/sr]."""
        if not self.drawing.tables:
            return mi.Float(0)
        with dr.suspend_grad():
            receiver = self.drawing.receiver(place.si)
            si, hits = there.si, there.triangle > 0
            distance = dr.norm(si.p - receiver.p)
            emitter = si.emitter(self.scene, hits)
            return self.drawing.pdf(self.scene, receiver, distance, si, emitter, hits)

    def beside_edges(self, visit: "Visit", sampler) -> mi.Float:
        """What silhouettes hide or uncover of what a place reflects; 0, with derivatives."""
        place, toward, active = visit.place, visit.toward, mi.Bool(visit.active)
        edge = self.edge_point(self.by_length, sampler.next_2d())
        a, b, x = self.end(edge.a), self.end(edge.b), place.p
        z = a + edge.t * (b - a)
        with dr.suspend_grad():
            x0, z0, side = dr.detach(x), dr.detach(z), dr.detach(b - a)
            n = self.outward(edge, dr.cross(z0 - x0, side))
            distance = dr.norm(z0 - x0)
            near = z0 + self.aside(z0) * n
            to = dr.normalize(near - x0)
            f = place.detached(visit.bsdf, toward, (z0 - x0) / distance, active)
            active &= (dr.squared_norm(n) > 0) & (f > 0) & (visit.throughput > 0)
            start = self.emitters.spawn_ray(place.si, to).o
            ray = mi.Ray3f(start, dr.normalize(near - start))
            pi = nearest_hit(self.scene, self.emitters.sheets, ray, active=active)
            behind = ~pi.is_valid() | (pi.t > distance - BESIDE * self.extent)
            active &= behind | self.is_beside(edge.edge, pi, active)
            si = pi.compute_surface_interaction(ray, mi.RayFlags.All, active)
            L = self.incoming(ray, pi, sampler, visit.bounces, active)
            of_length = dr.norm(dr.cross(side, to)) / dr.norm(side) / distance
            value = visit.throughput * f * (L - visit.mirrored) * of_length / edge.density
            beyond = dr.norm(si.p - x0)
        y = self.attach(si, pi, active).p
        moves = dr.dot(z - x, n) / distance
        moves -= dr.select(active & si.is_valid(), dr.dot(y - x, n) / beyond, 0)
        return -dr.select(active, value * (moves - dr.detach(moves)), 0)

    def incoming(self, ray, pi, sampler, bounces, active) -> mi.Float:
        """Radiance along rays whose hits are known, with at most some reflections."""
        walk = copy(self.walk)
        walk.max_bounces = bounces
        with dr.suspend_grad():
            (L, _), _, _ = walk.walk(sampler, (ray, pi), active, Recorders([]))
        return dr.select(active, L[0], 0)

    def beside_silhouettes(self, launch: Launch) -> mi.Float:
        """What the silhouettes that the sensor sees hide or uncover of farther surfaces."""
        paths = launch.paths_from(self.sensor.sampler())
        sampler, column, row, *_ = paths.begin()
        edge = self.edge_point(self.silhouettes, sampler.next_2d())
        a, b = self.end(edge.a), self.end(edge.b)
        z = a + edge.t * (b - a)
        with dr.suspend_grad():
            z0, side, d = dr.detach(z), dr.detach(b - a), self.rays.direction
            n = self.outward(edge, dr.cross(d, side))
            position = self.rays.position(z0 + self.aside(z0) * n, column)
            active = dr.all((position >= 0) & (position < 1)) & (dr.squared_norm(n) > 0)
            ray = self.rays.at(column, row, position, paths.columns, paths.rows)
            distance = dr.dot(z0 - ray.o, d)
            near = dr.minimum(distance, self.extent)
            begin, before = ray.o + (distance - near) * d, distance - near
            active &= ~self.scene.ray_test(
                mi.Ray3f(begin, -d, before, 0, []), active & (before > 0)
            )
            shorter = mi.Ray3f(begin, d, ray.maxt - before, 0, [])
            pi = nearest_hit(self.scene, self.emitters.sheets, shorter, active=active)
            behind = pi.t > near - BESIDE * self.extent
            active &= pi.is_valid() & (behind | self.is_beside(edge.edge, pi, active))
            active &= self.emitters.is_model(pi.shape.emitter())
            si = pi.compute_surface_interaction(shorter, mi.RayFlags.All, active)
            most = mi.UInt32(self.walk.max_bounces)
            L = self.incoming(shorter, pi, sampler, most, active)
            of_length = dr.norm(dr.cross(side, d)) / dr.norm(side)
            area = float(np.prod(window_size(self.sensor)))
            value = dr.select(active, L * of_length / edge.density / area, 0)
            self.hides = value > 0
        y = self.attach(si, pi, active).p
        moves = dr.dot(z - y, n)
        return -value * dr.select(active, moves - dr.detach(moves), 0)


@dataclass
class Visit:
    """Where a path looks for silhouettes: the place, and what reaches the sensor from there.

    toward: direction to the place before. mirrored: see `AttachedPaths.mirrored`. bounces:
    reflections that may follow.
    """

    place: "AttachedPlace"
    toward: mi.Vector3f
    bsdf: mi.BSDFPtr
    throughput: mi.Float
    mirrored: mi.Float
    bounces: mi.UInt32
    active: mi.Bool


@dataclass
class AttachedPlace:
    """A point of a surface and its frame, with derivatives, and the interaction without them.

    twice_area: of its triangle [m^2]; 1 for other surfaces. triangle: from 1, or 0.
    """

    si: mi.SurfaceInteraction3f
    p: mi.Point3f
    s: mi.Vector3f
    t: mi.Vector3f
    n: mi.Vector3f
    twice_area: mi.Float
    triangle: mi.UInt32

    def growth(self, place: "AttachedPlace") -> mi.Float:
        """1, with the derivatives of the solid angle in which another place sees its triangle."""
        between = self.p - place.p
        cosine = dr.abs(dr.dot(self.n, dr.normalize(between)))
        solid_angle = cosine * self.twice_area / dr.squared_norm(between)
        return solid_angle / dr.detach(solid_angle)

    def density(self, bsdf, toward, to, active) -> mi.Float:
        """Density with which a reflection takes a direction, without derivatives [1/sr]."""
        wi, wo = dr.detach(self.local(toward)), dr.detach(self.local(to))
        return bsdf.pdf(mi.BSDFContext(), self.at(wi), wo, active)

    def local(self, direction) -> mi.Vector3f:
        return mi.Vector3f(*(dr.dot(direction, axis) for axis in (self.s, self.t, self.n)))

    def at(self, wi) -> mi.SurfaceInteraction3f:
        si = mi.SurfaceInteraction3f(self.si)
        si.wi = wi
        return si

    def detached(self, bsdf, toward, to, active) -> mi.Float:
        """Reflection toward a direction times cosine, without derivatives."""
        wi, wo = self.local(dr.detach(toward)), self.local(to)
        return bsdf.eval(mi.BSDFContext(), self.at(dr.detach(wi)), dr.detach(wo), active)[0]

    def reflection(self, bsdf, toward, to, active) -> mi.Float:
        """Reflection times cosine, with its derivatives by both directions."""
        ctx, wi, wo = mi.BSDFContext(), self.local(toward), self.local(to)
        wi0, wo0 = dr.detach(wi), dr.detach(wo)
        value = lambda i, o: bsdf.eval(ctx, self.at(i), o, active)[0]  # noqa: E731
        f = value(wi0, wo0)
        return f + slope(lambda i: value(i, wo0), wi) + slope(lambda o: value(wi0, o), wo)

    def reflectance(self, bsdf, toward, active) -> mi.Float:
        """Hemispherical reflectance of a lobe, less its value: its derivatives."""
        value = lambda w: bsdf.eval_diffuse_reflectance(self.at(w), active)[0]  # noqa: E731
        return slope(value, self.local(toward))

    def emission(self, scene, toward, active) -> mi.Float:
        """Emission toward a direction, with its derivatives."""
        emitter, wi = self.si.emitter(scene, active), self.local(toward)
        value = lambda w: emitter.eval(self.at(w), active)[0]  # noqa: E731
        here = dr.select(self.si.is_valid(), slope(value, wi), 0)
        return value(dr.select(self.si.is_valid(), dr.detach(wi), self.si.wi)) + here


def cosines_above(n, corners: list) -> mi.Float:
    """Integral of the cosine to a normal over a triangle's directions above the horizon [sr]."""

    def between(p, q):  # Lambert's formula
        p, q = (v * dr.rsqrt(dr.maximum(dr.squared_norm(v), 1e-30)) for v in (p, q))
        normal = dr.cross(p, q)
        sine = dr.sqrt(dr.maximum(dr.squared_norm(normal), 1e-12))
        return dr.dot(n, normal) * dr.atan2(sine, dr.dot(p, q)) / sine

    total, sets, rises = mi.Float(0), mi.Vector3f(0, 0, 1), mi.Vector3f(0, 0, 1)
    cut = mi.Bool(False)
    for p, q in zip(corners, corners[1:] + corners[:1]):
        from_p, from_q = dr.dot(n, p), dr.dot(n, q)
        crosses = (from_p > 0) != (from_q > 0)
        place = p + from_p / dr.select(crosses, from_p - from_q, 1) * (q - p)
        total += dr.select(
            (from_p > 0) | (from_q > 0),
            between(dr.select(from_p > 0, p, place), dr.select(from_q > 0, q, place)),
            0,
        )
        sets = dr.select(crosses & (from_p > 0), place, sets)
        rises = dr.select(crosses & (from_q > 0), place, rises)
        cut |= crosses
    return dr.abs(total + dr.select(cut, between(sets, rises), 0)) / 2


def derivative_of(number) -> mi.Float:
    """0, with the derivatives of a number."""
    return number - dr.detach(number)


def slope(function, direction) -> mi.Float:
    """0, with the derivatives of a function of a direction."""
    here = dr.detach(direction)
    change = mi.Float(0)
    with dr.suspend_grad():
        slopes = []
        for axis in mi.coordinate_system(here):
            ends = [function(dr.normalize(here + side * TURN * axis)) for side in (1, -1)]
            slopes.append((axis, (ends[0] - ends[1]) / (2 * TURN)))
    for axis, of_axis in slopes:
        moves = dr.dot(axis, direction)
        change += of_axis * (moves - dr.detach(moves))
    return change
