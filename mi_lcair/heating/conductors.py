"""Radiative conductors between facets, and the heat that flows through them.

Facet i gains from facet j the heat

    q_ij = GR_ij sigma (T_j^4 - T_i^4),    GR_ij = GR_ji >= 0 [m^2].

Heat flows by differences of T^4 alone. Facets of one temperature therefore exchange no heat,
whatever the errors of the conductors, and the sum of all flows is 0.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from mi_lcair.physics.blackbody import STEFAN_BOLTZMANN
from mi_lcair.plugins.paths.launch import UNIT

RINGS_DEG = np.linspace(0, 90, 10)  # elevations between the rings of the sky [degrees]

# With 95 % confidence, less than 3 of N paths meet what none of them has met.
UNMET = 3


@dataclass(frozen=True, eq=False)
class Facets:
    """The n facets of a scene that exchange heat.

    number: (n,), their numbers in the scene, see `rendering.facets.FacetTable`. area: (n,),
    of one side [m^2]. sides: (n,), number of sides that radiate, 1 or 2. groups: names of the
    groups. group: (n,), index of each facet's group in `groups`. material: (n,), its name.
    emissivity: (n,), hemispherical, in the total band.
    """

    number: np.ndarray
    area: np.ndarray
    sides: np.ndarray
    groups: tuple[str, ...]
    group: np.ndarray
    material: np.ndarray
    emissivity: np.ndarray

    @property
    def radiating_area(self) -> np.ndarray:
        """Area of all sides that radiate [m^2], (n,)."""
        return self.area * self.sides

    @property
    def emitting_area(self) -> np.ndarray:
        """Area times emissivity of all sides [m^2], (n,); not quite 0 if nothing is emitted."""
        return np.maximum(self.radiating_area * self.emissivity, np.finfo(float).tiny)

    @cached_property
    def membership(self) -> sparse.csr_array:
        """Whether each group (row) has each facet (column), 0 or 1."""
        n = len(self.number)
        rows = (self.group, np.arange(n))
        return sparse.csr_array((np.ones(n), rows), shape=(len(self.groups), n))

    def share_of_groups(self, shares: np.ndarray) -> np.ndarray:
        """Shares of what each group emits, from those of the facets, (groups,)."""
        M, emitted = self.membership, self.emitting_area
        return (M @ (shares * emitted)) / (M @ emitted)


@dataclass(frozen=True, eq=False)
class Conductors:
    """Radiative conductors of n facets [m^2].

    between: (n, n), sparse, symmetric. The diagonal is for radiation that a facet emits and absorbs
    again; it transfers no heat. to_sky: (n, rings), to the rings of the sky between the elevations
    `RINGS_DEG`. to_ground: (n,), to everything below the horizon.
    """

    between: sparse.csr_array
    to_sky: np.ndarray
    to_ground: np.ndarray

    @cached_property
    def parts(self) -> dict[str, np.ndarray]:
        """Conductors to the sky, the ground, the facet itself and all others, (n,) each."""
        return {
            "sky": self.to_sky.sum(axis=1),
            "ground": self.to_ground,
            "itself": self.between.diagonal(),
            "others": self.between.sum(axis=1) - self.between.diagonal(),
        }

    @property
    def outward(self) -> np.ndarray:
        """Sum of each facet's conductors to all others, to the sky and to the ground, (n,)."""
        return self.total - self.between.diagonal()

    @cached_property
    def total(self) -> np.ndarray:
        """Sum of each facet's conductors, (n,); that of all that it absorbs."""
        return self.to_sky.sum(axis=1) + self.to_ground + self.between.sum(axis=1)

    def absorbed(self, fourth: np.ndarray, sky: np.ndarray | float, ground: float) -> np.ndarray:
        """What the facets absorb, as an area times T^4 [m^2 K^4], (n,), also of what they emit.

        fourth, sky, ground: T^4 of the facets, (n,), of the rings of the sky, (rings,), or of the
        whole sky, and of the ground [K^4].
        """
        return self.between @ fourth + np.sum(self.to_sky * sky, axis=1) + self.to_ground * ground

    def gained(self, fourth: np.ndarray, sky: np.ndarray | float, ground: float) -> np.ndarray:
        """What the facets absorb less what they emit [m^2 K^4], (n,); see `absorbed`.

        It is exactly 0 if all T^4 are equal.
        """
        level = fourth[0]
        fourth = fourth - level
        return self.absorbed(fourth, sky - level, ground - level) - self.total * fourth

    def heat(self, kelvin: np.ndarray, sky_K: np.ndarray | float, ground_K: float) -> np.ndarray:
        """Heat that each facet gains [W], (n,).

        kelvin: temperatures of the facets [K], (n,). sky_K: temperatures of blackbodies with the
        radiance of the rings, (rings,), or of the whole sky. ground_K: that of the ground.
        """
        fourth = (np.asarray(T, float) ** 4 for T in (kelvin, sky_K, ground_K))
        return STEFAN_BOLTZMANN * self.gained(*fourth)

    def irradiance(
        self, kelvin: np.ndarray, sky_K: np.ndarray | float, ground_K: float
    ) -> np.ndarray:
        """Irradiance of each facet [W m^-2], (n,), as its surface absorbs it; see `heat`.

        It is sigma T^4 where everything around the facet has the temperature T, and NaN for a facet
        that absorbs nothing.
        """
        power = STEFAN_BOLTZMANN * self.absorbed(kelvin**4, np.asarray(sky_K) ** 4, ground_K**4)
        return power / np.where(self.total > 0, self.total, np.nan)

    def by_group(self, facets: Facets) -> "Conductors":
        """The conductors between groups of isothermal facets."""
        M = facets.membership
        return Conductors(M @ self.between @ M.T, M @ self.to_sky, M @ self.to_ground)


@dataclass(frozen=True, eq=False)
class Traced:
    """Conductors of each randomisation of the paths, from which every standard error follows.

    replicates: independent estimates of the same conductors. path_area: emitting area that one path
    of each facet represents, (n,) [m^2].
    """

    replicates: tuple[Conductors, ...]
    path_area: np.ndarray | float = 0.0

    @cached_property
    def mean(self) -> Conductors:
        """The mean of the replicates."""
        names = ("between", "to_sky", "to_ground")
        sums = (sum(getattr(replicate, name) for replicate in self.replicates) for name in names)
        return Conductors(*(total / len(self.replicates) for total in sums))

    def standard_error(self, function: Callable[[Conductors], np.ndarray]) -> np.ndarray:
        """Standard error of a linear function of the conductors at their mean.

        It is the scatter of the replicates, with the rounding of Float32 that they share.
        For a quantity that depends on them otherwise, give its derivative. The temperatures of a
        balance F(T, C) = 0 change by -J^-1 F(T, C_k), where C_k are the replicates and J is the
        Jacobian at the mean.
        """
        scatter = standard_error(np.array([function(C) for C in self.replicates]))
        return np.hypot(scatter, UNIT * function(self.mean))

    def least_error(self, fourth: np.ndarray, sky: np.ndarray | float, ground: float) -> np.ndarray:
        """Standard error of `Conductors.absorbed` below which none is stated [m^2 K^4], (n,).

        Of few paths each randomisation may have as many that end in the same place, and then there
        is no scatter. Half of `UNMET` paths may have met the hottest in place of the coldest end.
        Ends are what paths of either side have met, and sky and ground unless the scene is closed.
        """
        C, top = self.mean, fourth.max() + 1
        indptr, is_open = C.between.indptr, C.to_sky.any() or C.to_ground.any()
        around = np.append(sky, ground) if is_open else np.empty(0)
        met, is_met = np.append(fourth[C.between.indices], top), np.diff(indptr) > 0
        hottest = np.where(is_met, np.maximum.reduceat(met, indptr[:-1]), 0)
        coldest = np.where(is_met, np.minimum.reduceat(met, indptr[:-1]), top)
        span = np.maximum(hottest, around.max(initial=0))
        span -= np.minimum(coldest, around.min(initial=top))
        return UNMET / 2 * self.path_area * np.maximum(span, 0)


def standard_error(values: np.ndarray) -> np.ndarray:
    """Standard error of the mean of independent values along the first axis."""
    return values.std(axis=0, ddof=1) / np.sqrt(len(values))
