"""Triangles that overlap in one plane are found, and neighbours are not."""

import numpy as np
import pytest

from mi_lcair.coincident import overlaps
from tests.calls import calls_of

SQUARE = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], float)
OTHER_DIAGONAL = np.array([[[0, 0, 0], [0, 1, 0], [1, 0, 0]], [[1, 0, 0], [0, 1, 0], [1, 1, 0]]])


def turned(corners, seed):
    """The corners in another place, to single precision."""
    chance = np.random.default_rng(seed)
    rotation = np.linalg.qr(chance.normal(size=(3, 3)))[0]
    return (corners @ rotation.T + chance.uniform(-5, 5, 3)).astype(np.float32).astype(float)


def counts(corners):
    found = overlaps(corners)
    return len(found.back_to_back), len(found.same_side)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    "second, expected",
    [
        (SQUARE, (0, 2)),
        (SQUARE[:, ::-1], (2, 0)),
        (OTHER_DIAGONAL, (4, 0)),
        (SQUARE + [0.7, 0.2, 0], (0, 3)),
        (SQUARE * 0.1 + [0.4, 0.2, 0], (0, 2)),
        (SQUARE + [1, 0.3, 0], (0, 0)),  # they share a part of an edge
        (SQUARE + [1, 1, 0], (0, 0)),  # a corner
        (SQUARE + [0, 0, 0.001], (0, 0)),
        (SQUARE[..., [0, 2, 1]], (0, 0)),  # at a right angle, along an edge
    ],
)
def test_two_squares(second, expected, seed):
    assert counts(turned(np.concatenate([SQUARE, second]), seed)) == expected


def test_the_sides_of_a_small_box_in_a_large_model_are_apart():
    """Two sides at 1e-5 of the model's extent, and a copy of one of them."""
    box = 0.01 * np.concatenate([SQUARE, SQUARE[:, ::-1] + [0, 0, 0.5]])
    far = SQUARE + [1000.0, 0, 0]
    assert counts(np.concatenate([box, far])) == (0, 0)
    assert counts(np.concatenate([box, far, box[:2]])) == (0, 2)


def test_numbers():
    """Pairs are numbered as the triangles are."""
    corners = np.concatenate([SQUARE, SQUARE + [5, 0, 0], SQUARE[1:, ::-1]])
    assert overlaps(corners).back_to_back.tolist() == [[1, 4]]


@pytest.mark.parametrize("corners", [np.empty((0, 3, 3)), SQUARE[:1], np.zeros((3, 3, 3))])
def test_nothing_to_compare(corners):
    assert counts(corners) == (0, 0)


def grid(n):
    """2 n^2 triangles over a unit square."""
    x, y = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    return np.concatenate(
        [half + np.stack([x, y, 0 * x], axis=-1).reshape(-1, 1, 3) for half in SQUARE]
    ) / [n, n, 1]


def test_planes_at_the_limits():
    """Planes are one up to 8 parts in a million of the extent, and up to a tilt of 8e-5.

    The extent is 100 times the squares', so that a shift does not tilt them.
    """
    far = SQUARE[:1] + [99, 99, 0]
    for shift, expected in ((2e-4, 2), (2e-3, 0)):
        assert counts(np.concatenate([SQUARE, SQUARE + [0, 0, shift], far])) == (0, expected)
    for tilt, expected in ((3e-6, 2), (2e-4, 0)):
        other = SQUARE.copy()
        other[..., 2] = tilt * (other[..., 0] - 0.5)
        assert counts(np.concatenate([SQUARE, other])) == (0, expected)


@pytest.mark.parametrize("places", [(0.0,), (0.0, 1.0), (0.0, 1.0, 2.0)])
def test_many_triangles_against_a_direct_search(places):
    """Overlaps of 60 random triangles in parallel planes: pairs that an edge does not separate."""
    chance = np.random.default_rng(len(places))
    flat = chance.uniform(0, 0.4, (60, 3, 2)) + chance.uniform(0, 1, (60, 1, 2)) * [0.5, 2]
    height = chance.choice(places, 60)
    corners = np.concatenate([flat, np.repeat(height[:, None, None], 3, axis=1)], axis=2)
    edges = np.roll(flat, -1, axis=1) - flat
    turn = np.sign(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0])

    def apart(a, b):
        """Whether an edge of a has all corners of b on its outer side."""
        to = flat[b][None] - flat[a][:, None]
        side = edges[a][:, None, 0] * to[..., 1] - edges[a][:, None, 1] * to[..., 0]
        return (side * turn[a] <= 0).all(axis=1).any()

    expected = {
        (a, b)
        for a in range(60)
        for b in range(a + 1, 60)
        if height[a] == height[b] and not apart(a, b) and not apart(b, a)
    }
    found = overlaps(corners[..., [2, 0, 1]])
    assert {tuple(pair) for pair in found.same_side} == {
        (a, b) for a, b in expected if turn[a] == turn[b]
    }
    assert {tuple(pair) for pair in found.back_to_back} == {
        (a, b) for a, b in expected if turn[a] != turn[b]
    }


@pytest.mark.slow
def test_tessellations_have_none():
    """Flat and curved, and the six sides of a cube."""
    flat = grid(60)
    curved = flat.copy()
    curved[..., 2] = 0.3 * np.sin(7 * flat[..., 0]) * np.cos(5 * flat[..., 1])
    cube = np.concatenate(
        [
            side + shift
            for side in (flat, flat[..., [2, 0, 1]], flat[..., [1, 2, 0]])
            for shift in (0, [1, 1, 1])
        ]
    )
    for corners in (flat, curved, cube, turned(flat, 1), turned(curved, 2)):
        assert counts(corners) == (0, 0)


@pytest.mark.slow
def test_random_triangles_against_a_direct_search():
    """Overlaps of 300 triangles in a few planes, by shared points of a fine grid."""
    chance = np.random.default_rng(3)
    flat = chance.uniform(0, 1, (300, 3, 2)) * 0.3 + chance.uniform(0, 1, (300, 1, 2))
    height = chance.integers(0, 3, 300)
    corners = np.concatenate([flat, np.repeat(height[:, None, None] / 3.0, 3, axis=1)], axis=2)
    found = overlaps(corners)
    found = {tuple(pair) for pair in np.concatenate([found.back_to_back, found.same_side])}
    points = np.stack(np.meshgrid(*[np.linspace(0, 1.3, 200)] * 2), axis=-1).reshape(-1, 2)
    edges = np.roll(flat, -1, axis=1) - flat
    side = edges[:, :, None, 0] * (points[:, 1] - flat[:, :, None, 1]) - edges[:, :, None, 1] * (
        points[:, 0] - flat[:, :, None, 0]
    )
    inside = ((side > 0).all(axis=1) | (side < 0).all(axis=1)).astype(float)
    shared = np.triu((inside @ inside.T > 0) & (height[:, None] == height), 1)
    assert {tuple(pair) for pair in np.argwhere(shared)} <= found
    assert len(found) < 1.3 * shared.sum()  # those that share less than a point of the grid


@pytest.mark.parametrize("stretch", [(1, 1, 1), (0.1, 5, 1), (5, 0.1, 1)])
def test_large_planes(stretch):
    """Ten copies among 3200 triangles, and a square over 20 x 20 cells of two triangles each."""
    flat = grid(40)
    assert counts(flat * stretch) == (0, 0)
    for more, expected in (
        (flat[500:510, ::-1], (10, 0)),
        (SQUARE * 0.5 + [0.2, 0.2, 0], (0, 800)),
        (SQUARE[:, ::-1] * [0.5, 0.5, 1], (800, 0)),
    ):
        assert counts(np.concatenate([flat, more]) * stretch) == expected


def test_planes_that_are_nearly_parallel():
    """A tilt of 1e-3 is seen, and one of 1e-8 is none."""
    for tilt, expected in ((1e-3, (0, 0)), (1e-8, (0, 2))):
        other = SQUARE.copy()
        other[..., 2] = tilt * (other[..., 0] - 0.3)
        assert counts(np.concatenate([SQUARE, other])) == expected


def test_many_triangles():
    """20,000 triangles, flat and curved: by arrays, not pair by pair."""
    flat = grid(100)
    curved = flat.copy()
    curved[..., 2] = np.sin(7 * flat[..., 0])
    for corners in (flat, curved):
        assert calls_of(overlaps, corners) < 10_000
