"""The control variate of path replay: unbiased, and much less noise for narrow lobes."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.plugins.paths import path_tracer
from tests.derivatives.dark_scenes import plate
from tests.matrix import some_of

mi.set_variant("llvm_ad_mono")
SEEDS = 8


def gradients(scene, keys) -> np.ndarray:
    """Derivatives of the mean radiance by `dr.backward`, (SEEDS, keys)."""
    parameters, found = mi.traverse(scene), []
    for seed in range(SEEDS):
        for key in keys:
            dr.enable_grad(parameters[key])
            parameters.set_dirty(key)
        parameters.update()
        image = mi.render(scene, parameters, spp=32, seed=seed)
        dr.backward(dr.mean(image, axis=None))
        found.append([float(np.ravel(dr.grad(parameters[key]))[0]) for key in keys])
        for key in keys:
            dr.disable_grad(parameters[key])
    return np.array(found)


def without_control(monkeypatch, scene, keys) -> np.ndarray:
    with monkeypatch.context() as patch:
        patch.setattr(path_tracer, "control_of", lambda *arguments: None)
        return gradients(scene, keys)


@pytest.mark.slow
@pytest.mark.parametrize("e", some_of([0.004, 0.01, 0.03], 3))
def test_gloss_black_under_a_sky(tmp_path, monkeypatch, e):
    """The incoming radiance is constant, so that nearly all noise of the score of `e` cancels."""
    case = plate("sandford_robertson", (0.88, 0.00075, 0.16, e), 3, 300.0, 280.0)
    path = tmp_path / "plate.xml"
    path.write_text(case.text)
    scene = mi_lcair.load(path).mi
    controlled = gradients(scene, [case.key])[:, 0]
    plain = without_control(monkeypatch, scene, [case.key])[:, 0]
    error = controlled.std(ddof=1) / np.sqrt(SEEDS)
    assert abs(controlled.mean() - case.derivative) < 5 * error + 2e-3 * abs(case.derivative)
    assert plain.var() > 1000 * controlled.var()


@pytest.mark.slow
@pytest.mark.parametrize("emitter_sampling", some_of([True, False], 2))
def test_uneven_surroundings(corner, monkeypatch, emitter_sampling):
    """The same means as without it, also for surfaces that reflect each other and are drawn."""
    integrator = {"type": "bounce_path", "max_bounces": 3, "emitter_sampling": emitter_sampling}
    scene = corner(integrator, {"epsilon": 0.5, "rho_d": 0.1, "b": 0.2, "e": 0.02})
    keys = [f"floor.bsdf.{name}" for name in ("epsilon", "rho_d", "b", "e")]
    controlled = gradients(scene, keys)
    plain = without_control(monkeypatch, scene, keys)
    errors = np.hypot(controlled.std(axis=0, ddof=1), plain.std(axis=0, ddof=1)) / np.sqrt(SEEDS)
    assert np.all(np.abs(controlled.mean(axis=0) - plain.mean(axis=0)) < 5 * errors)
    assert np.all(errors > 0)
