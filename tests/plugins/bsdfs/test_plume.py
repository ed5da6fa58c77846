"""Partly transparent surfaces against closed forms, and the same with every way to sample."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mi_lcair.errors import InputError, mitsuba_error
from mi_lcair.plugins.paths.launch import Launch
from mi_lcair.plugins.recorders.channels import Channels
from tests.plugins.small_scenes import GREY, INTEGRATORS, SQUARE, blackbody, camera, runs, scene

BLACK = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}}
HOT, COLD = blackbody(600.0), blackbody(300.0)  # W m^-2 sr^-1
SAMPLING = [False, True]
IDS = ["paths", "emitter sampling"]


def plume(transmittance):
    return {"type": "plume", "transmittance": transmittance}


def path(sampling=False, max_bounces=3, **others):
    settings = {"emitter_sampling": sampling, "max_bounces": max_bounces, **others}
    return {"type": "bounce_path", **settings}


def at_height(z, half=5.0):
    return [[half * x, half * y, z] for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]


def mean(scene, spp=1024, seed=0):
    """Mean of the image [W m^-2 sr^-1] and its standard error."""
    values = runs(scene, 8, spp // 8, seed).mean(axis=(1, 2))
    return values.mean(), values.std(ddof=1) / np.sqrt(len(values))


@pytest.mark.parametrize("tau", [0.0, 0.3, 0.8, 1.0])
@pytest.mark.parametrize("name", INTEGRATORS)
def test_hot_sheet_before_a_background(plate, name, tau):
    sheet = plate("sheet", at_height(1.0), plume(tau), 600.0, group="plume")
    ground = plate("ground", SQUARE, BLACK, 300.0)
    found = np.array(
        mi.render(scene(INTEGRATORS[name], camera(2), sheet=sheet, ground=ground), spp=4)
    )
    assert found == pytest.approx((1 - tau) * HOT + tau * COLD, rel=2e-6)


@pytest.mark.parametrize("sampling", SAMPLING, ids=IDS)
def test_passages_are_no_reflections(plate, sampling):
    """A closed plume is crossed twice, also by paths that may not be reflected at all."""
    tau = 0.6
    cone = {
        "type": "sphere",
        "radius": 1.0,
        "center": [0, 0, 3],
        "bsdf": plume(tau),
        "emitter": {
            "type": "thermal",
            "band": "LWIR",
            "temperature": 600.0,
            "group": "plume",
        },
    }
    ground = plate("ground", SQUARE, BLACK, 300.0, group="ground")
    made = scene(path(sampling, 0), camera(1, 0.1), cone=cone, ground=ground)
    expected = {"group.plume": (1 - tau**2) * HOT, "group.ground": tau**2 * COLD}
    whole = sum(expected.values())
    with made.integrator().prepared(made) as tracer:
        found = tracer.trace(
            made.sensors()[0], Launch(1, 1, 0, 4, 64), Channels(counts_segments=True)
        )
    values = {name: float(sums.sum()) / 256 for name, sums in found.channels.items()}
    expected |= {"bounce.0": whole, "seen.plume": whole, "seen.ground": 0, "target": whole}
    expected |= {"range": 16.0, "segments": 3.0}
    for name, value in expected.items():
        assert values[name] == pytest.approx(value, rel=1e-3 if name == "range" else 1e-5), name


def lamp_behind_sheets(plate, integrator):
    """A grey floor below a small hot plate, with two sheets of plume between them."""
    return scene(
        integrator,
        camera(1, 0.5, target=(0, 0, 0), origin=(20, 0, 4)),
        floor=plate("floor", SQUARE, GREY, 300.0, group="floor"),
        lower=plate("lower", at_height(1.0, 1.0), plume(0.7), 400.0, group="plume"),
        upper=plate("upper", at_height(1.5, 1.0), plume(0.5), 400.0, group="plume"),
        lamp=plate("lamp", at_height(2.5, 1.0)[::-1], BLACK, 900.0, group="lamp"),
    )


def test_emitters_are_drawn_through_plumes(plate):
    """Group by group the same as without emitter sampling, and as Mitsuba's path tracer."""
    means = {}
    for sampling in SAMPLING:
        made = lamp_behind_sheets(plate, path(sampling, 2))
        with made.integrator().prepared(made) as tracer:
            found = tracer.trace(made.sensors()[0], Launch(1, 1, 1, 16, 2**12))
        means[sampling] = {
            name: (sums.mean() / 2**12, sums.std(ddof=1) / 2**12 / 4)
            for name, sums in found.channels.items()
        }
    for name in ("group.lamp", "group.plume", "group.floor", "bounce.1"):
        (a, a_error), (b, b_error) = means[False][name], means[True][name]
        assert a > 0
        assert abs(a - b) < 4 * np.hypot(a_error, b_error) + 1e-5 * a, name
        assert np.hypot(a_error, b_error) <= 0.03 * a, name
    stock = {"type": "path", "max_depth": 9, "rr_depth": 100}
    value, error = mean(lamp_behind_sheets(plate, stock), 2**14)
    own = sum(means[True][f"bounce.{k}"][0] for k in range(3))
    assert abs(value - own) < 4 * error + 0.01 * own


def test_point_light_shines_through(plate):
    """A light between two sheets: only the sheet before it takes its share."""
    light = {"type": "point", "position": [0, 0, 2.0], "intensity": {"type": "uniform", "value": 9}}
    arriving = {}
    for sheets in (False, True):
        shapes = {"floor": plate("floor", SQUARE, GREY, 300.0)}
        if sheets:
            shapes["before"] = plate("before", at_height(1.0), plume(0.7), 1.0)
            shapes["behind"] = plate("behind", at_height(3.0), plume(0.2), 1.0)
        made = scene(path(), camera(1, 0.1, origin=(0, 0, 0.5)), light=light, **shapes)
        arriving[sheets] = mean(made, 64)[0] - 0.7 * COLD
    assert arriving[True] == pytest.approx(0.7 * arriving[False], rel=1e-4)


@pytest.mark.parametrize("sampling", SAMPLING, ids=IDS)
def test_sun_shines_through(plate, sampling):
    """A grey plate under a plume: the plume takes its share of the sunlight, also in the shadow."""
    sun = {"type": "sun", "azimuth_deg": 0.0, "elevation_deg": 60.0, "band": "MWIR"}
    reflected = {}
    for tau in (None, 0.6):
        shapes = {"floor": plate("floor", SQUARE, GREY, 10.0, band="MWIR")}
        if tau:
            shapes["sheet"] = plate("sheet", at_height(1.0, 4.0), plume(tau), 10.0, band="MWIR")
        made = scene(path(sampling), camera(1, 0.1, origin=(0, 0, 0.5)), sun=sun, **shapes)
        reflected[tau] = mean(made, 64)[0]
    assert reflected[None] > 0
    assert reflected[0.6] == pytest.approx(0.6 * reflected[None], rel=1e-4)


@pytest.mark.parametrize("sampling", SAMPLING, ids=IDS)
@pytest.mark.parametrize("tau", [0.2, 0.9])
def test_isothermal_room_radiates_as_a_blackbody(plate, sampling, tau):
    room = {
        "type": "cube",
        "to_world": mi.ScalarTransform4f().scale(4),
        "flip_normals": True,
        "bsdf": GREY,
        "emitter": {"type": "thermal", "band": "LWIR", "temperature": 300.0},
    }
    made = scene(
        path(sampling, 200),
        camera(2, 2.0, origin=(0, 0, 3.5)),
        room=room,
        floor=plate("floor", at_height(-1.0, 2.0), {"type": "twosided", "of": GREY}, 300.0),
        sheet=plate("sheet", at_height(0.0, 1.0), plume(tau), 300.0),
        other=plate("other", at_height(1.0, 1.5), plume(tau), 300.0),
    )
    value, error = mean(made, 256)
    assert abs(value - COLD) < 4 * error + 2e-5 * COLD
    assert error < 2e-3 * COLD


@pytest.mark.parametrize("mode", ["forward", "backward"])
def test_derivative_in_the_transmittance(plate, mode):
    """dL/dtau = B(background) - B(plume)."""
    sheet = plate("sheet", at_height(1.0), plume(0.4), 600.0)
    ground = plate("ground", SQUARE, BLACK, 300.0)
    made = scene(path(), camera(2), sheet=sheet, ground=ground)
    params = mi.traverse(made)
    key = next(name for name in params.keys() if name.endswith("transmittance"))  # noqa: SIM118
    dr.enable_grad(params[key])
    params.update()
    image = mi.render(made, params, spp=4)
    if mode == "forward":
        dr.forward(params[key])
        found = dr.grad(image).numpy().mean()
    else:
        dr.backward(dr.mean(image))
        found = dr.grad(params[key])[0]
    assert found == pytest.approx(COLD - HOT, rel=1e-5)


@pytest.mark.parametrize("sampling", SAMPLING, ids=IDS)
def test_derivative_in_a_temperature_behind_plumes(plate, sampling):
    """Of the hot plate, whose radiance reaches the floor through two sheets."""
    made = lamp_behind_sheets(plate, path(sampling, 2))
    params = mi.traverse(made)
    key = next(
        name
        for name in params.keys()  # noqa: SIM118
        if name.endswith("emitter.temperature") and params[name][0] == 900
    )
    drawn = lamp_behind_sheets(plate, path(True, 2))
    with drawn.integrator().prepared(drawn) as tracer:
        found = tracer.trace(drawn.sensors()[0], Launch(1, 1, 1, 16, 2**12)).channels
    slope = np.log(blackbody(901.0) / blackbody(899.0)) / 2  # relative, of the lamp's radiance
    dr.enable_grad(params[key])
    params.update()
    image = mi.render(made, params, spp=1, seed=1, seed_grad=2, spp_grad=2**16)
    dr.forward(params[key])
    expected = found["group.lamp"].mean() / 2**12 * slope
    assert dr.grad(image).numpy().mean() == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize("sampling", SAMPLING, ids=IDS)
def test_closure_takes_a_plume_for_a_surface(plate, sampling):
    """The ambient radiance beyond the last reflection comes from a plume as from a wall."""
    made = scene(
        path(sampling, 0, closure="ambient", ambient_temperature=300.0),
        camera(1, 0.1, origin=(0, 0, 0.5)),
        floor=plate("floor", SQUARE, GREY, 300.0),
        sheet=plate("sheet", at_height(1.0, 500.0), plume(0.6), 600.0),
    )
    assert mean(made, 2**12)[0] == pytest.approx(COLD, rel=1e-3)


def test_derivatives_that_paths_do_not_give_are_refused(plate):
    sheet = plate("sheet", at_height(1.0), plume(0.4), 600.0)
    made = scene(path(True), camera(1), sheet=sheet, ground=plate("ground", SQUARE, GREY, 300.0))
    params = mi.traverse(made)
    key = next(name for name in params.keys() if name.endswith("transmittance"))  # noqa: SIM118
    dr.enable_grad(params[key])
    params.update()
    image = mi.render(made, params, spp=1)
    with pytest.raises((InputError, RuntimeError), match="are drawn"):
        dr.forward(params[key])
    assert image is not None


def test_more_passages_than_are_followed_are_reported(plate):
    """A path through 33 sheets is no number, so that it is counted as an invalid sample."""
    many = {f"s{k}": plate(f"s{k}", at_height(1 + 0.1 * k), plume(0.9), 300.0) for k in range(33)}
    for count, valid in ((32, 4), (33, 0)):
        sheets = dict(list(many.items())[:count])
        ground = plate("ground", SQUARE, BLACK, 300.0)
        made = scene(path(), camera(1), ground=ground, **sheets)
        with made.integrator().prepared(made) as tracer:
            found = tracer.trace(made.sensors()[0], Launch(1, 1, 0, 1, 4))
        assert found.valid.sum() == valid


@pytest.mark.parametrize("tau", [-0.1, 1.5, float("nan"), None, "thin"])
def test_bad_input(tau):
    properties = {} if tau is None else {"transmittance": tau}
    with pytest.raises((InputError, RuntimeError)) as caught:
        mi.load_dict({"type": "plume", **properties})
    message = str(mitsuba_error(caught.value))
    assert "plume: " in message and "transmittance" in message and "\n" not in message
