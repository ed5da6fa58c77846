"""Facets back to back: each is seen from its own side, however they are ordered and divided."""

import mitsuba as mi
import pytest

import mi_lcair
from mi_lcair.plugins.paths.sheets import Sheets
from tests.plugins.small_scenes import camera, scene

T = mi.ScalarTransform4f()
TURNED = T.rotate([1, 0, 0], 180)


def side(kelvin, to_world, bsdf="grey", **emissivity):
    emitter = {"type": "thermal", "band": "LWIR", "temperature": kelvin, "group": f"at{kelvin:g}"}
    surface = {"type": bsdf, **(emissivity or {"emissivity": 1.0})}
    return {"type": "rectangle", "to_world": to_world, "bsdf": surface, "emitter": emitter}


def seen(height, *sides, sampling=False):
    """Temperatures that an orthographic camera sees from above or below, 4 x 4 pixels over 2 m."""
    sensor = camera(4, 2.0, origin=(0, 0, height))
    integrator = {"type": "bounce_path", "emitter_sampling": sampling}
    loaded = scene(integrator, sensor, **{f"side{k}": shape for k, shape in enumerate(sides)})
    return mi_lcair.render(loaded, spp=16).channels["temperature.Y"]


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("turn", [TURNED, TURNED @ T.rotate([0, 0, 1], 90)])
def test_each_side_shows_its_own_facet(order, turn):
    sides = [side(400.0, T), side(300.0, turn)][::order]
    assert seen(5, *sides) == pytest.approx(400, abs=0.01)
    assert seen(-5, *sides) == pytest.approx(300, abs=0.01)


@pytest.mark.parametrize("order", [1, -1])
def test_facets_that_overlap_in_part(order):
    """A back of half the size, turned by 30 degrees, covers a part of the front's triangles."""
    sides = [side(400.0, T), side(300.0, T.rotate([0, 0, 1], 30).scale(0.6) @ TURNED)][::order]
    assert seen(5, *sides) == pytest.approx(400, abs=0.01)
    below = seen(-5, *sides)
    assert below[1:3, 1:3] == pytest.approx(300, abs=0.01) and below[0, 0] == 0


@pytest.mark.parametrize("sampling", [False, True])
@pytest.mark.parametrize("order", [1, -1])
def test_light_of_a_sheet_is_reflected(sampling, order):
    """A mirror below a sheet shows its lower side, also to directions drawn toward emitters."""
    sides = [side(400.0, T.scale(3)), side(300.0, T.scale(3) @ TURNED)][::order]
    floor = side(1.0, T.translate([0, 0, -1]), emissivity=0.0)
    sensor = camera(4, 1.0, origin=(4, 0, -0.6), target=(0, 0, -1))
    loaded = scene(
        {"type": "bounce_path", "emitter_sampling": sampling},
        sensor,
        **{f"side{k}": shape for k, shape in enumerate([*sides, floor])},
    )
    seen = mi_lcair.render(loaded, spp=4096)
    apart = scene(
        {"type": "bounce_path", "emitter_sampling": sampling},
        sensor,
        side0=side(300.0, T.scale(3) @ TURNED),
        floor=floor,
    )
    assert seen.mean == pytest.approx(mi_lcair.render(apart, spp=4096).mean, rel=5e-3)


def test_facets_that_face_each_other_are_no_sheet():
    """Nor are those without a partner, and two-sided ones."""
    integrator = {"type": "bounce_path"}
    around = T.translate([0, 0, 1e-3])
    for second in (around @ TURNED, around, T.rotate([0, 1, 0], 90)):
        loaded = scene(integrator, camera(), a=side(400.0, T), b=side(300.0, second))
        assert Sheets.of(loaded) is None
    loaded = scene(integrator, camera(), a=side(400.0, T), b=side(300.0, TURNED))
    assert Sheets.of(loaded) is Sheets.of(loaded) is not None
    both = side(300.0, TURNED)
    both["bsdf"] = {"type": "twosided", "bsdf": both["bsdf"]}
    assert Sheets.of(scene(integrator, camera(), a=side(400.0, T), b=both)) is None
