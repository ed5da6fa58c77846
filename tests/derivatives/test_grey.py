"""The derivative with respect to the emissivity of a grey surface is whole: it holds the emitted
and the reflected radiance."""

import pytest

import mi_lcair
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.rendering.parameters.values import set_values
from tests.derivatives.grey_room import NAMED, NUMBER, SECOND, load


@pytest.mark.slow
@pytest.mark.parametrize("material", [NAMED, NUMBER])
@pytest.mark.parametrize("emissivity", [0, 0.08, 0.92, 1])
def test_plate_in_a_black_room(tmp_path, material, emissivity):
    """I = A (epsilon L(T) + (1 - epsilon) L(T_room)) in a window of A = 1 m^2 on the plate."""
    scene, name = load(tmp_path, material, emissivity)
    hot, cold = (in_band_radiance(scene.band, T) for T in (310, 260))
    result = mi_lcair.sensitivities(scene, [name], spp=64)
    exact = emissivity * hot + (1 - emissivity) * cold
    assert result.value == pytest.approx(exact, rel=1e-3)
    assert result.derivative[0] == pytest.approx(hot - cold, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("emissivity", [0.3, 0.85])
def test_corner_of_two_plates(tmp_path, emissivity):
    """The plates reflect each other. Central differences on the same paths."""
    scene, name = load(tmp_path, NUMBER, emissivity, second=SECOND)
    slope = mi_lcair.sensitivities(scene, [name], spp=1024).derivative[0]
    intensity, step = {}, 0.01
    for sign in (-1, 1):
        set_values(scene, {name: emissivity + sign * step})
        intensity[sign] = mi_lcair.sensitivities(scene, [name], spp=1024).value
    assert slope == pytest.approx((intensity[1] - intensity[-1]) / (2 * step), rel=1e-3)
