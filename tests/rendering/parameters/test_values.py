"""Parameters of loaded scenes by name: what they are, how they change, and that they come back."""

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.api.scenes import parameters
from mi_lcair.errors import InputError
from mi_lcair.rendering.parameters.values import changed, parameter, set_values

mi.set_variant("llvm_ad_mono")


def everything(scene) -> dict[str, bytes]:
    """All values of all parameters of Mitsuba's scene, bit for bit."""
    return {
        name: np.array(value).tobytes()
        for name, value in mi.traverse(scene.mi)
        if hasattr(value, "__array__")
    }


def facet_temperatures(scene, group):
    return np.concatenate(
        [
            np.array(mi.traverse(shape)["face_temperature"])
            for shape in scene.mi.shapes()
            if shape.emitter().group == group
        ]
    )


@pytest.fixture(scope="module")
def cylinder():
    return mi_lcair.load("cylinder_ir_range", finish="gloss_black", resolution=8)


@pytest.fixture(scope="module")
def landing():
    return mi_lcair.load("a340_landing", resolution=8)


def test_names_units_and_kinds(cylinder, landing):
    listed = parameters(landing)
    assert [name for name in listed if listed[name].kind != "motion"] == [
        "sky.radiance",
        "hot_parts.temperature",
        "plume.temperature",
        "self.temperature",
        "terrain.temperature",
        "blackbody.emissivity",
        "plume.transmittance",
        *(f"bare_aluminum.{p}" for p in ("epsilon", "rho_d", "b", "e")),
    ]
    found = parameters(cylinder)
    assert {"walls@253.temperature", "walls@263.temperature"} < set(found)
    assert found["walls.temperature"].value == pytest.approx(258, abs=1e-3)  # equal areas
    assert (found["walls.temperature"].kind, found["walls.temperature"].unit) == (
        "temperature",
        "K",
    )
    epsilon = found["gloss_black.epsilon"]
    assert (epsilon.kind, epsilon.unit, epsilon.value) == ("material", "1", pytest.approx(0.88))
    assert epsilon.lower == 0 and 0.88 < epsilon.upper < 1
    assert parameters(landing)["sky.radiance"].unit == "W m^-2 sr^-1"


def test_stock_diffuse():
    scene = mi_lcair.load("cavity")
    assert parameter(scene, "diffuse.reflectance").value == 0.5
    set_values(scene, {"diffuse.reflectance": 0.25})
    assert parameter(scene, "diffuse.reflectance").value == 0.25
    with pytest.raises(InputError, match="diffuse.reflectance = 1.5 .* 0..1"):
        set_values(scene, {"diffuse.reflectance": 1.5})


def test_a_groups_temperature_shifts_all(cylinder):
    before = facet_temperatures(cylinder, "walls")
    mean = parameter(cylinder, "walls.temperature").value
    with changed(cylinder, {"walls.temperature": mean + 2.5}):
        np.testing.assert_allclose(facet_temperatures(cylinder, "walls"), before + 2.5, atol=1e-4)
        assert parameter(cylinder, "walls.temperature").value == pytest.approx(mean + 2.5, abs=1e-4)
        assert parameter(cylinder, "walls@263.temperature").value == pytest.approx(265.5, abs=1e-4)
    np.testing.assert_array_equal(facet_temperatures(cylinder, "walls"), before)


def test_one_temperature_of_a_group(cylinder):
    before = facet_temperatures(cylinder, "self")
    with changed(cylinder, {"self@298.2.temperature": 310.0}):
        now = facet_temperatures(cylinder, "self")
        np.testing.assert_array_equal(now[before == np.float32(298.2)], 310.0)
        np.testing.assert_array_equal(now != before, before == np.float32(298.2))
        # The name stays, although no facet has this temperature now
        assert parameter(cylinder, "self@298.2.temperature").value == 310.0
        with changed(cylinder, {"self@298.2.temperature": 320.0}):
            assert facet_temperatures(cylinder, "self").max() == 320
        np.testing.assert_array_equal(facet_temperatures(cylinder, "self"), now)


def test_radiances_of_several_sources_keep_their_ratios(landing):
    rings = lambda: np.array(
        [s.emitter().radiance[0] for s in landing.mi.shapes() if s.emitter().group == "sky"]
    )
    before, mean = rings(), parameter(landing, "sky.radiance").value
    assert len(before) == 10 and before.min() < mean < before.max()
    with changed(landing, {"sky.radiance": 1.1 * mean}):
        np.testing.assert_allclose(rings() / before, 1.1, rtol=1e-6)
    np.testing.assert_array_equal(rings(), before)


def test_everything_is_restored_bit_for_bit(cylinder):
    """Also after an error inside the context."""
    before, fingerprint = everything(cylinder), cylinder.fingerprint
    values = {
        "gloss_black.epsilon": 0.5,
        "self.temperature": 301.23,
        "walls@263.temperature": 270.0,
    }
    with pytest.raises(RuntimeError), changed(cylinder, values):
        assert everything(cylinder) != before and cylinder.fingerprint != fingerprint
        raise RuntimeError
    assert everything(cylinder) == before and cylinder.fingerprint == fingerprint


def test_changes_reach_the_image(cylinder):
    image = lambda: mi_lcair.render(cylinder, spp=4).channels["Y"]
    before = image()
    for values in (
        {"gloss_black.epsilon": 0.5},
        {"self.temperature": 320.0},
        {"self@298.2.temperature": 340.0},
    ):
        with changed(cylinder, values):
            assert np.abs(image() / before - 1).max() > 0.01
    np.testing.assert_array_equal(image(), before)


def test_two_parameters_of_one_material_are_checked_together(cylinder):
    """epsilon + rho_d has a bound, so that one of them may grow only if the other shrinks."""
    with pytest.raises(InputError, match="epsilon . rho_d"):
        set_values(cylinder, {"gloss_black.rho_d": 0.5})
    with changed(cylinder, {"gloss_black.rho_d": 0.5, "gloss_black.epsilon": 0.2}):
        assert parameter(cylinder, "gloss_black.rho_d").value == 0.5


@pytest.mark.parametrize(
    "values, message",
    [
        (
            {"gloss_blak.e": 0.1},
            "unknown parameter of cylinder_ir_range 'gloss_blak.e'; known: gloss",
        ),
        ({"self.temperature": -10.0}, "self.temperature = -10 is outside its bounds"),
        ({"self.temperature": float("nan")}, "self.temperature = nan is outside its bounds"),
        ({"gloss_black.e": 0.0}, "material gloss_black: sandford_robertson: e = 0"),
        (
            {"self.temperature": 300.0, "self@298.2.temperature": 300.0},
            "'self.temperature' and 'self@298.2.temperature' change the same numbers",
        ),
    ],
)
def test_unusable_values_change_nothing(cylinder, values, message):
    before = everything(cylinder)
    with pytest.raises(InputError, match=message.replace(".", r"\.")):
        set_values(cylinder, {"walls.temperature": 250.0, **values})
    assert everything(cylinder) == before


def test_bounds_are_what_set_values_takes(cylinder):
    for entry in parameters(cylinder).values():
        inside = {
            entry.name: 0.5 * (min(entry.upper, 1000) + max(entry.lower, entry.value / 2)),
        }
        with changed(cylinder, inside):
            pass
        outside = entry.upper + 0.01 * max(1, entry.upper)
        with pytest.raises(InputError):
            set_values(cylinder, {entry.name: outside})
