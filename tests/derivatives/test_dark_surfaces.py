"""Derivatives at surfaces that reflect or transmit nothing, against closed forms."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from tests.derivatives.dark_scenes import DarkScene, dark_scenes
from tests.matrix import some_of

mi.set_variant("llvm_ad_mono")
SCENES = dark_scenes()
ROUNDING = 1e-5  # of a radiance in Float32 [W m^-2 sr^-1], relative to 40 W m^-2 sr^-1
SEEDS = 4


@pytest.fixture(scope="module")
def load(tmp_path_factory):
    folder = tmp_path_factory.mktemp("dark")

    def loaded(case: DarkScene):
        path = folder / "scene.xml"
        path.write_text(case.text)
        return mi_lcair.load(path)

    return loaded


def backward(scene, key: str) -> np.ndarray:
    """Derivatives of the mean radiance by `dr.backward`, for each seed, (SEEDS,)."""
    parameters = mi.traverse(scene.mi)
    found = []
    for seed in range(SEEDS):
        dr.enable_grad(parameters[key])
        parameters.set_dirty(key)
        parameters.update()
        image = mi.render(scene.mi, parameters, spp=64, seed=seed)
        dr.backward(dr.mean(image, axis=None))
        found.append(float(np.ravel(dr.grad(parameters[key]))[0]))
        dr.disable_grad(parameters[key])
    return np.array(found)


def estimates(scene, case: DarkScene) -> dict[str, tuple[float, float]]:
    """The derivative and its standard error by each of three ways [W m^-2 sr^-1]."""
    area = 0.8**2  # of the window [m^2]
    intensity = mi_lcair.sensitivities(scene, [case.name], paths=2**12, seed=1)
    images = mi_lcair.derivative_images(scene, [case.name], spp=64)
    in_images, gradients = images.derivatives.mean(axis=(1, 2, 3)), backward(scene, case.key)
    scatter = lambda values: (values.mean(), values.std(ddof=1) / np.sqrt(len(values)))
    return {
        "sensitivities": (intensity.derivative[0] / area, intensity.error[1] / area),
        "derivative_images": scatter(in_images),
        "backward": scatter(gradients),
    }


@pytest.mark.slow
@pytest.mark.parametrize("case", some_of(SCENES, 3), ids=[case.label for case in SCENES])
def test_closed_forms(load, case):
    """Four randomisations scatter by Student's distribution: 5.8 errors for one in a hundred."""
    scene = load(case)
    for way, (value, error) in estimates(scene, case).items():
        assert abs(value - case.derivative) < 6 * error + 40 * ROUNDING, (way, value, error)


def test_directions_drawn_toward_emitters_agree():
    """A black plate before another: the derivative with and without emitter sampling."""
    (drawn, drawn_error), (other, error) = (
        (result.derivative[0], result.error[1])
        for result in (
            mi_lcair.sensitivities(
                mi_lcair.load("two_plates", resolution=16, emitter_sampling=sampling),
                ["blackbody.emissivity"],
                spp=256,
            )
            for sampling in ("true", "false")
        )
    )
    assert abs(drawn - other) < 6 * np.hypot(drawn_error, error) < 0.1 * other
