"""Conductors between facets: heat flows, their sums, groups, and standard errors."""

import numpy as np
import pytest
from scipy import sparse

from mi_lcair.heating.conductors import RINGS_DEG, Conductors, Facets, Traced
from mi_lcair.heating.exchange import asymmetry_of
from mi_lcair.heating.surfaces import Means
from mi_lcair.physics.blackbody import STEFAN_BOLTZMANN

RINGS = len(RINGS_DEG) - 1


def conductors(rng, n: int) -> Conductors:
    """Random conductors of n facets, of which most pairs see nothing of each other."""
    half = sparse.random_array((n, n), density=0.3, rng=rng)
    between = sparse.csr_array(sparse.triu(half))
    return Conductors(sparse.csr_array(between + between.T), rng.random((n, RINGS)), rng.random(n))


def facets(group: np.ndarray) -> Facets:
    n = len(group)
    ones, names = np.ones(n), tuple(f"g{k}" for k in range(group.max() + 1))
    return Facets(np.arange(n), ones, 2 * ones, names, group, np.full(n, "m"), ones)


@pytest.fixture
def rng():
    return np.random.default_rng(20261123)


@pytest.mark.parametrize("n", [1, 2, 7, 40])
def test_facets_of_one_temperature_exchange_no_heat(rng, n):
    assert np.all(conductors(rng, n).heat(np.full(n, 300.0), 300.0, 300.0) == 0)


def test_the_flows_between_facets_add_up_to_zero(rng):
    C, n = conductors(rng, 40), 40
    closed = Conductors(C.between, np.zeros((n, RINGS)), np.zeros(n))
    heat = closed.heat(rng.uniform(200, 600, n), 0.0, 0.0)
    assert abs(heat.sum()) <= 1e-10 * np.abs(heat).sum()


def test_heat_is_that_of_each_pair(rng):
    C, T = conductors(rng, 7), rng.uniform(200, 600, 7)
    sky, ground = rng.uniform(200, 300, RINGS), 280.0
    expected = [
        sum(C.between[i, j] * (T[j] ** 4 - T[i] ** 4) for j in range(7))
        + sum(C.to_sky[i, k] * (sky[k] ** 4 - T[i] ** 4) for k in range(RINGS))
        + C.to_ground[i] * (ground**4 - T[i] ** 4)
        for i in range(7)
    ]
    np.testing.assert_allclose(
        C.heat(T, sky, ground), STEFAN_BOLTZMANN * np.array(expected), rtol=1e-12
    )
    np.testing.assert_allclose(C.gained(T**4, sky**4, ground**4), expected, rtol=1e-9)
    in_all = C.between.toarray().sum(axis=1) + C.to_sky.sum(axis=1) + C.to_ground
    np.testing.assert_allclose(C.total, in_all)
    np.testing.assert_allclose(C.outward, in_all - np.diag(C.between.toarray()))
    np.testing.assert_allclose(sum(C.parts.values()), in_all)


def test_groups_of_isothermal_facets_exchange_the_same_heat(rng):
    C, group = conductors(rng, 12), rng.integers(0, 3, 12)
    of_groups = rng.uniform(200, 600, 3)
    heat = C.by_group(facets(group)).heat(of_groups, 250.0, 290.0)
    of_facets = C.heat(of_groups[group], 250.0, 290.0)
    np.testing.assert_allclose(heat, np.bincount(group, of_facets), rtol=1e-12)


def test_the_standard_error_is_the_scatter_of_the_randomisations(rng):
    sets = tuple(conductors(rng, 5) for _ in range(8))
    error = Traced(sets).standard_error(lambda C: C.to_ground)
    expected = np.sqrt(np.var([C.to_ground for C in sets], axis=0) / 7)
    np.testing.assert_allclose(error, expected)


def test_irradiance_of_a_room_of_one_temperature_is_that_of_a_blackbody(rng):
    C = conductors(rng, 7)
    expected = STEFAN_BOLTZMANN * 300.0**4
    np.testing.assert_allclose(C.irradiance(np.full(7, 300.0), 300.0, 300.0), expected, rtol=1e-12)


def test_absorbed_less_emitted_is_the_heat(rng):
    C, T = conductors(rng, 7), rng.uniform(200, 600, 7)
    absorbed = C.irradiance(T, 250.0, 290.0) * C.total
    emitted = STEFAN_BOLTZMANN * T**4 * C.total
    np.testing.assert_allclose(absorbed - emitted, C.heat(T, 250.0, 290.0), rtol=1e-10)


def test_what_groups_exchange_within_is_their_own(rng):
    C, group = conductors(rng, 12), rng.integers(0, 3, 12)
    by_group = C.by_group(facets(group))
    np.testing.assert_allclose(by_group.total, np.bincount(group, C.total), rtol=1e-12)
    within = [C.between.toarray()[np.ix_(group == k, group == k)].sum() for k in range(3)]
    np.testing.assert_allclose(by_group.parts["itself"], within, rtol=1e-12)


def test_both_sides_of_a_sheet_radiate():
    np.testing.assert_array_equal(facets(np.array([0, 1, 1])).radiating_area, [2, 2, 2])


def test_the_asymmetry_is_the_difference_of_two_directions_by_their_mean(rng):
    runs = [np.array([[0, 1 + x], [1.2, 0]]) for x in 0.01 * rng.standard_normal(8)]
    between, pair = [sparse.csr_array(run) for run in runs], facets(np.array([0, 1]))
    asymmetry = asymmetry_of(Means(between, np.zeros((8, 2, 1)), np.zeros(1)), pair, rays=1000)
    there = np.array([run[0, 1] for run in runs])
    expected = (there.mean() - 1.2) / (there.mean() / 2 + 0.6)
    np.testing.assert_allclose(asymmetry.relative, [[0, expected], [-expected, 0]], atol=1e-15)
    # One path of a facet of 1 m2 among 1000 adds to the error
    error = np.hypot(there.std(ddof=1) / np.sqrt(8), np.sqrt(2) / 1000)
    np.testing.assert_allclose(asymmetry.z[0, 1], (there.mean() - 1.2) / error)
