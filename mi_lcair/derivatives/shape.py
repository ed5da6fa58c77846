"""The surface of a model whose vertices move one by one, and what a sensor sees of it."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import count
from typing import Any

import mitsuba as mi
import numpy as np
from scipy.linalg import hadamard
from scipy.sparse import csr_array

from mi_lcair.charts import facets_section
from mi_lcair.coincident import weld
from mi_lcair.derivatives.attached import AttachedPaths, can_attach, mean_radiances
from mi_lcair.derivatives.edges import Contacts, ModelEdges
from mi_lcair.errors import InputError, check_known
from mi_lcair.physics.bands import known_band
from mi_lcair.plugins.emission.triangles import (
    Choice,
    numbers_of_triangles,
    triangle_vertices,
    vertex_positions,
)
from mi_lcair.plugins.paths.launch import FacetStarts, Launch, rounding_error
from mi_lcair.plugins.recorders.columns import met_triangles
from mi_lcair.rendering import facets
from mi_lcair.rendering.motions.motion import groups_of_meshes
from mi_lcair.rendering.motions.pose import displaced
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import changed
from mi_lcair.rendering.statistics import check_valid, edge_share
from mi_lcair.rendering.window import RANDOMISATIONS, Windows, window, window_area, window_size
from mi_lcair.results import Result, entry, summary_of

EDGE_ON = 1e-6  # cosine of a triangle below which it is seen from neither side
NEARER = 0.1  # least part of its triangles' heights that counts, however near other surfaces are
LEAST_HEIGHTS = 3.0  # largest reach in the least height of a vertex's triangles
THINNEST = 1e-3  # least reach in their mean height, however thin one of them is
BESIDE = 1e-3  # distance from a vertex, in these heights, at which other surfaces are looked for


class MovedMesh:
    """The triangles of a scene, and those of its vertices that move: the vertices of a group.

    None for the group is the whole model. Vertices at the same position move together, also those
    of other groups, so that no crack opens.
    Raises InputError for an unknown group, or if a part of the model is no mesh or has a
    triangle without area.

    scene: Scene. meshes: those of the model, and then those of the background. of_model: number of
    the model's vertices. vertices: of all meshes (V, 3) [m], Float64. ends: numbers of
    vertices up to the end of each mesh. welded: see `weld`, (V,). triangles: their vertices (T, 3),
    anticlockwise about the outward normal. moving:
    number of each vertex among those that move, -1 for one that does not, (V,). positions: those of
    the moving vertices, (n, 3) [m]. corners: as `moving`, for the corners of the triangles, (T, 3).
    has: 1 for the moving vertices of each triangle, (T, n). in_group: whether a triangle is one of
    the group (T,). sides: see `facings`.
    """

    def __init__(self, scene, group: str | None):
        self.scene, model = scene, facets.meshes_of_model(scene)
        groups = groups_of_meshes(scene) | {None: model or []}
        check_known(f"group of meshes of {scene.name}", groups, group)
        if model is None:
            raise InputError(f"{scene.name}: a part of the model is no mesh, and has no vertices")
        self.meshes = model + facets.background_meshes(scene)
        vertices = [vertex_positions(mesh).astype(float) for mesh in self.meshes]
        faces = [
            triangle_vertices(mesh)[:, :: -1 if mesh.has_flipped_normals() else 1].astype(int)
            for mesh in self.meshes
        ]
        for mesh, corners in zip(model, (v[f] for v, f in zip(vertices, faces))):
            flat = ~facets.normals_of(corners).any(axis=1)
            if flat.any():
                raise InputError(
                    f"{scene.name}: triangle {flat.argmax()} of shape '{mesh.id()}' has no area; "
                    "remove it"
                )
        *firsts, _ = ends = np.cumsum([0, *map(len, vertices)])
        self.ends, self.vertices = ends[1:], np.concatenate(vertices)
        self.of_model = count = int(ends[len(model)])
        parts = (0, self.vertices[:count]), (count, self.vertices[count:])
        self.welded = np.concatenate([first + weld(part) for first, part in parts if len(part)])
        self.triangles = np.concatenate([f + first for f, first in zip(faces, firsts)])
        of_group = [mesh in groups[group] for mesh in self.meshes]
        self.in_group = np.repeat(of_group, list(map(len, faces)))
        moving = np.full(len(self.vertices), -1)
        places = np.unique(self.welded[self.triangles[self.in_group]])
        moving[places] = np.arange(len(places))
        self.moving, self.positions = moving[self.welded], self.vertices[places]
        self.corners = self.moving[self.triangles]
        self.has = self.by_vertex(np.ones(self.corners.shape))
        is_model = np.arange(len(faces)) < len(model)
        self.sides = facets.facings(self.meshes)[1] * np.repeat(is_model, list(map(len, faces)))

    def by_vertex(self, values: np.ndarray) -> csr_array:
        """Values of the corners of each triangle (T, 3) by moving vertex, (T, n)."""
        triangle, corner = np.nonzero(self.corners >= 0)
        places = triangle, self.corners[triangle, corner]
        shape = len(values), len(self.positions)
        return csr_array((values[triangle, corner], places), shape=shape)

    @cached_property
    def extent(self) -> float:
        """Diagonal of the box around the model [m]."""
        return float(np.linalg.norm(np.ptp(self.vertices[: self.of_model], axis=0)))

    @cached_property
    def as_traced(self) -> np.ndarray:
        """Vertices of the triangles in the order of a hit's coordinates on them, (T, 3)."""
        firsts = np.append(0, self.ends)
        return np.concatenate([triangle_vertices(of) + n for of, n in zip(self.meshes, firsts)])

    @cached_property
    def normals(self) -> np.ndarray:
        """Twice the area of each triangle times its outward normal, (T, 3) [m^2]."""
        return facets.normals_of(self.vertices[self.triangles])

    @cached_property
    def areas(self) -> np.ndarray:
        """A third of the area of the group's triangles at each moving vertex, (n,) [m^2]."""
        return (self.in_group * np.linalg.norm(self.normals, axis=1) / 6) @ self.has

    @cached_property
    def outward(self) -> np.ndarray:
        """Outward unit normals at the moving vertices: means over the group's triangles, (n, 3).

        The normal is 0 where they cancel, as in a plate without thickness.
        """
        sums = self.has.T @ (self.normals * self.in_group[:, None])
        lengths = np.linalg.norm(sums, axis=1, keepdims=True)
        known = lengths > EDGE_ON * self.areas[:, None]
        return np.divide(sums, lengths, out=np.zeros_like(sums), where=known)

    def reach(self) -> np.ndarray:
        """Distances over which the surroundings of the moving vertices change, (n,) [m].

        It is the mean height of the triangles, by area, or the distance to the next surface before
        or behind the vertex if that is nearer; at most some of their least heights, such as the
        thickness of a plate at its rim, so that thin triangles do not turn far.
        """
        corners = self.vertices[self.triangles]
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        twice_area = np.linalg.norm(self.normals, axis=1)
        heights = twice_area / longest
        height = (twice_area * heights) @ self.has / (twice_area @ self.has)
        thinnest = 1 / self.has.multiply(1 / heights[:, None]).max(axis=0).toarray().ravel()
        largest = np.clip(LEAST_HEIGHTS * thinnest, THINNEST * height, height)
        nearest = np.full(len(height), np.inf)
        for normals in (self.outward, -self.outward):
            start = self.positions + BESIDE * height[:, None] * normals
            ray = mi.Ray3f(mi.Point3f(*start.T), mi.Vector3f(*normals.T))
            hit = self.scene.mi.ray_intersect_preliminary(ray)
            nearest = np.fmin(nearest, np.where(hit.is_valid().numpy(), hit.t.numpy(), np.inf))
        return np.minimum(np.maximum(nearest, NEARER * height), largest)

    def colours(self) -> np.ndarray:
        """A number for each moving vertex that differs between the corners of a triangle, (n,)."""
        beside = csr_array(self.has.T @ self.has)
        neighbours = np.split(beside.indices, beside.indptr[1:-1])
        colours = np.full(len(neighbours), -1)
        for vertex in np.argsort([-len(near) for near in neighbours], kind="stable"):
            taken = set(colours[neighbours[vertex]].tolist())
            colours[vertex] = next(k for k in count() if k not in taken)
        return colours

    def of_all(self, velocities: np.ndarray) -> np.ndarray:
        """Velocities of all vertices (V, 3) from those of the model; the background is at rest."""
        return np.pad(velocities, [(0, len(self.vertices) - len(velocities)), (0, 0)])

    def displaced(self, displacements: np.ndarray) -> np.ndarray:
        """All vertices after displacements (n, 3) of those that move, (V, 3) [m]."""
        return self.vertices + np.append(displacements, np.zeros((1, 3)), axis=0)[self.moving]

    def by_mesh(self, vertices: np.ndarray) -> dict[mi.Shape, np.ndarray]:
        """The vertices of the model (V, 3) [m] by mesh."""
        of_meshes = zip(self.meshes, self.ends, np.split(vertices, self.ends[:-1]))
        return {mesh: of for mesh, end, of in of_meshes if end <= self.of_model}

    def in_view(self, sensor, vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Visible areas of the triangles in parts of the window's area, (T,).

        Also their derivatives with respect to the areas toward the sensor. The area of a triangle
        that is edge-on is 0. Its derivative is the mean of the one-sided ones.
        """
        toward = facets.projected(vertices[self.triangles], sensor)
        whole = np.linalg.norm(self.normals, axis=1) / (2 * np.prod(window_size(sensor)))
        side = np.where(np.abs(toward) > EDGE_ON * whole, np.sign(toward), 0)
        back, front = self.sides
        slope = (front * (1 + side) - back * (1 - side)) / 2
        return np.where(side == 0, 0, slope * toward), slope

    def growth(self, sensor, along: np.ndarray) -> csr_array:
        """Derivatives of the visible areas with respect to the displacements, (T, n).

        along: displacement of each moving vertex per unit of its parameter, (n, 3) [m].
        """
        corners = self.vertices[self.triangles]
        opposite = np.roll(corners, -1, axis=1) - np.roll(corners, 1, axis=1)
        change = np.cross(along[self.corners], opposite) @ -window(sensor)[-1]
        slope = self.in_view(sensor, self.vertices)[1] / (2 * np.prod(window_size(sensor)))
        return self.by_vertex(slope[:, None] * change)


# Derivatives of an intensity with respect to the displacements of all vertices of a group
# ----------------------------------------------------------------------------------------
# All vertices move at once, each forward or backward by a sign of its own. The change of a path's
# radiance is due to the vertices of the triangles that it meets in one of the two poses. Times
# their signs, it is on average the sum of their derivatives; the signs of all others cancel.
#
# The paths begin at points of the triangles and follow them, as those of attached differences. With
# A the visible area of a triangle, and R the mean radiance toward the sensor from its points, 0
# from hidden ones, the intensity is the sum of A R. The derivative of A is known. Only that of R,
# from what turns, hides or is reflected, has to be found by displacements.

# Displacement of a vertex in parts of its `MovedMesh.reach`. The truncation error of two plates
# whose edges are near each other is 0.5 % with it, 5 % with 0.1 and 27 % with 0.3.
STEP = 0.03
# Shares of the paths that begin on triangles by their visible area, by that times their radiance,
# and on all that can be seen alike
SHARES = 0.35, 0.35, 0.3
FEW = 2**12  # paths that find the radiance of triangles that are edge-on
NOISY = 0.1  # relative error of attached paths from which on displacements are tried as well
SEEDS = 2**12  # more than the launches of one seed


@dataclass(frozen=True)
class VertexDerivatives:
    """Derivatives with respect to the displacements of the moving vertices of a surface.

    by_block: for each independent randomisation, (R, n) [W/sr per unit of the displacement].
    unscattered: standard errors of the means that these do not show, (n,). paths: number of paths.
    """

    by_block: np.ndarray
    unscattered: np.ndarray
    paths: int

    @property
    def mean(self) -> np.ndarray:
        return self.by_block.mean(axis=0)

    @property
    def error(self) -> np.ndarray:
        """Standard errors of the means, (n,)."""
        return np.hypot(standard_errors(self.by_block), self.unscattered)

    @property
    def total(self) -> tuple[float, float]:
        """Sum of the means, and its standard error."""
        sums = self.by_block.sum(axis=1, keepdims=True)
        missed = np.linalg.norm(self.unscattered)
        return float(sums.mean()), float(np.hypot(standard_errors(sums)[0], missed))


class Estimation:
    """Renders of a surface with displaced vertices, and the derivatives from them.

    Drawn directions and openings are not used, because their densities change with all vertices.
    Raises InputError if the sensor is not orthographic, and for closure = tail.

    surface: MovedMesh. along: displacement of each moving vertex per unit of its parameter, (n, 3)
    [m]. size: displacement of each vertex in its parameter, (n,); 0 for one that does not move.
    per_size: 1 / (2 size), or 0. growth: see `MovedMesh.growth`. q: probability that a path begins
    on a triangle, (T,). colours: see `MovedMesh.colours`. patterns: signs of the colours,
    (patterns, colours), whose columns are orthogonal.
    """

    def __init__(self, surface: MovedMesh, along: np.ndarray, sampling: Sampling):
        self.surface, self.along, self.sampling = surface, along, sampling
        scene = self.scene = surface.scene
        if scene.mi.integrator().closure == "tail":
            raise InputError(
                f"{scene.name}: closure = tail has no derivatives by vertex; use none or ambient"
            )
        self.sensor = scene.sensor(sampling.sensor)
        self.window = window_area(self.sensor, scene.name)
        length = np.linalg.norm(along, axis=1)
        self.size = STEP * surface.reach() / np.where(length > 0, length, np.inf)
        self.per_size = (length > 0) / np.where(length > 0, 2 * self.size, 1)
        self.colours = surface.colours()
        order = 1 << int(self.colours.max()).bit_length()
        self.patterns = hadamard(order)
        self.area, _ = surface.in_view(self.sensor, surface.vertices)
        self.growth = surface.growth(self.sensor, along)
        self.most_growth = abs(self.growth)
        self.radiance = facets.radiances(surface.meshes)
        self.triangles = numbers_of_triangles(surface.meshes)
        self.choice = self.starts()
        self.q = self.choice.probability
        self.paths = Windows.whole(self.sensor).paths(sampling.settled(self.sensor))
        self.points = -(-self.paths // (2 * RANDOMISATIONS * order))

    def starts(self) -> Choice:
        """What draws the triangle on which a path begins."""
        shown = self.area + self.most_growth @ self.size
        shown = shown * facets.seen_shares(self.scene, self.sensor, self.area[None])[0]
        parts = shown, shown * self.radiance, (shown > 0).astype(float)
        return facets.mixed_choice(SHARES, parts)

    def run(self) -> VertexDerivatives:
        """The derivatives from attached paths, or from displacements where these are better."""
        result = None
        with self.scene.prepared() as tracer:
            if can_attach(self.scene, tracer):
                paths = AttachedPaths(self.surface, self.sensor, tracer, self.choice)
                result = None if paths.contacts.meets_itself() else self.from_paths(paths)
        norm = np.linalg.norm
        if result is not None and norm(result.error) <= NOISY * norm(result.mean):
            return result
        other = self.from_displacements()
        is_better = result is None or norm(other.error) < norm(result.error)
        return other if is_better else result

    def from_paths(self, paths: AttachedPaths) -> VertexDerivatives:
        sampling, surface = self.sampling, self.surface
        points = -(-self.paths // (2 * RANDOMISATIONS))
        found = paths.run(sampling.seed, points, sampling.progress)
        self.sums, self.counts = found.sums, found.counts
        growth = self.most_growth @ np.ones(len(self.size))
        is_edge_on = (self.area == 0) & (growth > EDGE_ON * growth.max())
        if is_edge_on.any():  # no path begins there unless the vertices are displaced
            few = Estimation(
                surface, self.along, replace(sampling, paths=FEW, spp=None, progress=None)
            )
            few.choice = Choice(is_edge_on)
            few.q = few.choice.probability
            few.from_displacements()
            self.sums[:, is_edge_on] = few.sums[:, is_edge_on]
            self.counts[:, is_edge_on] = few.counts[:, is_edge_on]
        pooled, R = mean_radiances(self.sums, self.counts)
        moves, count = surface.moving >= 0, len(self.size)
        number = surface.moving[moves]
        velocities = np.zeros(surface.vertices.shape)
        velocities[moves] = self.along[number]
        by_vertex = [
            np.bincount(number, block, count) for block in found.along(velocities)[:, moves]
        ]
        by_block = R @ self.growth + np.array(by_vertex)
        # Of a vertex whose edges hide something
        hides = np.einsum("bvk,vk->v", np.abs(found.silhouettes), np.abs(velocities))
        hides = np.bincount(number, hides[moves], count) > 0
        one_path = hides * found.of_one_path(velocities)
        of_ends = np.sqrt(np.maximum(one_path**2 - standard_errors(by_block) ** 2, 0))
        missed = np.where(self.counts.any(axis=0), 0, self.radiance) @ self.most_growth
        rounding = rounding_error(self.scene.mi.integrator().max_bounces)
        parts = missed, of_ends, rounding * (pooled @ self.most_growth)
        unscattered = np.linalg.norm(parts, axis=0)
        paths_in_all = 2 * RANDOMISATIONS * points
        return VertexDerivatives(self.window * by_block, self.window * unscattered, paths_in_all)

    def from_displacements(self) -> VertexDerivatives:
        random, count = np.random.default_rng(self.sampling.seed), len(self.size)
        signs = random.choice([-1.0, 1.0], (RANDOMISATIONS, count))
        launches = RANDOMISATIONS * len(self.patterns)
        self.sums, self.counts = np.zeros((2, RANDOMISATIONS, len(self.area)))
        of_radiance, invalid = np.zeros((RANDOMISATIONS, count)), 0
        with changed(self.scene, emitter_sampling=False, opening_sampling=False):
            for launch in range(launches):
                block, row = divmod(launch, len(self.patterns))
                of_vertices = signs[block] * self.patterns[row, self.colours]
                slopes, lost = self.difference(block, launch, of_vertices)
                of_radiance[block] += slopes / len(self.patterns)
                invalid += lost
                if self.sampling.progress is not None:
                    self.sampling.progress(launch + 1, launches)
        paths = 2 * launches * self.points
        check_valid(invalid, paths, self.scene.name)
        pooled, R = mean_radiances(self.sums, self.counts)
        unscattered = self.unscattered(pooled, standard_errors(of_radiance))
        by_block = R @ self.growth + of_radiance
        return VertexDerivatives(self.window * by_block, self.window * unscattered, paths)

    def difference(self, block: int, launch: int, signs: np.ndarray) -> tuple[np.ndarray, int]:
        """Derivatives (n,) by the changes of R between two poses, and the number of invalid paths.

        The radiances of the paths are added to the sums of a block by triangle. signs: ways of the
        vertices in the first pose, (n,).
        """
        scene, surface, invalid = self.scene, self.surface, 0
        radiance, met, shows = [], [], []
        for side in (1, -1):
            vertices = surface.displaced(side * (signs * self.size)[:, None] * self.along)
            area, _ = surface.in_view(self.sensor, vertices)
            corners = vertices[surface.triangles]
            aim = FacetStarts.at(surface.meshes, corners, self.q, self.choice)
            seed = self.sampling.seed * SEEDS + launch
            paths = Launch(1, 1, seed, randomisations=1, points=self.points, aim=aim)
            with displaced(scene, surface.by_mesh(vertices)), scene.prepared() as tracer:
                L, start, of_pose = met_triangles(tracer, self.sensor, paths, self.triangles)
            valid = np.isfinite(L)
            invalid += int(np.sum(~valid))
            shows.append((area[start] > 0) & valid)
            radiance.append(np.where(shows[-1], L, 0))
            met.append(of_pose)
            self.sums[block] += np.bincount(start, radiance[-1], len(self.area))
            # A triangle that is edge-on is hidden or not as its neighbours move: only itself counts
            counts = shows[-1] & ((self.area[start] > 0) | (L > 0))
            self.counts[block] += np.bincount(start, counts, len(self.area))
        # A triangle that turns away has no R; what it shows by then is in the derivative of A
        change = np.where(shows[0] & shows[1], radiance[0] - radiance[1], 0)
        change *= self.area[start] / self.q[start] / self.points
        changes = np.flatnonzero(change)
        triangles = np.column_stack([start, *met])[changes]
        path, place = np.nonzero(triangles >= 0)
        shape = len(changes), len(self.area)
        meets = csr_array((np.ones(len(path)), (path, triangles[path, place])), shape=shape)
        touches = (meets @ surface.has).astype(bool)
        return change[changes] @ touches * signs * self.per_size, invalid

    def unscattered(self, R: np.ndarray, scatter: np.ndarray) -> np.ndarray:
        """Standard errors of the means that the scatter does not show, by window's area, (n,).

        All randomisations may miss a triangle, or the one path that a vertex hides or uncovers. Its
        radiance is then taken for the mean over the model.

        R: mean radiance of each triangle over all paths, (T,). scatter: standard errors of the
        derivatives of R that the scatter does show, (n,).
        """
        missed = np.where(self.counts.any(axis=0), 0, self.radiance)
        share = edge_share(RANDOMISATIONS) / (self.points * len(self.patterns))
        one_path = share * (self.area @ R) * self.per_size
        rounding = rounding_error(self.scene.mi.integrator().max_bounces)
        parts = [
            missed @ self.most_growth,
            np.sqrt(np.maximum(one_path**2 - scatter**2, 0)),
            rounding * (R @ self.most_growth),
        ]
        return np.linalg.norm(parts, axis=0)


def standard_errors(by_block: np.ndarray) -> np.ndarray:
    """Standard errors of the means of independent estimates (R, n), (n,)."""
    return by_block.std(axis=0, ddof=1) / np.sqrt(len(by_block))


# Derivative of an intensity along given velocities of all vertices
# -----------------------------------------------------------------


def slope_along(scene, sensor, velocities: np.ndarray, paths: int, seed: int):
    """Derivative of the target's mean radiance along a motion, and its error, by attached paths.

    Returns the derivative with the deviations of independent estimates, (1 + R,), and the standard
    error that they do not show; None if paths cannot be attached. velocities: of the vertices of
    all meshes of the model, (V, 3) [m per unit of the motion].
    """
    try:
        surface = MovedMesh(scene, None)
    except InputError:  # a triangle without area
        return None
    velocities = surface.of_all(velocities)
    growth = velocity_of_areas(surface, sensor, velocities)
    area, _ = surface.in_view(sensor, surface.vertices)
    radiance = facets.radiances(surface.meshes)
    shown = area * facets.seen_shares(scene, sensor, area[None])[0]
    choice = facets.mixed_choice(SHARES, (shown, shown * radiance, (shown > 0).astype(float)))
    with scene.prepared() as tracer:
        if not can_attach(scene, tracer):
            return None
        attached = AttachedPaths(surface, sensor, tracer, choice)
        if attached.contacts.meets_itself():
            return None
        points = -(-paths // (2 * RANDOMISATIONS))
        found = attached.run(seed, points)
    pooled, R = mean_radiances(found.sums, found.counts)
    by_block = R @ growth + found.along(velocities).sum(axis=1)
    deviations = by_block - by_block.mean()
    deviations /= np.sqrt(RANDOMISATIONS * (RANDOMISATIONS - 1))
    parts = [
        np.where(found.counts.any(axis=0), 0, radiance) @ abs(growth),
        np.sqrt(max(found.of_one_path(velocities) ** 2 - np.sum(deviations**2), 0)),
        rounding_error(scene.mi.integrator().max_bounces) * (pooled @ abs(growth)),
    ]
    return np.append(by_block.mean(), deviations), float(np.linalg.norm(parts))


def comes_apart(scene, velocities: np.ndarray) -> bool:
    """Whether parts of a model that touch move apart or into each other at velocities (V, 3)."""
    try:
        surface = MovedMesh(scene, None)
    except InputError:  # a triangle without area
        return False
    return Contacts(surface, ModelEdges(surface)).meetings(surface.of_all(velocities))[1]


def velocity_of_areas(surface: MovedMesh, sensor, velocities: np.ndarray) -> np.ndarray:
    """Derivatives of the visible areas of triangles, in parts of the window's area, (T,)."""
    step = 1e-6 * np.ptp(surface.vertices, axis=0).max() / max(abs(velocities).max(), 1e-300)
    ends = [
        facets.projected((surface.vertices + side * step * velocities)[surface.triangles], sensor)
        for side in (1, -1)
    ]
    return surface.in_view(sensor, surface.vertices)[1] * (ends[0] - ends[1]) / (2 * step)


# Derivatives of an intensity with respect to the shape of a group, by vertex and by facet
# ----------------------------------------------------------------------------------------


@dataclass(frozen=True, repr=False)
class ShapeDerivatives(Result):
    """Change of the target's intensity if parts of a group's surface are moved outward.

    Attributes
    ----------
    scene_name, band, group : str
        Names of the scene, of its band, and of the group.
    table : dict of str to ndarray, shape (facets,)
        Values of the group's facets, by name with unit. derivative_W_sr_m3 is the change of the
        intensity per metre of outward displacement and per square metre that is displaced. Its
        integral over the surface is `growth`.
    triangles, triangle_facet : ndarray, shapes (T, 3, 3) and (T,)
        Corners of the group's triangles [m], and the number of the facet of each.
    positions, normals : ndarray, shape (n, 3)
        Vertices of the group [m], and their outward normals.
    derivative, standard_error : ndarray, shape (n,)
        Derivatives with respect to the displacement of each vertex along its normal, W/sr per m.
        NaN where a vertex has no normal, as in a plate without thickness.
    growth, growth_error : float
        Sum of all derivatives, and its standard error, W/sr per m.
    paths : int
        Number of paths.
    axes : ndarray, shape (3, 3)
        Directions to the right and up in the sensor's film, and toward the sensor.
    """

    scene_name: str
    band: str
    group: str
    table: dict[str, np.ndarray] = entry("columns")
    triangles: np.ndarray = entry()
    triangle_facet: np.ndarray = entry()
    positions: np.ndarray = entry()
    normals: np.ndarray = entry()
    derivative: np.ndarray = entry()
    standard_error: np.ndarray = entry()
    growth: float = entry("growth_W_sr_m")
    growth_error: float = entry("standard_error_W_sr_m")
    paths: int
    axes: np.ndarray = entry()

    kind = "shape_derivatives"
    drawn_by = "mi_lcair.show.pictures.shape_derivatives:figure"
    heading = "Facets"
    computed = {"vertices": "vertices"}
    saved_by = facets.WRITERS

    def summary(self) -> str:
        """One line with the change of the intensity if the whole surface moves outward."""
        return (
            f"shape of {self.group} in {self.scene_name}, {self.band}: moved outward by 1 mm, it "
            f"changes the intensity by {1e-3 * self.growth:.4g} +- {1e-3 * self.growth_error:.2g} "
            "W/sr (standard error)"
        )

    def vertices(self) -> dict[str, np.ndarray]:
        """Positions, normals and derivatives of the vertices."""
        return {
            "position_m": self.positions,
            "normal": self.normals,
            "derivative_W_sr_m": self.derivative,
            "standard_error_W_sr_m": self.standard_error,
        }

    def facts(self) -> Iterator[Any]:
        """The growth in one line, and the facets in space."""
        yield summary_of(self)
        model = self.triangles, self.triangle_facet
        yield from facets_section(self.table, model, band=known_band(self.band)).parts


def differentiate_shape(scene, group: str, sampling: Sampling) -> ShapeDerivatives:
    """The derivatives of a loaded scene's intensity with respect to the shape of a group."""
    surface = MovedMesh(scene, group)
    result = Estimation(surface, surface.outward, sampling).run()
    inside, of_primitives = surface.in_group, facets.FacetTable(scene).of_primitives
    facet = np.concatenate([of_primitives[mesh] for mesh in surface.meshes])[inside]
    numbers, rows = np.unique(facet, return_inverse=True)
    area = np.linalg.norm(surface.normals[inside], axis=1) / 2
    areas = np.bincount(rows, area)
    # Means over the facets' areas of the derivatives per displaced area, (facets, n)
    shape = len(numbers), len(inside)
    of_facets = csr_array((area / 3 / areas[rows], (rows, np.flatnonzero(inside))), shape=shape)
    means = csr_array(of_facets @ surface.has / surface.areas)
    has_normal = surface.outward.any(axis=1)
    by_block, mean, error, unscattered = (
        np.where(has_normal, values, np.nan)
        for values in (result.by_block, result.mean, result.error, result.unscattered)
    )
    scatter = standard_errors(by_block @ means.T)
    growth, growth_error = result.total
    _, right, down, direction = window(scene.sensor(sampling.sensor))
    axes = np.array([right, -down, -direction])
    return ShapeDerivatives(
        scene_name=scene.name,
        band=scene.band.name,
        group=group,
        table={
            "facet": numbers,
            "area_m2": areas,
            "derivative_W_sr_m3": means @ mean,
            "standard_error_W_sr_m3": np.hypot(scatter, means @ unscattered),
        },
        triangles=surface.vertices[surface.triangles[inside]],
        triangle_facet=facet,
        positions=surface.positions,
        normals=surface.outward,
        derivative=mean,
        standard_error=error,
        growth=growth,
        growth_error=growth_error,
        paths=result.paths,
        axes=axes / np.linalg.norm(axes, axis=1, keepdims=True),
    )
