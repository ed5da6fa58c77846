"""A replay reads the hits of the pass before, and its derivatives are those of the closed form."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.columns import control
from mi_lcair.plugins.emission.emitter_table import EmitterTable
from mi_lcair.plugins.paths import kept_hits, path_tracer
from mi_lcair.plugins.paths.path_tracer import PathTracer
from mi_lcair.plugins.paths.sheets import nearest_hit
from mi_lcair.plugins.paths.walk import Walk

KEY = "floor.bsdf.emissivity"
VIEW_FACTOR = 0.24063600617696168  # from the floor of open_box to its wall, see scenes/open_box.xml


def gradients(emitter_sampling: str, seeds=4) -> np.ndarray:
    """Derivative of the intensity of open_box with respect to the floor's emissivity, by seed."""
    scene = mi_lcair.load("open_box", resolution=16, emitter_sampling=emitter_sampling)
    parameters, found = mi.traverse(scene.mi), []
    for seed in range(seeds):
        dr.enable_grad(parameters[KEY])
        parameters.set_dirty(KEY)
        parameters.update()
        dr.backward(dr.mean(mi.render(scene.mi, parameters, spp=64, seed=seed), axis=None))
        found.append(dr.grad(parameters[KEY])[0] * 0.16**2)
        dr.disable_grad(parameters[KEY])
    return np.array(found)


def blind(scene, sheets, ray, coherent=False, active=True):
    return nearest_hit(scene, sheets, ray, coherent, False)


def again(*arguments):
    pytest.fail("a direction is drawn again")


@pytest.mark.slow
@pytest.mark.parametrize("emitter_sampling", ["true", "false"])
def test_replay_traces_no_ray_again(monkeypatch, emitter_sampling):
    """The replay is blind, but for the hits that it reads. A grey floor needs no pilot."""
    sample = PathTracer.sample

    def blind_replay(tracer, mode, **arguments):
        with monkeypatch.context() as patch:
            if mode != dr.ADMode.Primal:
                for module in (kept_hits, path_tracer):
                    patch.setattr(module, "nearest_hit", blind)
                patch.setattr(EmitterTable, "draw", again)
            return sample(tracer, mode, **arguments)

    monkeypatch.setattr(PathTracer, "sample", blind_replay)
    monkeypatch.setattr(control, "pilot_launch", lambda *arguments: pytest.fail("pilot"))
    found = gradients(emitter_sampling)
    hot, cold = in_band_radiance(band("total"), dr.llvm.ad.Float64(800.0, 300.0)).numpy()
    exact = np.sqrt(0.5) * 0.02 * (cold - VIEW_FACTOR * hot)
    error = found.std(ddof=1) / np.sqrt(len(found))
    assert error < 0.02 * abs(exact) and abs(found.mean() - exact) < 5 * error + 1e-3 * abs(exact)


@pytest.mark.slow
def test_some_hits_are_kept(monkeypatch):
    """Where there is room for two of the three rays of a path, the replay traces the third one."""
    whole = gradients("true", seeds=1)
    monkeypatch.setattr(kept_hits, "MOST_BYTES", 2 * kept_hits.OF_HIT * 16**2 * 64)
    np.testing.assert_allclose(gradients("true", seeds=1), whole, rtol=1e-5)


@pytest.mark.slow
def test_the_last_reflection_needs_no_reflected_ray(monkeypatch):
    """In open_box, what arrives at the only reflection is what the drawn rays bring."""
    scene = mi_lcair.load("open_box", resolution=8, spp=64, emitter_sampling="true").mi
    image, nearest = np.array(mi.render(scene)), Walk.nearest

    def without_reflected(walk, path, hit, kind, ray, active):
        return nearest(walk, path, hit, kind, ray, active & (kind > 0))

    monkeypatch.setattr(Walk, "nearest", without_reflected)
    np.testing.assert_allclose(mi.render(scene), image, rtol=1e-5)


def test_a_packet_draws_at_every_eighth_reflection(monkeypatch):
    """A walled room: each packet of 16 paths draws at one of 8 reflections, an eighth at each."""
    found, walk = [], Walk.walk

    def walking(paths, *arguments, **named):
        found.append([paths.draws_at(mi.UInt32(k)).numpy() for k in range(8)])
        return walk(paths, *arguments, **named)

    monkeypatch.setattr(Walk, "walk", walking)
    scene = mi_lcair.load("cavity", resolution=8, emitter_sampling="true", max_bounces=1)
    mi.render(scene.mi, spp=64)
    draws = np.reshape(found[0], (8, -1, 16))
    assert np.all(draws == draws[..., :1]) and np.all(draws.sum(axis=0) == 1)
    assert draws.mean(axis=(1, 2)) == pytest.approx(1 / 8)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["open_box", "cavity"])
def test_fewer_rays_give_the_same_image(name):
    """The mean radiance with drawn emitters is that without them, for two reflections."""
    means = []
    for draws in ("true", "false"):
        scene = mi_lcair.load(name, resolution=16, emitter_sampling=draws, max_bounces=2).mi
        means.append([np.mean(mi.render(scene, spp=256, seed=seed)) for seed in range(8)])
    means = np.array(means)
    error = np.hypot(*means.std(axis=1, ddof=1)) / np.sqrt(8)
    assert error < 1e-3 * means.mean()
    assert abs(np.diff(means.mean(axis=1))[0]) < 4 * error
