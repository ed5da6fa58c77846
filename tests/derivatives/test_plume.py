"""The transmittance of a plume as a parameter: its column against a closed form and differences."""

import pytest

import mi_lcair
from docs.studies.differences import differences
from mi_lcair.api.scenes import parameters
from mi_lcair.derivatives.images import facet_matrix
from mi_lcair.errors import InputError
from mi_lcair.rendering.parameters.values import changed, set_values

LANDING = {"position": 3, "band": "LWIR", "plume_transmittance": 0.7}


def test_column_agrees_with_differences():
    """Also for the plume's temperature, whose radiance passes other plumes.

    Both trace the same paths, in whose radiance a transmittance is a polynomial of low degree.
    """
    scene = mi_lcair.load("a340_landing", **LANDING)
    names = ("plume.transmittance", "plume.temperature")
    found = mi_lcair.sensitivities(scene, names, paths=2**12, seed=1)
    expected = differences(scene, names, [0.01, 1.0], paths=2**12, seed=1)
    assert found.derivative == pytest.approx(expected.derivative, rel=1e-3)
    assert found.derivative[0] < 0 < found.derivative[1]


def test_parameter_and_refusals():
    opaque = mi_lcair.load("a340_landing", position=3)
    with opaque.prepared() as tracer:
        assert not tracer.emitters.passes
    scene = mi_lcair.load("a340_landing", **LANDING)
    found = parameters(scene)["plume.transmittance"]
    assert (found.value, found.lower, found.upper) == (pytest.approx(0.7), 0, 1)
    with changed(scene, {"plume.transmittance": 0}), scene.prepared() as tracer:
        assert not tracer.emitters.passes
    with pytest.raises(InputError, match="outside its bounds"):
        set_values(scene, {"plume.transmittance": 1.5})
    drawn = mi_lcair.load("a340_landing", emitter_sampling="true", **LANDING)
    with pytest.raises(InputError, match="plume.transmittance has no derivative where"):
        mi_lcair.sensitivities(drawn, ["plume.transmittance"], paths=2**10)


def test_the_derivative_of_an_opaque_plume():
    """A ray crosses two walls of the closed plume: L(0) - L(tau) is proportional to tau^2."""
    scene, name = mi_lcair.load("a340_landing", position=3, band="LWIR"), "plume.transmittance"
    slopes = {}
    for tau in (0, 0.01, 0.02):
        with changed(scene, {name: tau}):
            slopes[tau] = mi_lcair.sensitivities(scene, [name], paths=2**14, seed=1).derivative[0]
    assert slopes[0] == 0 > slopes[0.01]
    assert slopes[0.02] == pytest.approx(2 * slopes[0.01], rel=1e-3)


def test_facets_have_no_columns_behind_a_plume():
    scene = mi_lcair.load("a340_landing", resolution=8, **LANDING)
    with pytest.raises(InputError, match="BSDF plume .* has no contributions by facet"):
        facet_matrix(scene, groups=["plume"], spp=4)
