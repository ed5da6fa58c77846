"""A replay reads the hits of the pass before, and its derivatives are those of the closed form."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.columns import control
from mi_lcair.plugins.paths import kept_hits
from mi_lcair.plugins.paths.sheets import nearest_hit

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


@pytest.mark.slow
@pytest.mark.parametrize("emitter_sampling", ["true", "false"])
def test_replay_traces_no_ray_again(monkeypatch, emitter_sampling):
    """The replay is blind, but for the hits that it reads. A grey floor needs no pilot."""
    end = kept_hits.KeptHits.end

    def then_blind(kept, state):
        end(kept, state)
        monkeypatch.setattr(kept_hits, "nearest_hit", blind)

    begin = kept_hits.KeptHits.begin

    def then_seeing(kept, paths):
        monkeypatch.setattr(kept_hits, "nearest_hit", nearest_hit)
        begin(kept, paths)

    monkeypatch.setattr(kept_hits.KeptHits, "end", then_blind)
    monkeypatch.setattr(kept_hits.KeptHits, "begin", then_seeing)
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
