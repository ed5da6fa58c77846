"""Hot parts: where they are, the chance to meet them, and the directions drawn toward them."""

from dataclasses import replace
from math import cos, sin

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.emission.hot_parts import HotParts, darker, divided
from mi_lcair.plugins.paths.launch import Aim, Launch
from mi_lcair.plugins.recorders.channels import Channels

NARROW = {"type": "sandford_robertson", "epsilon": 0.2, "rho_d": 0.1, "b": 0.1, "e": 0.02}
BROAD = NARROW | {"e": 0.3}
LANES = 2**18


def parts(*spheres, axis=(0, 0, 0)):
    return HotParts([mi.Vector4f(sphere) for sphere in spheres], [mi.Vector3f(axis)] * 2)


def hit(tilt, lanes=LANES):
    """The origin of a level surface, seen at an angle to its normal [rad] from the side of -x."""
    si = dr.zeros(mi.SurfaceInteraction3f, lanes)
    si.sh_frame = mi.Frame3f(mi.Normal3f(0, 0, 1))
    si.n, si.wi = mi.Normal3f(0, 0, 1), mi.Vector3f(-sin(tilt), 0, cos(tilt))
    return si


def numbers(seed):
    rng = mi.PCG32(size=LANES, initstate=seed)
    return rng.next_float32(), mi.Point2f(rng.next_float32(), rng.next_float32())


def into(sphere, d):
    """Whether directions from the origin meet a sphere: by the distance of the nearest point."""
    *centre, radius = sphere
    d, centre = np.array(d), np.array(centre)
    along = centre @ d
    return (along > 0) & (centre @ centre - along**2 < radius**2)


def quadrature(bsdf, sphere, count=400):
    """Integral of BRDF times cosine over the solid angle of a sphere, by polar coordinates."""
    *centre, radius = sphere
    distance = np.linalg.norm(centre)
    depth = 1 - np.sqrt(1 - (radius / distance) ** 2)
    u, phi = np.meshgrid((np.arange(count) + 0.5) / count, 2 * np.pi * np.arange(count) / count)
    z, phi = 1 - depth * u.ravel(), phi.ravel()
    x, y = np.sqrt(1 - z**2) * np.array([np.cos(phi), np.sin(phi)])
    frame = mi.Frame3f(mi.Normal3f((np.array(centre) / distance).tolist()))
    value = bsdf.eval(mi.BSDFContext(), hit(0.6, 1), frame.to_world(mi.Vector3f(x, y, z)))[
        0
    ].numpy()
    return float(value.mean()) * 2 * np.pi * depth


def test_the_airliner_has_four_turbines():
    """Rings of 0.55 m radius at the engines, at the sides y = +-9.37 and +-19.25 m."""
    scene = mi_lcair.load("a340_landing", band="MWIR", emitter_sampling="false")
    with scene.prepared() as tracer:
        hot, emitters = HotParts.of(tracer.emitters), tracer.emitters
    spheres = np.array([np.ravel(sphere) for sphere in hot.spheres])
    assert sorted(spheres[:, 1]) == pytest.approx([-19.25, -9.37, 9.37, 19.25], abs=0.01)
    assert spheres[:, 3] == pytest.approx(0.55, rel=0.01)
    # They look back along the axis, which is pitched by 10 degrees
    back = [-np.cos(np.radians(10)), 0, -np.sin(np.radians(10))]
    assert np.ravel(hot.axes[0]) == pytest.approx(back, abs=1e-4)
    assert darker(emitters) == pytest.approx(emitters.brightest_of["plume"])


def test_a_single_panel_stays_one_part():
    corners = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0.0]]])
    assert len(divided(corners, np.ones((2, 3)))) == 1


@pytest.mark.parametrize("surface", [NARROW, BROAD])
@pytest.mark.parametrize("x", [3.0, 4.0])
def test_guided_directions_bring_what_the_surface_reflects(surface, x):
    """From a sphere beside the mirror direction, by quadrature, and from everywhere."""
    bsdf, si = mi.load_dict(surface), hit(0.6)
    sphere, other = (x, 0.3, 3.0, 0.2), (-1.0, 1.0, 2.0, 0.1)
    seen = parts(sphere, other).seen(si, bsdf, mi.Bool(True))
    assert dr.all(seen.share > 0)
    bs, weight = seen.sample(mi.BSDFContext(), si, bsdf, *numbers(3), mi.Bool(True))
    weight, met = weight[0].numpy().astype(float), into(sphere, bs.wo)
    expected = quadrature(bsdf, sphere)
    of_sphere = np.where(met, weight, 0)
    error = of_sphere.std() / np.sqrt(LANES)
    assert of_sphere.mean() == pytest.approx(expected, abs=4 * error)
    assert error < 0.02 * expected
    whole = float(bsdf.eval_diffuse_reflectance(si)[0][0])
    assert weight.mean() == pytest.approx(whole, abs=4 * weight.std() / np.sqrt(LANES))


def test_a_lobe_that_finds_the_part_is_not_guided():
    """The part is in the mirror direction, and larger than the lobe."""
    si, bsdf = hit(0.6), mi.load_dict(NARROW)
    mirror = 5 * np.array([np.sin(0.6), 0, np.cos(0.6)])
    seen = parts((*mirror.tolist(), 2.0)).seen(si, bsdf, mi.Bool(True))
    assert dr.all((seen.share == 0) & (seen.chance > 0.5))
    same, weight = bsdf.sample(mi.BSDFContext(), si, *numbers(3), mi.Bool(True))
    bs, guided = seen.sample(mi.BSDFContext(), si, bsdf, *numbers(3), mi.Bool(True))
    np.testing.assert_array_equal(bs.wo, same.wo)
    np.testing.assert_array_equal(guided, weight)


def test_a_part_that_looks_away_or_lies_below_has_no_chance():
    si, bsdf = hit(0.6), mi.load_dict(BROAD)
    above, below = (1.0, 0.0, 3.0, 0.2), (1.0, 0.0, -3.0, 0.2)
    for sphere, axis, is_seen in (
        (above, (0, 0, -1), 1),
        (above, (0, 0, 1), 0),
        (below, (0, 0, 1), 0),
    ):
        seen = parts(sphere, axis=axis).seen(si, bsdf, mi.Bool(True))
        assert bool(dr.all(seen.chance > 0)) == is_seen
        assert bool(dr.all(seen.share > 0)) == is_seen


def test_the_chance_is_that_of_the_lobe_where_the_part_is_small():
    """Density times solid angle; the sphere is so small that the density is constant in it."""
    si, bsdf = hit(0.6), mi.load_dict(BROAD)
    sphere = (1.0, 1.0, 3.0, 0.01)
    d = np.array(sphere[:3]) / np.sqrt(11)
    pdf = float(bsdf.pdf(mi.BSDFContext(), hit(0.6, 1), mi.Vector3f(d.tolist()))[0])
    chance = parts(sphere).seen(si, bsdf, mi.Bool(True)).chance
    assert chance.numpy()[0] == pytest.approx(pdf * np.pi * 1e-4 / 11, rel=0.02)


def test_a_furnace_stays_a_blackbody():
    """Rays are guided to two spheres in a room in which everything has one temperature."""
    scene = mi_lcair.load("furnace", emitter_sampling="false")
    aim = Aim.anywhere()
    hot = parts((0.9, 0.0, 0.0, 0.2), (-0.3, 0.6, 0.0, 0.1))
    with scene.prepared() as tracer:
        means = []
        for guided in (aim, replace(aim, hot=hot)):
            launch = Launch(1, 1, 5, randomisations=32, points=2**12, aim=guided)
            sums = tracer.trace(scene.sensor(0), launch, Channels("image"))
            means.append(sums.radiance[0] / sums.valid[0])
    assert np.std(means[1]) > 2 * np.std(means[0])  # the rays were guided
    expected = float(in_band_radiance(scene.band, 300))
    assert means[1].mean() == pytest.approx(expected, abs=4 * np.std(means[1]) / np.sqrt(32))


@pytest.mark.slow
def test_hot_reflections_need_few_paths(monkeypatch):
    """The airliner from the side, where nearly all noise is that of reflected turbines."""
    scene = mi_lcair.load("a340_landing", position=2, band="MWIR")
    results = [mi_lcair.signature(scene, tolerance=0.01, seed=seed) for seed in range(2)]
    monkeypatch.setattr(HotParts, "of", lambda emitters: None)
    plain = [mi_lcair.signature(scene, tolerance=0.01, seed=seed) for seed in range(2)]
    assert 3 * sum(r.paths for r in results) < sum(r.paths for r in plain)
    mean, of_plain = (np.mean([r.target.intensity for r in some]) for some in (results, plain))
    assert mean == pytest.approx(of_plain, rel=0.01)
