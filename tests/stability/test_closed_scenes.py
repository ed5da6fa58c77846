"""Closed scenes of reflectance 0.999 and 1.

The number of reflections that they need, and the conservation of energy.
"""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from docs.studies.leaks import LAMP, cube, lost
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.derivatives import members
from mi_lcair.plugins.emission.emitter_table import EmitterTable


def share(folder, reflectance, max_bounces, closure="none", spp=4, seed=0):
    """Render the cube; return the image and its mean radiance divided by the blackbody's."""
    scene = cube(folder, reflectance=reflectance, max_bounces=max_bounces, closure=closure)
    result = mi_lcair.render(scene, spp=spp, seed=seed)
    return result, result.mean / float(in_band_radiance(scene.band, 300))


@pytest.mark.slow
@pytest.mark.parametrize("bounces", [10, 100, 1000, pytest.param(4000, marks=pytest.mark.study)])
def test_geometric_law(tmp_path, bounces):
    """The radiance after N reflections is 1 - rho^(N + 1) of its limit.

    With rho = 0.999 it is 99 % after 4603 reflections and 1 % after 10. All paths have the same
    radiance. A deviation is therefore rounding or a lost path.
    """
    result, fraction = share(tmp_path, 0.999, bounces)
    assert fraction == pytest.approx(1 - 0.999 ** (bounces + 1), rel=1e-3)
    assert result.invalid == 0


def test_tail(tmp_path):
    """The closure `tail` is exact except for rounding.

    It multiplies the rounding of rho by 1 / (1 - rho) = 1000.
    """
    result, fraction = share(tmp_path, 0.999, 10, "tail")
    assert fraction == pytest.approx(1, abs=2e-3)
    assert abs(fraction - 1) <= 3 * result.closure_error / result.mean


def test_reflectance_one(tmp_path):
    """Without emission the image is black for every N, and has no NaN.

    This includes closure = tail, which is 0 / 0.
    """
    for bounces, closure in ((100, "none"), (10, "tail")):
        result, fraction = share(tmp_path, 1, bounces, closure)
        assert fraction == 0 and result.invalid == 0


@pytest.mark.slow
def test_energy_balance(tmp_path):
    """With rho = 1 and a lamp on one of six faces, each reflection adds the same radiance.

    The flux of the lamp is spread over all faces and none is lost. Each reflection therefore adds a
    sixth of the lamp's radiance.
    """
    scene = cube(tmp_path, reflectance=1, max_bounces=32, walls="", lid=LAMP)
    channels = mi_lcair.render(scene, spp=512, parts=True).channels
    added = [channels[f"bounce{k:02d}.Y"].mean(dtype=float) for k in range(17)]
    # The last channel holds the reflections from the 16th to the 32nd
    assert np.mean([*added[8:16], added[16] / 17]) == pytest.approx(1 / 6, rel=0.01)
    assert added[16] / 17 == pytest.approx(np.mean(added[8:12]), rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["furnace", "cylinder_ir_range"])
def test_no_ray_escapes(name):
    """Of a million rays none escapes; `python -m docs.studies.leaks` traces 1e8.

    One ray in 1e7 hits the outline of a body exactly in the edge between a front and a back. Embree
    may then return the back, which is black.
    """
    rays, escaped, back = lost(mi_lcair.load(name), 100_000)
    assert rays > 900_000 and escaped == 0 and back <= 2


def test_rays_at_the_very_edges_of_facets():
    """Of 500,000 rays at points on the edges and diagonals of the furnace's room none escapes.

    Without Embree's robust mode 0.5 % escape.
    """
    scene = mi_lcair.load("furnace").mi
    room = next(members(shape) for shape in scene.shapes() if shape.bbox().max.x > 0.99)
    corners = room["vertex_positions"].numpy().reshape(-1, 3)[room["faces"].numpy().reshape(-1, 3)]
    rng, count = np.random.default_rng(0), 500_000
    facet, side, share = (
        rng.integers(len(corners), size=count),
        rng.integers(3, size=count),
        rng.random((count, 1)),
    )
    target = corners[facet, side] * (1 - share) + corners[facet, side - 1] * share
    origin = 0.1 * rng.random((count, 3)) - [0.05, 0.45, 0.05]
    towards = (target - origin) / np.linalg.norm(target - origin, axis=1, keepdims=True)
    si = scene.ray_intersect(
        mi.Ray3f(mi.Point3f(np.float32(origin).T), mi.Vector3f(np.float32(towards).T))
    )
    assert dr.all(si.is_valid())


@pytest.mark.slow
@pytest.mark.parametrize("half", [1e-6, 1, 1e4])
def test_no_ray_escapes_from_a_cube_of_any_size(tmp_path, half):
    rays, escaped, back = lost(cube(tmp_path, half), 100_000)
    assert rays > 990_000 and (escaped, back) == (0, 0)


def test_a_ray_that_starts_in_the_edge_of_two_walls(tmp_path):
    """After a hit exactly in the edge between two walls, the next ray hits another wall.

    The edge is x = -1, z = 1, and the rays come from the middle. It does not matter which of the
    two walls is hit.
    """
    scene = cube(tmp_path)
    rng = np.random.default_rng(0)
    y = mi.Float(rng.uniform(-0.9, 0.9, 1000))
    si = scene.mi.ray_intersect(mi.Ray3f(mi.Point3f(0, y, 0), dr.normalize(mi.Vector3f(-1, 0, 1))))
    si.p = mi.Point3f(-1, y, 1)
    wo = mi.warp.square_to_cosine_hemisphere(
        mi.Point2f(mi.Float(rng.random(1000)), mi.Float(rng.random(1000)))
    )
    following = scene.mi.ray_intersect(EmitterTable(scene.mi, False).spawn_ray(si, si.to_world(wo)))
    assert dr.all(following.is_valid() & (following.wi.z > 0) & (following.t > 0))
