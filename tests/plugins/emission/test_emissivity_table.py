"""Tabulated emissivities of stock BSDFs: right within the error that they state, made again when a
parameter changes, and differentiable.
"""

import gc

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mi_lcair.plugins.emission.emissivity import NODES, emissivity_of
from tests.plugins.small_scenes import INTEGRATORS, SQUARE, blackbody, camera, scene
from tests.plugins.test_derivatives import assert_derivatives

METAL = {"type": "roughconductor", "eta": 10.0, "k": 30.0, "alpha": 0.3}
GLOSSY = {
    "roughconductor": {**METAL, "distribution": "ggx", "specular_reflectance": 0.9},
    "conductor": {"type": "conductor", "eta": 10.0, "k": 30.0, "specular_reflectance": 0.9},
    "roughplastic": {
        "type": "roughplastic",
        "diffuse_reflectance": 0.2,
        "specular_reflectance": 0.9,
    },
    "plastic": {"type": "plastic", "diffuse_reflectance": 0.2, "specular_reflectance": 0.9},
}


@pytest.fixture(autouse=True)
def no_remains():
    """Frees scenes with tables that are out of date: Dr.Jit's calls reach every emitter alive."""
    yield
    gc.collect()


def integral(bsdf, cosines, rings=700):
    """HDR by a quadrature of `eval`: Gauss-Legendre in the cosine, even steps in azimuth."""
    x, weight = np.polynomial.legendre.leggauss(rings)
    azimuth = (np.arange(2 * rings) + 0.5) * np.pi / rings
    cos, phi = (grid.ravel() for grid in np.meshgrid((x + 1) / 2, azimuth, indexing="ij"))
    sin = np.sqrt(1 - cos**2)
    wo = mi.Vector3f(sin * np.cos(phi), sin * np.sin(phi), cos)
    weight = np.repeat(weight / 2 * np.pi / rings, 2 * rings)
    found = []
    for cosine in cosines:
        si = dr.zeros(mi.SurfaceInteraction3f, dr.width(wo))
        si.wi = mi.Vector3f(float(np.sqrt(1 - cosine**2)), 0, float(cosine))
        si.n, si.sh_frame = mi.Normal3f(0, 0, 1), mi.Frame3f(mi.Normal3f(0, 0, 1))
        value = bsdf.eval(mi.BSDFContext(), si, wo)[0].numpy().astype(np.float64)
        found.append(value @ weight)
    return np.array(found)


@pytest.mark.slow
@pytest.mark.parametrize("distribution", ["ggx", "beckmann"])
def test_the_table_is_right_within_what_it_states(distribution):
    """Every sixth node against the quadrature, to 2e-4 and within 4.5 of the stated standard
    error.

    Beckmann without visible normals: Mitsuba draws those approximately, and reflects by its samples
    up to 0.003 more or less than its `eval` says.
    """
    visible = distribution == "ggx"
    bsdf = mi.load_dict({**METAL, "distribution": distribution, "sample_visible": visible})
    table = emissivity_of(bsdf)
    cosines = np.linspace(0, 1, NODES)[2::6] ** 2
    difference = table.derived[0].numpy()[2::6] - (1 - integral(bsdf, cosines))
    assert np.abs(difference).max() < 2e-4
    assert 1e-6 < table.error < 1e-4 and np.abs(difference).max() < 4.5 * table.error


@pytest.mark.slow
def test_between_the_nodes(plate):
    """Straight lines between the nodes add at most 5e-5."""
    table = emissivity_of(mi.load_dict(METAL))
    values = table.derived[0].numpy().astype(np.float64)
    curvature = np.abs(np.diff(values, 2)).max()
    assert curvature / 8 < 5e-5


@pytest.mark.slow
def test_unlike_tables_have_unlike_errors_and_the_same_the_same():
    """The id seeds the points; all else is alike."""

    def values(name):
        loaded = mi.load_dict(
            {"type": "scene", "s": {"type": "sphere", "bsdf": {**METAL, "id": name}}}
        )
        return emissivity_of(loaded.shapes()[0].bsdf()).derived[0].numpy()

    one, again, other = values("one"), values("one"), values("other")
    np.testing.assert_array_equal(one, again)
    assert np.abs(one - other).max() > 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("name", GLOSSY)
def test_an_update_of_the_bsdf_is_honoured(plate, name):
    """A plate whose reflectance falls emits as one that is loaded so; twice, as Dr.Jit uses the
    indices of its variables again.
    """
    emission = {"type": "bounce_path", "max_bounces": 0}

    def image(loaded):
        return np.array(mi.render(loaded, spp=4)).mean()

    changing = scene(emission, camera(2), mesh=plate("p", SQUARE, GLOSSY[name], 400))
    params = mi.traverse(changing)
    key = next(key for key, _ in params if key.endswith("specular_reflectance.value"))
    for reflectance in (0.3, 0.7):
        image(changing)
        params[key] = mi.Float(0.5)
        params.update()
        params[key] = mi.Float(reflectance)
        params.update()
        bsdf = {**GLOSSY[name], "specular_reflectance": reflectance}
        fresh = scene(emission, camera(2), mesh=plate("q", SQUARE, bsdf, 400))
        assert image(changing) == pytest.approx(image(fresh), abs=3e-4 * blackbody(400))


@pytest.mark.slow
def test_a_stock_integrator_meets_a_new_table(plate):
    """It records a loop when it meets an old table, which is computed again all the same."""

    def image(loaded):
        return np.array(mi.render(loaded, spp=4)).mean()

    changing = scene(INTEGRATORS["path"], camera(2), mesh=plate("p", SQUARE, METAL, 400))
    before = image(changing)
    params = mi.traverse(changing)
    params["mesh.bsdf.alpha.value"] = mi.Float(0.6)
    params.update()
    after = image(changing)
    rough = {**METAL, "alpha": 0.6}
    fresh = image(scene(INTEGRATORS["path"], camera(2), mesh=plate("q", SQUARE, rough, 400)))
    assert abs(after / before - 1) > 0.01
    assert after == pytest.approx(fresh, abs=3e-4 * blackbody(400))


@pytest.mark.slow
@pytest.mark.parametrize(
    "name, parameter, step",
    [
        ("roughconductor", "alpha.value", 0.01),
        ("plastic", "diffuse_reflectance.value", 0.02),
    ],
)
def test_derivatives(corner, plate, name, parameter, step):
    """Forward and reverse, through emission and reflection at once."""
    corners = [[0, 0, 0], [0.2, 0, 0], [0.2, 0.1, 0], [0, 0.1, 0]]

    def make():
        floor = plate("floor", corners, GLOSSY[name], 500.0, group="floor")
        return corner({"type": "bounce_path", "max_bounces": 2}, floor=floor)

    assert_derivatives(make, f"floor.bsdf.{parameter}", step)


@pytest.mark.slow
def test_the_derivative_of_emission_alone(plate):
    """A perfect conductor reflects `specular_reflectance` at all angles: minus one blackbody."""
    bsdf = {"type": "conductor", "eta": 0.0, "k": 1.0, "specular_reflectance": 0.9}
    one_plate = scene(
        {"type": "bounce_path", "max_bounces": 0}, camera(2), mesh=plate("p", SQUARE, bsdf, 400)
    )
    params = mi.traverse(one_plate)
    key = "mesh.bsdf.specular_reflectance.value"
    dr.enable_grad(params[key])
    params.update()
    dr.backward(dr.mean(mi.render(one_plate, params, spp=4), axis=None))
    assert dr.grad(params[key])[0] == pytest.approx(-blackbody(400), rel=1e-3)
