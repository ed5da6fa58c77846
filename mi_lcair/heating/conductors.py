"""Radiative conductors between facets, and the heat that flows through them.

Facet i gains from facet j the heat

    q_ij = GR_ij sigma (T_j^4 - T_i^4),    GR_ij = GR_ji >= 0 [m^2].

Heat flows by differences of T^4 alone. Facets of one temperature therefore exchange no heat,
whatever the errors of the conductors, and the sum of all flows is 0.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from scipy import sparse

from mi_lcair.physics.blackbody import STEFAN_BOLTZMANN

RINGS_DEG = np.linspace(0, 90, 10)  # elevations between the rings of the sky [degrees]


@dataclass(frozen=True, eq=False)
class Facets:
    """The n facets of a scene that exchange heat.

    number: (n,), their numbers in the scene, see `rendering.facets.table.FacetTable`. area: (n,),
    of one side [m^2]. sides: (n,), number of sides that radiate, 1 or 2. centre, normal: (n, 3)
    [m], 1. groups: names of the groups. group: (n,), index of each facet's group in `groups`.
    material: (n,), its name. emissivity: (n,), hemispherical, in the total band. is_diffuse: (n,),
    whether it has one side that reflects evenly.
    """

    number: np.ndarray
    area: np.ndarray
    sides: np.ndarray
    centre: np.ndarray
    normal: np.ndarray
    groups: tuple[str, ...]
    group: np.ndarray
    material: np.ndarray
    emissivity: np.ndarray
    is_diffuse: np.ndarray

    @property
    def radiating_area(self) -> np.ndarray:
        """Area of all sides that radiate [m^2], (n,)."""
        return self.area * self.sides

    @cached_property
    def membership(self) -> sparse.csr_array:
        """Whether each group (row) has each facet (column), 0 or 1."""
        n = len(self.number)
        rows = (self.group, np.arange(n))
        return sparse.csr_array((np.ones(n), rows), shape=(len(self.groups), n))


@dataclass(frozen=True, eq=False)
class Conductors:
    """Radiative conductors of n facets [m^2].

    between: (n, n), sparse, symmetric, without a diagonal. to_sky: (n, rings), to the rings of the
    sky between the elevations `RINGS_DEG`. to_ground: (n,), to what lies below the horizon.
    to_self: (n,), what a facet emits and absorbs again; no heat flows through it.
    """

    between: sparse.csr_array
    to_sky: np.ndarray
    to_ground: np.ndarray
    to_self: np.ndarray

    @cached_property
    def parts(self) -> dict[str, np.ndarray]:
        """Conductors to the sky, the ground, the facet itself and all others, (n,) each."""
        return {
            "sky": self.to_sky.sum(axis=1),
            "ground": self.to_ground,
            "itself": self.to_self,
            "others": self.between.sum(axis=1),
        }

    @cached_property
    def total(self) -> np.ndarray:
        """Sum of each facet's conductors to all others, to the sky and to the ground, (n,)."""
        return self.parts["sky"] + self.to_ground + self.parts["others"]

    def heat(self, kelvin: np.ndarray, sky_K: np.ndarray | float, ground_K: float) -> np.ndarray:
        """Heat that each facet gains [W], (n,).

        kelvin: temperatures of the facets [K], (n,). sky_K: temperatures of blackbodies with the
        radiance of the rings, (rings,), or of the whole sky. ground_K: that of the ground.
        """
        fourth = kelvin**4
        rings = np.broadcast_to(np.asarray(sky_K, float) ** 4, self.to_sky.shape[1])
        # The difference of each pair, so that equal temperatures give exactly 0
        i, j = self.pairs
        of_pairs = np.bincount(
            i, self.between.data * (fourth[j] - fourth[i]), minlength=len(fourth)
        )
        of_sky = np.sum(self.to_sky * (rings - fourth[:, None]), axis=1)
        of_ground = self.to_ground * (ground_K**4 - fourth)
        return STEFAN_BOLTZMANN * (of_pairs + of_sky + of_ground)

    def absorbed(self, fourth: np.ndarray, sky: np.ndarray | float, ground: float) -> np.ndarray:
        """What the facets absorb, as an area times T^4 [m^2 K^4], (n,), also of what they emit.

        fourth, sky, ground: T^4 of the facets, (n,), of the rings of the sky, (rings,), or of the
        whole sky, and of the ground [K^4].
        """
        of_facets = self.between @ fourth + self.to_self * fourth
        return of_facets + np.sum(self.to_sky * sky, axis=1) + self.to_ground * ground

    def gained(self, fourth: np.ndarray, sky: np.ndarray | float, ground: float) -> np.ndarray:
        """What the facets absorb less what they emit [m^2 K^4], (n,); see `absorbed`."""
        return self.absorbed(fourth, sky, ground) - (self.total + self.to_self) * fourth

    def irradiance(
        self, kelvin: np.ndarray, sky_K: np.ndarray | float, ground_K: float
    ) -> np.ndarray:
        """Irradiance of each facet [W m^-2], (n,), as its surface absorbs it; see `heat`.

        It is sigma T^4 where everything around the facet has the temperature T, and NaN for a facet
        that absorbs nothing.
        """
        absorbs = self.total + self.to_self
        power = STEFAN_BOLTZMANN * self.absorbed(kelvin**4, np.asarray(sky_K) ** 4, ground_K**4)
        return power / np.where(absorbs > 0, absorbs, np.nan)

    @cached_property
    def pairs(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows and columns of the entries of `between`."""
        rows = np.repeat(np.arange(self.between.shape[0]), np.diff(self.between.indptr))
        return rows, self.between.indices

    def by_group(self, facets: Facets) -> "Conductors":
        """The conductors between groups of isothermal facets."""
        M = facets.membership
        between = sparse.csr_array(M @ self.between @ M.T)
        to_self = M @ self.to_self + between.diagonal()
        between.setdiag(0)
        between.eliminate_zeros()
        return Conductors(between, M @ self.to_sky, M @ self.to_ground, to_self)


def weighted(conductors: Sequence[Conductors], weights: Sequence[float]) -> Conductors:
    """The sum of some conductors with weights."""
    names = [entry.name for entry in fields(Conductors)]
    return Conductors(*(sum(getattr(c, k) * w for c, w in zip(conductors, weights)) for k in names))


@dataclass(frozen=True, eq=False)
class Traced:
    """Conductors with their randomisations, from which every standard error follows.

    mean: the mean of the replicates. replicates: the conductors by each randomisation. They are
    independent estimates of the same numbers.
    """

    mean: Conductors
    replicates: tuple[Conductors, ...]

    def standard_error(self, function: Callable[[Conductors], np.ndarray]) -> np.ndarray:
        """Standard error of a linear function of the conductors at their mean.

        For a quantity that depends on them otherwise, give its derivative. The temperatures of a
        balance F(T, C) = 0 change by -J^-1 F(T, C_k), where C_k are the replicates and J is the
        Jacobian at the mean.
        """
        return standard_error(np.array([function(replicate) for replicate in self.replicates]))


def standard_error(values: np.ndarray) -> np.ndarray:
    """Standard error of the mean of independent values along the first axis."""
    return values.std(axis=0, ddof=1) / np.sqrt(len(values))
