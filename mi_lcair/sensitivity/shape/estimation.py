"""Derivatives of an intensity with respect to the displacements of all vertices of a group.

All vertices move at once, each forward or backward by a sign of its own. The change of a path's
radiance is due to the vertices of the triangles that it meets in one of the two poses. Times their
signs, it is on average the sum of their derivatives; the signs of all others cancel.

The paths begin at points of the triangles and follow them, as those of attached differences. With
A the visible area of a triangle, and R the mean radiance toward the sensor from its points, 0 from
hidden ones, the intensity is the sum of A R. The derivative of A is known. Only that of R, from
what turns, hides or is reflected, has to be found by displacements.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import hadamard
from scipy.sparse import csr_array

from mi_lcair.errors import InputError
from mi_lcair.plugins.emission.triangles import Choice, numbers_of_triangles
from mi_lcair.plugins.paths.facet_starts import FacetStarts
from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.plugins.paths.met_triangles import met_triangles
from mi_lcair.plugins.paths.offsets import rounding_error
from mi_lcair.rendering.facets.starts import mixed_choice, radiances, seen_shares
from mi_lcair.rendering.motions.pose import displaced
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.settings import changed
from mi_lcair.rendering.statistics import check_valid, edge_share
from mi_lcair.rendering.window import RANDOMISATIONS, Windows, window_area
from mi_lcair.sensitivity.shape.surface import Surface

# Displacement of a vertex in parts of its `Surface.reach`. The truncation error of two plates whose
# edges are near each other is 0.5 % with it, 5 % with 0.1 and 27 % with 0.3.
STEP = 0.03
# Shares of the paths that begin on triangles by their visible area, by that times their radiance,
# and on all that can be seen alike
SHARES = 0.35, 0.35, 0.3
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

    surface: Surface. along: displacement of each moving vertex per unit of its parameter, (n, 3)
    [m]. size: displacement of each vertex in its parameter, (n,); 0 for one that does not move.
    per_size: 1 / (2 size), or 0. growth: see `Surface.growth`. q: probability that a path begins on
    a triangle, (T,). colours: see `Surface.colours`. patterns: signs of the colours, (patterns,
    colours), whose columns are orthogonal.
    """

    def __init__(self, surface: Surface, along: np.ndarray, sampling: Sampling):
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
        self.radiance = radiances(surface.meshes)
        self.triangles = numbers_of_triangles(surface.meshes)
        self.choice = self.starts()
        self.q = self.choice.probability
        paths = Windows.whole(self.sensor).paths(sampling.settled(self.sensor))
        self.points = -(-paths // (2 * RANDOMISATIONS * order))

    def starts(self) -> Choice:
        """What draws the triangle on which a path begins."""
        shown = self.area + self.most_growth @ self.size
        shown = shown * seen_shares(self.scene, self.sensor, self.area[None])[0]
        parts = shown, shown * self.radiance, (shown > 0).astype(float)
        return mixed_choice(SHARES, parts)

    def run(self) -> VertexDerivatives:
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
        pooled = self.sums.sum(axis=0) / np.maximum(self.counts.sum(axis=0), 1)
        R = np.where(self.counts > 0, self.sums / np.maximum(self.counts, 1), pooled)
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
