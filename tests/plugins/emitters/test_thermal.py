"""Emission: how much each kind of surface emits, from which sides, and facet by facet."""

import gc
import traceback

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.plugins.emission.emissivity import Emissivities, emissivity_of
from mi_lcair.plugins.emitters import thermal
from tests.physics import thesis
from tests.plugins.reflection_models import exact_HDR, seen_at, uniform
from tests.plugins.small_scenes import (
    BROAD,
    GREY,
    INTEGRATORS,
    SQUARE,
    blackbody,
    camera,
    scene,
    with_emitter,
)

ANGLES = np.radians([0, 20, 45, 70, 85, 89])
ROUGH = {"type": "roughconductor", "distribution": "ggx", "alpha": 0.2, "material": "Al"}


@pytest.fixture(autouse=True)
def no_remains():
    """Frees the scenes of failed renders: Dr.Jit's calls reach every emitter that is alive."""
    yield
    gc.collect()


def emitted(shape, angles=ANGLES, side=1, at=(1, -1)):
    """Radiance of the shape toward observers at these angles, on one side [W m^-2 sr^-1]."""
    loaded = mi.load_dict({"type": "scene", "shape": shape}, optimize=False)
    toward = mi.Vector3f(np.sin(angles), 0 * angles, side * np.cos(angles))
    si = loaded.ray_intersect(mi.Ray3f(mi.Point3f(*at, 0) + toward, -toward))
    assert dr.all(si.is_valid())
    for emitter in loaded.emitters():
        emitter.refresh()
    return si.emitter(loaded).eval(si)[0].numpy()


# ---------------------------------------------------------------- Emissivity


@pytest.mark.slow
def test_sandford_robertson_by_kirchhoff(plate):
    found = emitted(plate("p", SQUARE, BROAD, 400)) / blackbody(400)
    np.testing.assert_allclose(found, 1 - exact_HDR(mi.load_dict(BROAD), ANGLES), rtol=0, atol=1e-5)


@pytest.mark.slow
def test_sandford_robertson_by_its_own_emissivity(plate):
    found = emitted(plate("p", SQUARE, {**BROAD, "emissivity": "model"}, 400)) / blackbody(400)
    np.testing.assert_allclose(
        found, 0.2 * thesis.g(np, ANGLES, 0.5) / thesis.G(np, 0.5), rtol=1e-5
    )  # Eq 2.21


@pytest.mark.slow
def test_sandford_robertson_by_a_measured_table(plate, tmp_path):
    """Linear in the angle between the rows, constant beyond them; 2e-3 by which the plugin's own
    table rounds the knees.
    """
    (tmp_path / "table.csv").write_text(
        "# measured\ntheta_deg,emissivity\n10,0.2\n40,0.5\n80,0.9\n"
    )
    shape = plate("p", SQUARE, {**BROAD, "emissivity": str(tmp_path / "table.csv")}, 400)
    found = emitted(shape, np.radians([0, 10, 25, 60, 80, 88])) / blackbody(400)
    np.testing.assert_allclose(found, [0.2, 0.2, 0.35, 0.7, 0.9, 0.9], rtol=0, atol=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("lobe", ["mirror", "diffuse"])
def test_rungs_emit_alike(plate, lobe):
    np.testing.assert_array_equal(
        emitted(plate("p", SQUARE, {**BROAD, "lobe": lobe}, 400)),
        emitted(plate("q", SQUARE, BROAD, 400)),
    )


@pytest.mark.slow
def test_stock_diffuse(plate):
    np.testing.assert_allclose(
        emitted(plate("p", SQUARE, GREY, 400)), 0.7 * blackbody(400), rtol=1e-6
    )


@pytest.mark.slow
def test_emissivity_given_to_the_emitter_comes_first(plate):
    for bsdf in (BROAD, GREY, {"type": "mask", "bsdf": GREY, "opacity": 0.5}):
        found = emitted(with_emitter(plate("p", SQUARE, bsdf, 400), emissivity=0.35))
        np.testing.assert_allclose(found, 0.35 * blackbody(400), rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    "bsdf",
    [ROUGH, {"type": "plastic"}, {"type": "conductor", "material": "Al"}],
    ids=lambda bsdf: bsdf["type"],
)
def test_stock_bsdf_by_a_table_with_its_error(plate, bsdf):
    """1 - HDR at angles between the table's nodes, by a million samples of its own sample(), within
    4.5 standard errors: the table states its own, to which 2e-3 come for its interpolation.
    """
    loaded, count = mi.load_dict(bsdf), 1 << 20
    stated = emissivity_of(loaded)
    assert stated.kind == "table" and 0 <= stated.error < 0.01
    found = emitted(plate("p", SQUARE, bsdf, 400)) / blackbody(400)
    for value, theta in zip(found[:5], ANGLES):
        u, v, w = uniform(count, 3)
        _, weight = loaded.sample(
            mi.BSDFContext(), seen_at(np.full(count, theta)), u, mi.Point2f(v, w)
        )
        weight = weight[0].numpy().astype(float)
        error = np.hypot(stated.error, weight.std() / np.sqrt(count))
        assert abs(value - (1 - weight.mean())) < 4.5 * error + 2e-3


@pytest.mark.slow
def test_a_surface_emits_from_the_sides_that_reflect(plate):
    for bsdf in (BROAD, GREY, ROUGH):
        front, back = (emitted(plate("p", SQUARE, bsdf, 400), side=side) for side in (1, -1))
        both = {"type": "twosided", "bsdf": bsdf}
        from_both = [emitted(plate("q", SQUARE, both, 400), side=side) for side in (1, -1)]
        assert np.all(front > 0) and np.all(back == 0)
        for found in from_both:
            np.testing.assert_allclose(found, front, rtol=1e-5 if bsdf is not ROUGH else 0.1)
        given = [
            emitted(with_emitter(plate("r", SQUARE, bsdf, 400), emissivity=0.5), side=side)
            for side in (1, -1)
        ]
        np.testing.assert_allclose(given[0], 0.5 * blackbody(400), rtol=1e-6)
        assert np.all(given[1] == 0)


@pytest.mark.slow
def test_two_sides_of_different_material(plate):
    both = {"type": "twosided", "front": BROAD, "back": {**BROAD, "epsilon": 0.5}}
    for side, bsdf in ((1, BROAD), (-1, both["back"])):
        np.testing.assert_allclose(
            emitted(plate("p", SQUARE, both, 400), side=side),
            emitted(plate("q", SQUARE, bsdf, 400)),
            rtol=1e-6,
        )


def failure(loaded):
    """The text of the exception that rendering raises; mi.render wraps it."""
    with pytest.raises(RuntimeError) as error:
        mi.render(loaded, spp=1)
    text = "".join(traceback.format_exception(error.value))
    assert "InputError" in text
    return text


@pytest.mark.slow
@pytest.mark.parametrize(
    "bsdf, word",
    [
        ({"type": "mask", "opacity": 0.5, "bsdf": GREY}, "MaskBSDF hides"),
        ({"type": "bumpmap", "texture": {"type": "checkerboard"}, "bsdf": GREY}, "BumpMap hides"),
        ({"type": "blendbsdf", "weight": 0.5, "a": GREY, "b": GREY}, "BlendBSDF hides"),
        (
            {
                "type": "twosided",
                "bsdf": {"type": "bumpmap", "texture": {"type": "checkerboard"}, "bsdf": GREY},
            },
            "BumpMap hides",
        ),
        ({"type": "roughconductor", "alpha_u": 0.3, "alpha_v": 0.29}, "anisotropic"),
        ({"type": "dielectric"}, "transmits"),
        (
            {
                "type": "roughconductor",
                "alpha": {
                    "type": "checkerboard",
                    "color0": {"type": "uniform", "value": 0.1},
                    "color1": {"type": "uniform", "value": 0.4},
                },
            },
            "varies over the surface",
        ),
    ],
    ids=lambda value: value["type"] if isinstance(value, dict) else value,
)
def test_no_emissivity_is_an_error(plate, bsdf, word):
    """Never a silently black surface."""
    with pytest.raises(InputError, match=f"{word}.*`emissivity`"):
        emissivity_of(mi.load_dict(bsdf))
    assert word in failure(
        scene(INTEGRATORS["bounce_path"], camera(), p=plate("p", SQUARE, bsdf, 400))
    )


@pytest.mark.slow
def test_the_table_itself_notices_anisotropy():
    """For plugins that do not set the flag."""
    brushed = mi.load_dict(
        {"type": "principled", "anisotropic": 0.95, "roughness": 0.5, "metallic": 1.0}
    )
    with pytest.raises(InputError, match="anisotropic.*`emissivity`"):
        Emissivities(brushed, int(brushed.flags()))


# ---------------------------------------------------------------- Temperatures and radiances


@pytest.mark.slow
@pytest.mark.parametrize("name", ["LWIR", "total", "3.5-4.2"])
def test_each_facet_has_its_own_temperature(plate, name):
    """Facet 0 lies below the diagonal x = y, facet 1 above it."""
    shape = plate("p", SQUARE, GREY, [310, 450], band=name)
    for at, temperature in (((2, -2), 310), ((-2, 2), 450)):
        np.testing.assert_allclose(
            emitted(shape, at=at), 0.7 * blackbody(temperature, name), rtol=2e-6
        )


@pytest.mark.slow
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_an_update_of_facet_temperatures_is_honoured(plate, integrator):
    one_plate = scene(INTEGRATORS[integrator], camera(2), mesh=plate("p", SQUARE, GREY, [310, 450]))
    params = mi.traverse(one_plate)
    for temperatures in ([310, 450], [500, 305], [305, 305]):
        params["mesh.face_temperature"] = mi.Float(temperatures)
        params.update()
        image = np.array(mi.render(one_plate, spp=16))[..., 0]
        assert image[1, 1] == pytest.approx(
            0.7 * blackbody(temperatures[0]), rel=1e-5
        )  # seen from above: below the diagonal
        assert image[0, 0] == pytest.approx(0.7 * blackbody(temperatures[1]), rel=1e-5)


def test_single_temperatures_of_a_scene_are_converted_together(monkeypatch):
    """To the same numbers as one by one, once for each band, and again after each change."""
    of_bands = {
        f"{band}{T:.0f}": (T, band) for T in (280, 300.25, 3000) for band in ("LWIR", "MWIR")
    }
    lamps = {
        name: {
            "type": "rectangle",
            "bsdf": {"type": "diffuse"},
            "emitter": {"type": "thermal", "temperature": T, "band": band},
        }
        for name, (T, band) in of_bands.items()
    }
    loaded = mi.load_dict({"type": "scene", **lamps}, optimize=False)
    emitters, calls = loaded.emitters(), []
    convert = thermal.in_band_radiance
    monkeypatch.setattr(thermal, "in_band_radiance", lambda *of: calls.append(1) or convert(*of))
    for step in (0.0, 1.5, 3.0):
        for emitter in emitters:
            emitter.temperature = mi.Float(emitter.temperature + step)
        calls.clear()
        thermal.derive_together(emitters)
        assert len(calls) == 2
        together = [float(emitter.derived[0]) for emitter in emitters]
        for emitter in emitters:
            emitter.derive()
        assert [float(emitter.derived[0]) for emitter in emitters] == together
        calls.clear()
        thermal.derive_together(emitters)
        assert not calls  # nothing has changed
    dr.enable_grad(emitters[0].temperature)
    thermal.derive_together(emitters)
    assert not dr.grad_enabled(emitters[0].derived)  # left to `refresh`


@pytest.mark.slow
def test_temperatures_that_change_twice_between_renders_are_honoured(plate):
    """Dr.Jit reuses the index of a freed variable, so an index does not identify a value."""
    one_plate = scene(
        INTEGRATORS["bounce_path"], camera(2), mesh=plate("p", SQUARE, GREY, [300, 300])
    )
    params = mi.traverse(one_plate)

    def set_to(temperature):
        params["mesh.face_temperature"] = mi.Float([temperature, temperature])
        params.update()

    found = []
    for _ in range(4):
        set_to(305)
        mi.render(one_plate, spp=4)
        set_to(300)
        set_to(295)
        found.append(np.array(mi.render(one_plate, spp=4)).mean())
    np.testing.assert_allclose(found, 0.7 * blackbody(295), rtol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("bad, number", [(0, 1), (-5, 0), (float("nan"), 1), (float("inf"), 0)])
def test_a_bad_temperature_names_its_facet(plate, bad, number):
    temperatures = [300.0, 300.0]
    temperatures[number] = bad
    one_plate = scene(
        INTEGRATORS["bounce_path"], camera(2), mesh=plate("p", SQUARE, GREY, temperatures)
    )
    assert f"temperature of facet {number} = {bad:g} K; must be positive and finite" in failure(
        one_plate
    )
    with pytest.raises(RuntimeError, match=f"temperature = {bad:g} K; must be "):
        mi.load_dict({"type": "scene", "p": plate("q", SQUARE, GREY, bad)}, optimize=False)


@pytest.mark.slow
def test_a_texture_inside_a_facet_is_evaluated_at_the_hit(plate):
    """The checkerboard's two temperatures, 2 x 2 over the rectangle's uv."""
    texture = {
        "type": "checkerboard",
        "color0": {"type": "uniform", "value": 300.0},
        "color1": {"type": "uniform", "value": 500.0},
    }
    shape = {
        "type": "rectangle",
        "bsdf": GREY,
        "emitter": {"type": "thermal", "band": "LWIR", "temperature": texture},
    }
    found = sorted(emitted(shape, np.array([0.1]), at=at)[0] for at in ((0.5, 0.5), (0.5, -0.5)))
    np.testing.assert_allclose(found, [0.7 * blackbody(300), 0.7 * blackbody(500)], rtol=1e-5)


@pytest.mark.slow
def test_a_source_of_given_radiance(plate):
    shape = plate("p", SQUARE, BROAD)
    np.testing.assert_allclose(
        emitted({**shape, "emitter": {"type": "thermal", "radiance": 12.5}}), 12.5, rtol=1e-6
    )
    np.testing.assert_allclose(
        emitted({**shape, "emitter": {"type": "thermal", "radiance": 12.5, "emissivity": 0.5}}),
        6.25,
        rtol=1e-6,
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "emitter, message",
    [
        ({}, "temperature, radiance and spectrum are missing"),
        ({"temperature": 300.0, "radiance": 1.0, "band": "LWIR"}, "has temperature and radiance"),
        ({"temperature": 300.0}, "temperature needs band"),
        ({"radiance": -1.0}, "radiance = -1"),
        ({"temperature": 300.0, "band": "LWIRR"}, "LWIRR"),
        ({"temperature": 300.0, "band": "LWIR", "emissivity": 1.5}, "emissivity = 1.5"),
        ({"radiance": 1.0, "group": "a b"}, "group 'a b'"),
        ({"radiance": 1.0, "temprature": 300.0}, "temprature"),
    ],
)
def test_bad_input_is_named(emitter, message):
    with pytest.raises(RuntimeError, match=message):
        mi.load_dict({"type": "thermal", **emitter})


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("is_flipped", [False, True])
def test_normals_of_a_mirrored_cylinder(is_flipped, side):
    """They are those of its hits. Mitsuba's position samples have the opposite ones."""
    cylinder = {
        "type": "cylinder",
        "to_world": mi.ScalarTransform4f().scale([side, 1, 1]),
        "flip_normals": is_flipped,
        "emitter": {"type": "thermal", "band": "LWIR", "temperature": 300.0},
    }
    scene = mi.load_dict({"type": "scene", "cylinder": cylinder}, optimize=False)
    sample = mi.Point2f([0.1, 0.5, 0.9], [0.3, 0.6, 0.2])
    si, _ = scene.shapes()[0].emitter().sample_surface(sample, mi.Bool(True))
    hit = scene.ray_intersect(mi.Ray3f(mi.Point3f(0, 0, si.p.z), mi.Vector3f(si.p.x, si.p.y, 0)))
    assert si.n.numpy() == pytest.approx(hit.n.numpy(), abs=1e-5)


@pytest.mark.parametrize("is_flipped", [False, True])
def test_normals_of_a_turned_sphere(is_flipped):
    """They are those of its surface, toward the middle if they are flipped."""
    T = mi.ScalarTransform4f()
    sphere = {
        "type": "sphere",
        "to_world": T.translate([1, 2, 3]) @ T.rotate([1, 0, 0], 120) @ T.scale(0.5),
        "flip_normals": is_flipped,
        "emitter": {"type": "thermal", "band": "LWIR", "temperature": 300.0},
    }
    (shape,) = mi.load_dict({"type": "scene", "sphere": sphere}, optimize=False).shapes()
    sample = mi.Point2f([0.1, 0.5, 0.9], [0.3, 0.6, 0.2])
    si, density = shape.emitter().sample_surface(sample, mi.Bool(True))
    radial = (si.p.numpy() - np.array([[1], [2], [3]])) / 0.5
    assert si.n.numpy() == pytest.approx(-radial if is_flipped else radial, abs=1e-6)
    assert density.numpy() == pytest.approx(1 / np.pi, rel=1e-6)
