"""Derivatives of frames along motions: edges that move over the pixels, and attached paths.

The radiance on the film jumps at the edges of surfaces. When these move, a pixel gains what is on
one side of them, and loses what is on the other. Edges are cut at the borders of the pixels, and
their speed over the film is integrated exactly. Between the edges the radiance changes as surfaces
turn, and as what they reflect moves. Paths from fixed places of the film are attached to them.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import compress

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.coincident import SINGLE
from mi_lcair.derivatives.attached import EDGES, MOST_PATHS, AttachedPaths, can_attach
from mi_lcair.derivatives.motions.differences import velocities_before, velocities_of
from mi_lcair.derivatives.shape import MovedMesh
from mi_lcair.errors import InputError
from mi_lcair.plugins.bsdfs.reflection_bsdf import is_reflection_bsdf
from mi_lcair.plugins.emission.emissivity import is_textured
from mi_lcair.plugins.emitters.thermal_emitter import is_thermal
from mi_lcair.plugins.paths.launch import Launch, Paths
from mi_lcair.plugins.paths.sheets import nearest_hit
from mi_lcair.plugins.recorders.recorder import Recorders
from mi_lcair.rendering.facets import meshes_of_model, radiances
from mi_lcair.rendering.motions.motion import KINDS, matrix_of
from mi_lcair.rendering.motions.pose import known_motions
from mi_lcair.rendering.parameters.entries import is_grey_diffuse
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.statistics import check_valid, edge_share
from mi_lcair.rendering.window import Windows

ALONG_FRAME = "edges and attached paths"
# Samples per pixel of all, for each of the pilot that chooses it or differences; the most samples
FEWER, MOST_OF_PILOT = 8, 2**16
# Distance of a ray from an edge [pixels]; in roundings of a coordinate, the least one
ASIDE, ROUNDINGS = 1e-5, 8
CLEAR = 4  # distance of a ray from the ends of an edge, in its distance from the edge
ALONG_EDGES = 16  # places along a pixel's length of an edge for each point of a pixel
MOST_RAYS = 2**20  # of one pass beside edges


@dataclass(frozen=True)
class Film:
    """Where a sensor sees points: positions (x to the right, y down) [pixels], and depths.

    size: columns and rows. origin: of its rays (3,) [m]. axes: change of a point with x, y and the
    depth (3, 3) [m]; of a `is_central` sensor, with x and y at a depth of 1. depths: least and
    largest [m].
    """

    size: np.ndarray
    origin: np.ndarray
    axes: np.ndarray
    is_central: bool
    depths: tuple[float, float]

    @staticmethod
    def of(sensor) -> "Film":
        corners = mi.Point2f([0, 1, 0], [0, 0, 1])
        ray, _ = sensor.sample_ray(0, 0, corners, mi.Point2f(0.5))
        start, d = (np.array(part, dtype=float).T for part in (ray.o, ray.d))
        size, matrix = np.array(sensor.film().crop_size()), matrix_of(sensor)
        is_central = sensor.class_name() == "PerspectiveCamera"
        axis = matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])
        ends = d / (d @ axis)[:, None] if is_central else start
        last, origin = (ends[0], matrix[:3, 3]) if is_central else (axis, start[0])
        axes = np.stack([*(ends[1:] - ends[0]) / size[:, None], last], axis=1)
        near = float(sensor.near_clip()) if is_central else 0.0
        return Film(size, origin, axes, is_central, (near, near + ray.maxt[0] * (d[0] @ axis)))

    def seen(self, points: np.ndarray) -> np.ndarray:
        """Positions and depths of points (..., 3) [m], (..., 3)."""
        place = (points - self.origin) @ np.linalg.inv(self.axes).T
        if self.is_central:
            with np.errstate(divide="ignore", invalid="ignore"):
                place[..., :2] /= place[..., 2:]
        return place

    def speeds(self, seen: np.ndarray, velocities: np.ndarray) -> np.ndarray:
        """Velocities of positions from those of the points in space, (..., 2)."""
        rates = velocities @ np.linalg.inv(self.axes).T
        if self.is_central:
            return (rates[..., :2] - seen[..., :2] * rates[..., 2:]) / seen[..., 2:]
        return rates[..., :2]

    def rays(self, x, y, depth) -> tuple:
        """Points at positions and depths, and their change with the depth; mi.Vector3d [m]."""
        vectors = [mi.Vector3d(row) for row in (*self.axes.T, self.origin)]
        dr.make_opaque(*vectors)  # so that one kernel serves all sensors
        right, down, along, origin = vectors
        aside = x * right + y * down
        if self.is_central:
            aside, along = 0, aside + along
        return origin + aside + along * depth, along


def within(values: np.ndarray, rates: np.ndarray, low, high) -> tuple[np.ndarray, np.ndarray]:
    """Where values + s rates, (..., n), are from low to high: from and to which s in 0..1."""
    rates = np.where(rates == 0, 1e-300, rates)
    with np.errstate(over="ignore"):
        ends = np.sort([(low - values) / rates, (high - values) / rates], axis=0)
    return np.clip(ends[0], 0, 1), np.clip(ends[1], 0, 1)


def parts_in_pixels(start: np.ndarray, side: np.ndarray, size) -> tuple[np.ndarray, ...]:
    """Parts of lines start + s side, (n, 2) [pixels], in 0 < s < 1, that are in one pixel each.

    Returns the line of each part, s at its ends, and its pixel, row by row.
    """
    low, high = within(start.T, side.T, 0, np.reshape(size, (2, 1)))
    low, high = low.max(axis=0), np.maximum(high.min(axis=0), low.max(axis=0))
    lines, cuts = [np.tile(np.arange(len(start)), 2)], [low, high]
    for of, along in zip(start.T, side.T):
        ends = np.sort([of + low * along, of + high * along], axis=0)
        count = np.maximum(np.ceil(ends[1]) - np.floor(ends[0]) - 1, 0).astype(int)
        line = np.repeat(np.arange(len(of)), count)
        border = np.floor(ends[0])[line] + 1
        border += np.arange(len(line)) - np.repeat(np.cumsum(count) - count, count)
        lines.append(line)
        cuts.append(np.clip((border - of[line]) / along[line], low[line], high[line]))
    line, cut = np.concatenate(lines), np.concatenate(cuts)
    order = np.lexsort([cut, line])
    line, cut = line[order], cut[order]
    some = np.flatnonzero((line[1:] == line[:-1]) & (cut[1:] > cut[:-1]))
    line, ends = line[some], np.stack([cut[some], cut[some + 1]])
    column, row = np.floor(start[line] + ends.mean(axis=0)[:, None] * side[line]).astype(int).T
    return line, *ends, np.clip(row, 0, size[1] - 1) * size[0] + np.clip(column, 0, size[0] - 1)


@dataclass(frozen=True)
class MovingEdges:
    """Parts of edges that move over the film, each within one pixel.

    edge: number of the edge of each part, (n,). ends: positions and depths of the ends of the edge,
    (2, 3, n). speeds: velocities of these across the edge, times its length on the film, (K, 2, n)
    [pixels^2 per unit]. span: where the part begins and ends, in parts of the edge on the film, (2,
    n). pixel: (n,).
    """

    edge: np.ndarray
    ends: np.ndarray
    speeds: np.ndarray
    span: np.ndarray
    pixel: np.ndarray

    @staticmethod
    def of(film: Film, vertices: np.ndarray, ends: np.ndarray, velocities) -> "MovingEdges":
        """Those of edges between vertices (E, 2), for velocities of all vertices, (K, V, 3)."""
        depth = film.seen(vertices[ends])[..., 2]
        t = np.array(within(depth[:, 0], depth[:, 1] - depth[:, 0], *film.depths))
        edge = np.flatnonzero(t[1] > t[0])
        t = t.T[edge, :, None]
        points, moves = (
            of[..., :1, :] + t * (of[..., 1:, :] - of[..., :1, :])
            for of in (vertices[ends[edge]], velocities[:, ends[edge]])
        )
        seen = film.seen(points)
        side = (seen[:, 1] - seen[:, 0])[:, :2]
        speeds = np.einsum("kntx,nx->ktn", film.speeds(seen, moves), across(side))
        line, *span, pixel = parts_in_pixels(seen[:, 0, :2], side, film.size)
        parts = edge[line], seen.transpose(1, 2, 0)[..., line], speeds[..., line], np.array(span)
        return MovingEdges(*parts, pixel)

    def some(self, which) -> "MovingEdges":
        return MovingEdges(*(of[..., which] for of in vars(self).values()))

    def places(self, points: int) -> np.ndarray:
        """Numbers of places on the parts by the areas that they sweep, (n,).

        points: mean number for each pixel of their length.
        """
        length = np.linalg.norm((self.ends[1] - self.ends[0])[:2], axis=0)
        width = np.diff(self.span, axis=0)[0]
        swept = width * np.abs(self.speeds).mean(axis=1)
        share = swept / np.maximum(swept.sum(axis=1, keepdims=True), 1e-300)
        return np.ceil(points * (length @ width) * share.mean(axis=0)).astype(int)


def is_black(bsdf) -> bool:
    """Whether a surface is known to reflect and to transmit nothing."""
    if is_reflection_bsdf(bsdf):
        directions = mi.Vector3f([0, 0.8], [0, 0], [1, 0.6])
        return not np.any(mi.Float(bsdf.HDR(directions)[0]).numpy())
    return is_grey_diffuse(bsdf) and mi.traverse(bsdf)["reflectance.value"][0] == 0


def is_even(emitter) -> bool:
    """Whether an emitter is known to have one radiance on each triangle."""
    return is_thermal(emitter) and emitter.facet_radiance() is not None


def across(side: np.ndarray) -> np.ndarray:
    """Vectors (n, 2) perpendicular to others, and as long."""
    return np.stack([-side[:, 1], side[:, 0]], axis=1)


class Frame:
    """A frame of a scene, and its derivatives along motions. Use it while the scene is prepared.

    surface: MovedMesh. windows: the pixels. paths: the AttachedPaths. varies: whether what a mesh
    shows may differ from place to place of a triangle, of all vertices, (V,). reflects: whether a
    triangle reflects, (T,).
    """

    def __init__(self, surface: MovedMesh, windows: Windows, tracer):
        meshes, self.windows = surface.meshes, windows
        of_mesh = np.repeat(np.arange(len(meshes)), [mesh.face_count() for mesh in meshes])
        shown = np.stack([of_mesh, radiances(meshes)], axis=1)
        kinds = np.unique(shown, axis=0, return_inverse=True)[1].ravel()
        self.paths = AttachedPaths(surface, windows.sensor, tracer, None, kinds)
        self.film, self.surface, self.kinds = Film.of(windows.sensor), surface, kinds
        black = [is_black(mesh.bsdf()) for mesh in meshes]
        self.is_black = all(black)
        self.reflects = ~np.array(black)[of_mesh]
        varies = [
            is_textured(mesh.bsdf()) or (of is not None and not is_even(of))
            for mesh, of in ((mesh, mesh.emitter()) for mesh in meshes)
        ]
        self.varies = np.repeat(varies, np.diff(surface.ends, prepend=0))

    @cached_property
    def may_step(self) -> np.ndarray:
        """Whether the radiance may jump at edges, (E,).

        It does not between two triangles that are turned alike and emit the same, if nothing
        reflects.
        """
        beside, surface = self.paths.edges.beside, self.surface
        if beside.shape[1] != 2 or not self.is_black:
            return np.ones(len(beside), bool)
        film, corners = self.film, surface.vertices[surface.triangles]
        to = corners[:, 0] - film.origin if film.is_central else film.axes[:, 2]
        side = np.sign(np.sum(surface.normals * to, axis=1))
        shown = np.stack([self.kinds, side])[:, beside]
        return (beside < 0).any(axis=1) | (shown[..., 0] != shown[..., 1]).any(axis=0)

    @staticmethod
    def of(scene, windows: Windows, tracer) -> "Frame | None":
        """The frame of a sensor; None if paths from fixed places of it cannot be attached."""
        if not can_attach(scene, tracer):
            return None
        try:
            surface = MovedMesh(scene, None)
        except InputError:  # a triangle without area
            return None
        return Frame(surface, windows, tracer)

    # ------------------------------------------------------------------ Edges on the film

    def moving_edges(self, velocities: np.ndarray, seed: int, points: int) -> tuple:
        """What edges that move over the pixels bring, (R, K, pixels).

        Also standard errors from where their visible parts end if all randomisations agree, see
        `edge_share`, (K, pixels).
        velocities: of all vertices, (K, V, 3) [m per unit]. points: of each randomisation.
        """
        vertices, R = self.surface.vertices, self.windows.randomisations
        edges = MovingEdges.of(self.film, vertices, self.paths.edges.ends, velocities)
        moving = np.abs(edges.speeds).max(axis=(0, 1)) > 0
        edges = edges.some(moving & self.may_step[edges.edge])
        count = edges.places(ALONG_EDGES * points)
        n, before = len(count), np.cumsum(count) - count
        part = np.repeat(np.arange(n), count)
        width = np.diff(edges.span, axis=0)[0] / np.maximum(count, 1)
        table, sums = self.table(edges, before, width), np.zeros((2, R, n))
        of_ends = np.zeros((len(velocities), self.windows.count))
        for first in range(0, len(part), MOST_RAYS // R):
            of = part[first : first + MOST_RAYS // R]
            gained = self.step_across(table, of, seed, first)
            middle = edges.span[0][of] + width[of] * (first + np.arange(len(of)) - before[of] + 0.5)
            for r in range(R):
                sums[0, r] += np.bincount(of, (1 - middle) * gained[r], n)
                sums[1, r] += np.bincount(of, middle * gained[r], n)
            jump = np.abs(np.diff(gained, append=gained[:, -1:])).min(axis=0) * width[of]
            jump *= edge_share(R) * (np.diff(edges.edge[of], append=-1) == 0)
            at_jump = np.flatnonzero(jump)
            of, middle, jump = of[at_jump], middle[at_jump], jump[at_jump]
            for errors, (a, b) in zip(of_ends, edges.speeds):
                swept = (a[of] + middle * (b - a)[of]) * jump
                errors += np.bincount(edges.pixel[of], swept**2, len(errors))
        gained = np.einsum("erp,kep,p->rkp", sums, edges.speeds, width)
        total = np.zeros((R, len(velocities), self.windows.count))
        for r, k in np.ndindex(total.shape[:2]):
            total[r, k] = np.bincount(edges.pixel, gained[r, k], self.windows.count)
        return total, np.sqrt(of_ends)

    def table(self, edges: MovingEdges, before: np.ndarray, width: np.ndarray):
        """What `step_across` needs of each part of edges: eleven numbers.

        The ends of the edge, with the reciprocal of a central sensor's depth; distance of rays from
        it, where the part begins, number of its first place, and distance of its places, these but
        the number in parts of the edge; number of the edge.
        """
        film, (a, b) = self.film, edges.ends
        points = self.surface.vertices[self.paths.edges.ends[edges.edge]]
        largest = np.maximum(np.abs(points).max(axis=(1, 2)), self.surface.extent / 4)
        rounding = ROUNDINGS * SINGLE * largest
        pitch = np.linalg.norm(film.axes[:, 0])  # [m]
        pitch = pitch * np.minimum(a[2], b[2]) if film.is_central else pitch
        aside = np.maximum(ASIDE, rounding / pitch) / np.linalg.norm((b - a)[:2], axis=0)
        power = -1.0 if film.is_central else 1.0
        of_ends = *a[:2], a[2] ** power, *b[:2], b[2] ** power
        rows = *of_ends, aside, edges.span[0], before, width, edges.edge
        return mi.Float64(np.stack(rows, axis=1).ravel())

    def step_across(self, table, part: np.ndarray, seed: int, first: int) -> np.ndarray:
        """Radiance before edges minus that behind them, at one place of each stratum, (R, n).

        0 where something hides them. part: the part of each (n,). first: number of the first one.
        """
        R, n = self.windows.randomisations, len(part)
        lanes = Launch(1, 1, seed ^ EDGES, R, n, first).paths_from(self.windows.sensor.sampler())
        number = lanes.lane % lanes.points
        part = dr.gather(mi.UInt32, mi.UInt32(part), number)
        *a, from_eye, b_x, b_y, to_eye, aside, low, before, width, edge = (
            dr.gather(mi.Float64, table, 11 * part + k) for k in range(11)
        )
        _, _, _, position, *_ = lanes.begin()
        s = low + width * (mi.Float64(lanes.first_point + number) - before + position.x)
        # Close to its ends, a ray beside an edge may meet the next triangle
        clear = dr.minimum(CLEAR * aside, 0.5)
        s = dr.clip(s, clear, 1 - clear)
        depth = dr.lerp(from_eye, to_eye, s)
        depth = 1 / depth if self.film.is_central else depth
        side = mi.Vector2d(b_x, b_y) - mi.Point2d(*a)
        place = a + s * side
        move = aside * mi.Vector2d(-side.y, side.x)
        (before, is_own), (behind, is_other) = (
            self.radiance(place + move, depth, mi.UInt32(edge), lanes) for move in (-move, move)
        )
        gained = dr.select(is_own | is_other, before - behind, 0).numpy()
        check_valid(int(np.sum(~np.isfinite(gained))), R * n, self.surface.scene.name)
        return np.broadcast_to(gained, R * n).reshape(R, n)

    def radiance(self, place, depth, edge, lanes: Paths) -> tuple[mi.Float, mi.Bool]:
        """Radiance at places of the film, and whether a triangle at an edge is seen.

        depth: of the edge [m].
        """
        paths, beside = self.paths, self.paths.edges.beside
        limits = mi.Vector3d(np.append(self.film.depths, self.surface.extent))
        dr.make_opaque(limits)
        near = dr.maximum(depth - limits.z, limits.x)
        start, to = self.film.rays(place.x, place.y, near)
        length = dr.norm(to)
        farthest = mi.Float((limits.y - near) * length)
        ray = mi.Ray3f(mi.Point3f(start), mi.Vector3f(to / length), farthest, 0, [])
        pi = nearest_hit(paths.scene, paths.emitters.sheets, ray)
        sampler, *_ = lanes.begin()
        (L, _), _, _ = paths.walk.walk(sampler, (ray, pi), mi.Bool(True), Recorders([]))
        met = paths.number.at(pi.shape, pi.prim_index, pi.is_valid())
        numbers, is_beside = mi.UInt32(np.ravel(beside + 1).astype(np.uint32)), mi.Bool(False)
        for k in range(beside.shape[1]):
            of = dr.gather(mi.UInt32, numbers, beside.shape[1] * edge + k)
            is_beside |= (met > 0) & (met == of)
        if self.surface.of_model < len(self.surface.vertices):  # the background may hide the edge
            before = mi.Float((near - limits.x) * length)
            back = mi.Ray3f(ray.o, -ray.d, before, 0, [])
            is_beside &= ~paths.scene.ray_test(back, before > 0)
        return L[0], is_beside

    # -------------------------------------------------------------- Between the edges

    def interior(self, velocities: np.ndarray, seed: int, points: int) -> np.ndarray:
        """What paths from fixed places of the film bring, (R, K, pixels)."""
        windows, bounces = self.windows, max(1, self.paths.walk.max_bounces)
        total = np.zeros((windows.randomisations, len(velocities), windows.count))
        if self.is_black:
            return total
        step = max(1, MOST_PATHS // (bounces * max(len(self.shown), 1) * windows.randomisations))
        for first in range(0, points, step):
            some = min(step, points - first)
            rows = MOST_PATHS // bounces // some
            for launch in windows.launches(self.shown, first, some, seed, None, rows):
                total[..., launch.window_numbers] += self.along(velocities, launch)
        return total / points

    @cached_property
    def shown(self) -> np.ndarray:
        """Numbers of the pixels in which triangles may reflect; no others change.

        An edge passes through these, or their centres show such a triangle.
        """
        film, vertices = self.film, self.surface.vertices
        size, ranges = film.size, np.digitize(film.seen(vertices)[:, 2], film.depths)
        if np.ptp(ranges[self.surface.triangles], axis=1).any():  # clipped where there is no edge
            return np.arange(size.prod())
        still = np.zeros((1, *vertices.shape))
        edges = MovingEdges.of(film, vertices, self.paths.edges.ends, still)
        centres = (np.indices(size[::-1]).reshape(2, -1)[::-1] + 0.5) / size[:, None]
        ray, _ = self.windows.sensor.sample_ray(0, 0, mi.Point2f(centres), mi.Point2f(0.5))
        pi, number = self.paths.scene.ray_intersect_preliminary(ray), self.paths.number
        met = number.at(pi.shape, pi.prim_index, pi.is_valid()).numpy().astype(int)
        return np.union1d(np.flatnonzero(np.append(False, self.reflects)[met]), edges.pixel)

    def along(self, velocities: np.ndarray, launch: Launch) -> np.ndarray:
        """Sums of the derivatives along the paths of some pixels, (R, K, windows)."""
        paths, sensor = self.paths, self.windows.sensor
        paths.block, sums = mi.UInt32(0), []
        paths.positions = mi.Float(np.ravel(self.surface.vertices))
        dr.enable_grad(paths.positions)
        lanes = launch.paths_from(sensor.sampler())
        sampler, column, row, position, *_ = lanes.begin()
        place = (mi.Point2f(column, row) + position) / mi.Point2f(self.film.size.tolist())
        ray, _ = sensor.sample_ray(0, 0, place, mi.Point2f(0.5))
        pi = nearest_hit(paths.scene, paths.emitters.sheets, ray)
        si = pi.compute_surface_interaction(ray, mi.RayFlags.All)
        first = paths.attach(si, pi, mi.Bool(True))
        # The place on the plane of the triangle that stays on the ray
        t = dr.dot(first.n, first.p - ray.o) / dr.dot(first.n, ray.d)
        first.p = dr.select(si.is_valid(), ray.o + t * ray.d, first.p)
        L = paths.follow(sampler, ray, si, first, mi.Bool(True))
        for of in velocities:
            dr.clear_grad(L)
            dr.set_grad(paths.positions, mi.Float(np.ravel(of)))
            dr.forward_from(paths.positions, flags=dr.ADFlag.ClearVertices)
            change = dr.grad(L).numpy() if dr.grad_enabled(L) else np.zeros(1)
            sums.append(np.broadcast_to(change, launch.paths))
        invalid = int(np.sum(~np.isfinite(sums)))
        check_valid(invalid, np.size(sums), self.surface.scene.name)
        shape = len(velocities), -1, launch.randomisations, launch.points
        return np.reshape(sums, shape).sum(axis=-1, dtype=float).transpose(2, 0, 1)


# The choice between edges with attached paths, and differences
# -------------------------------------------------------------


def along_frame(
    scene, names, windows: Windows, sampling: Sampling, difference: Callable
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Derivatives of the pixels along motions of meshes by name, (R, pixels) each.

    Each with standard errors that the randomisations do not show, (pixels,).

    Motions whose differences have less error are left out, and those for which there is no `Frame`.
    difference: gives the difference for a name and a sampling, (R, pixels).
    """
    if windows.sensor.class_name() not in KINDS or meshes_of_model(scene) is None:
        return {}
    rates = {name: seen_velocities(scene, windows, name) for name in names}
    spp = max(min(sampling.spp // FEWER, MOST_OF_PILOT // windows.count), 1)
    seed, few = sampling.seed, replace(sampling, spp=spp, progress=None)
    with scene.prepared() as tracer:
        frame = Frame.of(scene, windows, tracer)
        if frame is None:
            return {}
        meets, varies = frame.paths.contacts.meets_itself, frame.varies
        rates = {k: frame.surface.of_all(of) for k, of in rates.items() if of is not None}
        names = [k for k, of in rates.items() if not of[varies].any() and not meets(of)]
        if not names:
            return {}
        velocities, points = np.array([rates[name] for name in names]), windows.points(few.spp)
        interior = frame.interior(velocities, seed, points)
        pilot = frame.moving_edges(velocities, seed, points)[0] + interior
    changes = interior.any(axis=(0, 2))
    is_better = [
        # Differences without noise have met nothing that changes
        not changes[k] or not 0 < noise(difference(name, few)) <= noise(pilot[:, k])
        for k, name in enumerate(names)
    ]
    if not any(is_better):
        return {}
    velocities, points = velocities[is_better], windows.points(sampling.spp)
    with scene.prepared() as tracer:
        frame = Frame(frame.surface, windows, tracer)
        total, missed = frame.moving_edges(velocities, seed, points)
        if changes[is_better].any():
            total += frame.interior(velocities, seed, points)
    return dict(zip(compress(names, is_better), zip(total.swapaxes(0, 1), missed)))


def seen_velocities(scene, windows: Windows, name: str) -> np.ndarray | None:
    """Velocities of all vertices in a motion of meshes or of the sensor, (V, 3); None without."""
    if known_motions(scene)[name].shapes:
        return velocities_of(scene, name)
    sky = scene.mi.environment()
    is_even = sky is None or sky.class_name() == "ConstantBackgroundEmitter"
    return velocities_before(scene, windows.sensor, name) if is_even else None


def noise(images: np.ndarray) -> float:
    """Sum of the variances of the pixels over the randomisations (R, pixels)."""
    return float(images.var(axis=0).sum())
