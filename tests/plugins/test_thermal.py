"""Emission: how much each kind of surface emits and from where, facet by facet, and the same image from every integrator."""
import gc
import traceback

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.emissivity import emissivity_of
from tests.physics import thesis
from tests.plugins.conftest import FILM
from tests.plugins.reflection_models import exact_HDR, seen_at, uniform

SIGMAS = 4.5        # standard errors, and Student's t with 30 degrees of freedom: wrong once in 10,000 comparisons
SQUARE = [[-5, -5, 0], [5, -5, 0], [5, 5, 0], [-5, 5, 0]]       # m
ANGLES = np.radians([0, 20, 45, 70, 85, 89])
BROAD = {"type": "sandford_robertson", "epsilon": 0.2, "rho_d": 0.1, "b": 0.5, "e": 0.3}
ROUGH = {"type": "roughconductor", "distribution": "ggx", "alpha": 0.2, "material": "Al"}
GREY = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.3}}
INTEGRATORS = {
    "bounce_path": {"type": "bounce_path", "max_bounces": 3},
    "bounce_path, emitter sampling": {"type": "bounce_path", "max_bounces": 3, "emitter_sampling": True},
    "path": {"type": "path", "max_depth": 4, "rr_depth": 100},
    "prb": {"type": "prb", "max_depth": 4, "rr_depth": 100},
}


@pytest.fixture(autouse=True)
def no_remains():
    """Frees the scenes of failed renders: Dr.Jit's calls reach every emitter that is alive."""
    yield
    gc.collect()


def blackbody(temperature, name="LWIR"):
    return float(in_band_radiance(band(name), temperature))


def with_emitter(shape, **changes):
    return {**shape, "emitter": {**shape["emitter"], **changes}}


def emitted(shape, angles=ANGLES, side=1, at=(1, -1)):
    """What the shape sends toward observers at these angles, from one side of z = 0 [W m^-2 sr^-1]."""
    scene = mi.load_dict({"type": "scene", "shape": shape}, optimize=False)
    toward = mi.Vector3f(np.sin(angles), 0 * angles, side * np.cos(angles))
    si = scene.ray_intersect(mi.Ray3f(mi.Point3f(*at, 0) + toward, -toward))
    assert dr.all(si.is_valid())
    for emitter in scene.emitters():
        emitter.refresh()
    return si.emitter(scene).eval(si)[0].numpy()


# ---------------------------------------------------------------- Emissivity

def test_sandford_robertson_by_kirchhoff(plate):
    found = emitted(plate("p", SQUARE, BROAD, 400)) / blackbody(400)
    np.testing.assert_allclose(found, 1 - exact_HDR(mi.load_dict(BROAD), ANGLES), rtol=0, atol=1e-5)


def test_sandford_robertson_by_its_own_emissivity(plate):
    found = emitted(plate("p", SQUARE, {**BROAD, "emissivity": "model"}, 400)) / blackbody(400)
    np.testing.assert_allclose(found, 0.2 * thesis.g(np, ANGLES, 0.5) / thesis.G(np, 0.5), rtol=1e-5)     # Eq 2.21


def test_sandford_robertson_by_a_measured_table(plate, tmp_path):
    """Linear in the angle between the rows, constant beyond them; 2e-3 by which the plugin's own table rounds the knees."""
    (tmp_path / "table.csv").write_text("# measured\ntheta_deg,emissivity\n10,0.2\n40,0.5\n80,0.9\n")
    found = emitted(plate("p", SQUARE, {**BROAD, "emissivity": str(tmp_path / "table.csv")}, 400), np.radians([0, 10, 25, 60, 80, 88])) / blackbody(400)
    np.testing.assert_allclose(found, [0.2, 0.2, 0.35, 0.7, 0.9, 0.9], rtol=0, atol=2e-3)


@pytest.mark.parametrize("lobe", ["mirror", "diffuse"])
def test_rungs_emit_alike(plate, lobe):
    np.testing.assert_array_equal(emitted(plate("p", SQUARE, {**BROAD, "lobe": lobe}, 400)), emitted(plate("q", SQUARE, BROAD, 400)))


def test_stock_diffuse(plate):
    np.testing.assert_allclose(emitted(plate("p", SQUARE, GREY, 400)), 0.7 * blackbody(400), rtol=1e-6)


def test_emissivity_given_to_the_emitter_comes_first(plate):
    for bsdf in (BROAD, GREY, {"type": "mask", "bsdf": GREY, "opacity": 0.5}):
        found = emitted(with_emitter(plate("p", SQUARE, bsdf, 400), emissivity=0.35))
        np.testing.assert_allclose(found, 0.35 * blackbody(400), rtol=1e-6)


@pytest.mark.parametrize("bsdf", [ROUGH, {"type": "plastic"}, {"type": "conductor", "material": "Al"}], ids=lambda bsdf: bsdf["type"])
def test_stock_bsdf_by_a_table_with_its_error(plate, bsdf):
    """1 - HDR at angles between the table's nodes, by a million samples of its own sample(); the table states one standard
    error, to which 2e-3 come for its interpolation."""
    loaded, count = mi.load_dict(bsdf), 1 << 20
    stated = emissivity_of(loaded)
    assert stated.kind == "table" and 0 <= stated.error < 0.01
    found = emitted(plate("p", SQUARE, bsdf, 400)) / blackbody(400)
    for value, theta in zip(found[:5], ANGLES):
        u, v, w = uniform(count, 3)
        _, weight = loaded.sample(mi.BSDFContext(), seen_at(np.full(count, theta)), u, mi.Point2f(v, w))
        weight = weight[0].numpy().astype(float)
        error = np.hypot(stated.error, weight.std() / np.sqrt(count))
        assert abs(value - (1 - weight.mean())) < SIGMAS * error + 2e-3


def test_a_surface_emits_from_the_sides_that_reflect(plate):
    for bsdf in (BROAD, GREY, ROUGH):
        front, back = (emitted(plate("p", SQUARE, bsdf, 400), side=side) for side in (1, -1))
        both = {"type": "twosided", "bsdf": bsdf}
        from_both = [emitted(plate("q", SQUARE, both, 400), side=side) for side in (1, -1)]
        assert np.all(front > 0) and np.all(back == 0)
        for found in from_both:
            np.testing.assert_allclose(found, front, rtol=1e-5 if bsdf is not ROUGH else 0.1)
        given = [emitted(with_emitter(plate("r", SQUARE, bsdf, 400), emissivity=0.5), side=side) for side in (1, -1)]
        np.testing.assert_allclose(given[0], 0.5 * blackbody(400), rtol=1e-6)
        assert np.all(given[1] == 0)


def test_two_sides_of_different_material(plate):
    both = {"type": "twosided", "front": BROAD, "back": {**BROAD, "epsilon": 0.5}}
    for side, bsdf in ((1, BROAD), (-1, both["back"])):
        np.testing.assert_allclose(emitted(plate("p", SQUARE, both, 400), side=side), emitted(plate("q", SQUARE, bsdf, 400)), rtol=1e-6)


def failure(scene):
    """The text of the exception that rendering raises; mi.render wraps it."""
    with pytest.raises(RuntimeError) as error:
        mi.render(scene, spp=1)
    text = "".join(traceback.format_exception(error.value))
    assert "InputError" in text
    return text


@pytest.mark.parametrize("bsdf, word", [
    ({"type": "mask", "opacity": 0.5, "bsdf": GREY}, "MaskBSDF hides"), ({"type": "bumpmap", "texture": {"type": "checkerboard"}, "bsdf": GREY}, "BumpMap hides"),
    ({"type": "blendbsdf", "weight": 0.5, "a": GREY, "b": GREY}, "BlendBSDF hides"),
    ({"type": "twosided", "bsdf": {"type": "bumpmap", "texture": {"type": "checkerboard"}, "bsdf": GREY}}, "BumpMap hides"),
    ({"type": "roughconductor", "alpha_u": 0.3, "alpha_v": 0.05}, "anisotropic"), ({"type": "dielectric"}, "transmits"),
    ({"type": "roughconductor", "alpha": {"type": "checkerboard", "color0": {"type": "uniform", "value": 0.1},
                                          "color1": {"type": "uniform", "value": 0.4}}}, "varies over the surface")],
    ids=lambda value: value["type"] if isinstance(value, dict) else value)
def test_no_emissivity_is_an_error(plate, bsdf, word):
    """Never a silently black surface."""
    with pytest.raises(InputError, match=f"{word}.*`emissivity`"):
        emissivity_of(mi.load_dict(bsdf))
    scene = mi.load_dict({"type": "scene", "integrator": INTEGRATORS["bounce_path"], "sensor": camera(), "p": plate("p", SQUARE, bsdf, 400)}, optimize=False)
    assert word in failure(scene)


# ---------------------------------------------------------------- Temperatures and radiances

def camera(size=4, height=10.0, target=(0, 0, 0), origin=(0, 0, 20)):
    T = mi.ScalarTransform4f
    return {"type": "orthographic", "to_world": T().look_at(origin=list(origin), target=list(target), up=[0, 1, 0]) @ T().scale([height / 2, height / 2, 1]),
            "film": {**FILM, "width": size, "height": size}, "sampler": {"type": "independent"}}


@pytest.mark.parametrize("name", ["LWIR", "total", "3.5-4.2"])
def test_each_facet_has_its_own_temperature(plate, name):
    """Facet 0 lies below the diagonal x = y, facet 1 above it."""
    shape = plate("p", SQUARE, GREY, [310, 450], band=name)
    for at, temperature in (((2, -2), 310), ((-2, 2), 450)):
        np.testing.assert_allclose(emitted(shape, at=at), 0.7 * blackbody(temperature, name), rtol=2e-6)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_an_update_of_facet_temperatures_is_honoured(plate, integrator):
    scene = mi.load_dict({"type": "scene", "integrator": INTEGRATORS[integrator], "sensor": camera(2), "mesh": plate("p", SQUARE, GREY, [310, 450])}, optimize=False)
    params = mi.traverse(scene)
    for temperatures in ([310, 450], [500, 305], [305, 305]):
        params["mesh.face_temperature"] = mi.Float(temperatures)
        params.update()
        image = np.array(mi.render(scene, spp=16))[..., 0]
        assert image[1, 1] == pytest.approx(0.7 * blackbody(temperatures[0]), rel=1e-5)      # seen from above: below the diagonal
        assert image[0, 0] == pytest.approx(0.7 * blackbody(temperatures[1]), rel=1e-5)


@pytest.mark.parametrize("bad, number", [(0, 1), (-5, 0), (float("nan"), 1), (float("inf"), 0)])
def test_a_bad_temperature_names_its_facet(plate, bad, number):
    temperatures = [300.0, 300.0]
    temperatures[number] = bad
    scene = mi.load_dict({"type": "scene", "integrator": INTEGRATORS["bounce_path"], "sensor": camera(2), "mesh": plate("p", SQUARE, GREY, temperatures)}, optimize=False)
    assert f"temperature of facet {number} = {bad:g} K; it must be positive and finite" in failure(scene)
    with pytest.raises(RuntimeError, match=f"temperature = {bad:g} K; it must be positive and finite"):
        mi.load_dict({"type": "scene", "p": plate("q", SQUARE, GREY, bad)}, optimize=False)


def test_a_texture_inside_a_facet_is_evaluated_at_the_hit(plate):
    """The checkerboard's two temperatures, 2 x 2 over the rectangle's uv."""
    texture = {"type": "checkerboard", "color0": {"type": "uniform", "value": 300.0}, "color1": {"type": "uniform", "value": 500.0}}
    shape = {"type": "rectangle", "bsdf": GREY, "emitter": {"type": "thermal", "band": "LWIR", "temperature": texture}}
    found = sorted(emitted(shape, np.array([0.1]), at=at)[0] for at in ((0.5, 0.5), (0.5, -0.5)))
    np.testing.assert_allclose(found, [0.7 * blackbody(300), 0.7 * blackbody(500)], rtol=1e-5)


def test_a_source_of_given_radiance(plate):
    shape = plate("p", SQUARE, BROAD)
    np.testing.assert_allclose(emitted({**shape, "emitter": {"type": "thermal", "radiance": 12.5}}), 12.5, rtol=1e-6)
    np.testing.assert_allclose(emitted({**shape, "emitter": {"type": "thermal", "radiance": 12.5, "emissivity": 0.5}}), 6.25, rtol=1e-6)


@pytest.mark.parametrize("emitter, message", [
    ({}, "either `temperature` or `radiance`"), ({"temperature": 300.0, "radiance": 1.0, "band": "LWIR"}, "either `temperature` or `radiance`"),
    ({"temperature": 300.0}, "needs a `band`"), ({"radiance": -1.0}, "radiance = -1"), ({"temperature": 300.0, "band": "LWIRR"}, "LWIRR"),
    ({"temperature": 300.0, "band": "LWIR", "emissivity": 1.5}, "emissivity = 1.5"), ({"radiance": 1.0, "group": "a b"}, "group 'a b'"),
    ({"radiance": 1.0, "temprature": 300.0}, "temprature")])
def test_bad_input_is_named(emitter, message):
    with pytest.raises(RuntimeError, match=message):
        mi.load_dict({"type": "thermal", **emitter})


# ---------------------------------------------------------------- The same image from every integrator

def runs(scene, count, spp, first_seed=0):
    """Images of independent renders, shape (count, height, width)."""
    return np.array([np.array(mi.render(scene, spp=spp, seed=first_seed + k), dtype=float)[..., 0] for k in range(count)])


def furniture(plate, bsdf=BROAD):
    """Shapes that face each other: a floor and a wall with facet temperatures, a sphere, a source of given radiance."""
    T = mi.ScalarTransform4f
    ball = {"type": "thermal", "band": "LWIR", "temperature": 700.0, "group": "ball"}
    return {
        "floor": plate("floor", SQUARE, bsdf, [350, 550]),
        "wall": plate("wall", [[5, -5, 0], [5, 5, 0], [5, 5, 5], [5, -5, 5]], GREY, [800, 320]),
        "ball": {"type": "sphere", "center": [1, 1, 3], "radius": 1, "bsdf": GREY, "emitter": ball},
        "lamp": {"type": "rectangle", "to_world": T().translate([-3, 3, 4]) @ T().rotate([1, 0, 0], 180), "bsdf": GREY, "emitter": {"type": "thermal", "radiance": 300.0}}}


def room(plate, integrator, sensor, bsdf=BROAD, sky=20.0):
    """The furniture under a uniform sky, or none."""
    shapes = furniture(plate, bsdf)
    if sky:
        shapes["sky"] = {"type": "constant", "radiance": {"type": "uniform", "value": sky}}
    return mi.load_dict({"type": "scene", "integrator": integrator, "sensor": sensor, **shapes}, optimize=False)


@pytest.mark.parametrize("lobe", ["brdf", "mirror"])
def test_stock_integrators_render_the_same_image(plate, lobe):
    """Pixel by pixel over 16 independent renders each, against bounce_path without emitter sampling."""
    count, images = 16, {}
    for k, (name, integrator) in enumerate(INTEGRATORS.items()):
        images[name] = runs(room(plate, integrator, camera(4, 9, (0, 0, 1), (-12, -3, 12)), {**BROAD, "lobe": lobe}), count, 256, first_seed=100 * k)
    reference = images.pop("bounce_path")
    for name, found in images.items():
        error = np.sqrt((found.var(axis=0, ddof=1) + reference.var(axis=0, ddof=1)) / count)
        z = (found.mean(axis=0) - reference.mean(axis=0)) / np.maximum(error, 1e-6)
        assert np.abs(z).max() < SIGMAS, (name, z)
        overall = found.mean(axis=(1, 2)), reference.mean(axis=(1, 2))
        difference, error = overall[0].mean() - overall[1].mean(), np.sqrt((overall[0].var(ddof=1) + overall[1].var(ddof=1)) / count)
        assert abs(difference) < SIGMAS * error, name


def test_the_particle_tracer_agrees(plate):
    """Stock `ptracer` starts at the emitters (sample_ray) and meets the BSDFs in Importance mode: the adjoint of all the rest.

    Seen by a perspective camera, because ptracer connects to the sensor; means over the image.
    """
    T = mi.ScalarTransform4f
    sensor = {"type": "perspective", "fov": 40, "to_world": T().look_at(origin=[-8, -6, 10], target=[0, 0, 1], up=[0, 0, 1]), "film": {**FILM, "width": 4, "height": 4}}
    light, eye = (runs(room(plate, integrator, sensor, sky=None), 16, spp).mean(axis=(1, 2)) for integrator, spp in
                  (({"type": "ptracer", "max_depth": 3, "rr_depth": 100}, 16384), ({"type": "bounce_path", "max_bounces": 2, "emitter_sampling": True}, 256)))
    error = np.sqrt((light.var(ddof=1) + eye.var(ddof=1)) / 16)
    assert error < 0.01 * eye.mean()
    assert abs(light.mean() - eye.mean()) < SIGMAS * error


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_emitted_and_reflected_are_counted_once(plate, integrator):
    """A plate under a uniform sky: emissivity 1 shows only itself, 0 only the sky, Kirchhoff's at the sky's temperature the
    blackbody, and a plate that is given an emissivity of 1 although it reflects shows both in full."""
    sky, own = 20.0, blackbody(400)
    equal = blackbody(350)
    ideal = {"type": "sandford_robertson", "b": 0.0, "e": 1.0}
    cases = [({**ideal, "epsilon": 1.0, "rho_d": 0.0}, {}, 400, sky, own), ({**ideal, "epsilon": 0.0, "rho_d": 1.0}, {}, 400, sky, sky),
             (BROAD, {}, 350, equal, equal), ({**BROAD, "lobe": "mirror"}, {}, 350, equal, equal),
             (GREY, {"emissivity": 0.0}, 400, sky, 0.3 * sky), (GREY, {"emissivity": 1.0}, 400, sky, own + 0.3 * sky)]
    for bsdf, given, temperature, radiance, expected in cases:
        scene = mi.load_dict({"type": "scene", "integrator": INTEGRATORS[integrator], "sensor": camera(2), "p": with_emitter(plate("p", SQUARE, bsdf, temperature), **given),
                              "sky": {"type": "constant", "radiance": {"type": "uniform", "value": radiance}}}, optimize=False)
        images = runs(scene, 8, 512)
        error = images.mean(axis=(1, 2)).std(ddof=1) / np.sqrt(8)
        assert abs(images.mean() - expected) < 6 * error + 2e-5 * expected, (bsdf, given)      # t with 7 degrees of freedom: 1 in 2000
