"""One battery for every reflection model: sampling, density, value, reflectance and emissivity must
tell the same story.
"""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.physics.reflection import models
from tests.physics.reflection import microfacet_equations as printed
from tests.physics.reflection.surfaces import random_parameters
from tests.plugins.reflection_models import (
    LOBES,
    MODELS,
    HalfVectorDomain,
    exact_HDR,
    interaction,
    seen_at,
    uniform,
)

ANGLES = np.radians([0, 30, 60, 80, 85, 89])
SAMPLES = 1 << 16  # per angle
SIGMAS = 5  # standard errors: one failure in 1.7 million comparisons of correct numbers
every_model = pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
every_density = pytest.mark.parametrize(
    "model", [model for model in MODELS if not model.is_delta], ids=lambda model: model.name
)
CHI2 = [(model, theta_deg) for model in MODELS if not model.is_delta for theta_deg in (2, 45, 80)]


def sample(bsdf, angles=ANGLES, count=SAMPLES, seed=0):
    si = seen_at(np.repeat(angles, count), 0.3)
    u, v, w = uniform(len(angles) * count, 3, seed)
    return si, *bsdf.sample(mi.BSDFContext(), si, u, mi.Point2f(v, w))


@pytest.mark.slow
@pytest.mark.parametrize("model, theta_deg", CHI2, ids=lambda value: getattr(value, "name", value))
def test_samples_follow_the_density(model, theta_deg):
    """Chi-square over 64 x 64 cells of the lobe's own half-vectors, half a million samples; all
    cases together err once in 100.
    """
    bsdf = model.load()
    si = seen_at(np.radians(theta_deg), 0.3)
    domain = HalfVectorDomain(si.wi, model.width)

    def draw(uniform):
        bs, weight = bsdf.sample(
            mi.BSDFContext(), si, uniform[0], mi.Point2f(uniform[1], uniform[2])
        )
        drawn = (bs.pdf > 0) & (bs.wo.z > 0)
        # What lies below the surface counts nothing; its half-vector may lie outside the domain.
        return dr.select(drawn, bs.wo, si.wi), dr.select(drawn, 1.0, 0.0)

    test = mi.chi2.ChiSquareTest(
        domain,
        draw,
        lambda wo: bsdf.pdf(mi.BSDFContext(), si, wo) * domain.jacobian(wo),
        sample_dim=3,
        sample_count=500_000,
        res=64,
        ires=16,
    )
    assert test.run(significance_level=0.01, test_count=len(CHI2), quiet=True), test.messages
    assert test.pdf_sum[0] == pytest.approx(test.histogram_sum[0], abs=2e-3)


@pytest.mark.slow
@every_model
def test_reflectance_by_sampling_is_the_quadrature_s(model):
    bsdf = model.load()
    _, _, weight = sample(bsdf)
    weight = weight[0].numpy().astype(float).reshape(len(ANGLES), SAMPLES)
    mean, error = weight.mean(axis=1), weight.std(axis=1) / np.sqrt(SAMPLES)
    assert np.all(weight >= 0) and np.all(mean <= 1 + SIGMAS * error + 1e-6)
    HDR = model.HDR(bsdf, ANGLES)
    if HDR is not None:
        assert np.all(
            np.abs(mean - HDR) <= SIGMAS * error + 1e-5
        )  # 1e-5: of the tabulated HDR that the BRDF is divided by


@pytest.mark.slow
@every_density
def test_weight_is_value_over_density(model):
    bsdf, ctx = model.load(), mi.BSDFContext()
    si, bs, weight = sample(bsdf)
    value, density = bsdf.eval_pdf(ctx, si, bs.wo)
    drawn = ((bs.pdf > 0) & (bs.wo.z > 0)).numpy()
    tolerance = (
        1e-6 if model.is_ours else 2e-3
    )  # stock Mitsuba's weight is simplified, and rounds differently at grazing angles
    np.testing.assert_allclose(bs.pdf.numpy()[drawn], density.numpy()[drawn], rtol=tolerance)
    np.testing.assert_allclose(
        (weight[0] * bs.pdf).numpy()[drawn], value[0].numpy()[drawn], rtol=tolerance, atol=1e-7
    )
    assert np.all(weight[0].numpy()[~drawn] == 0)
    np.testing.assert_allclose(dr.norm(bs.wo).numpy(), 1, rtol=1e-5)


@pytest.mark.slow
@every_model
def test_eval_pdf_is_eval_and_pdf(model):
    bsdf, ctx = model.load(), mi.BSDFContext()
    si, bs, _ = sample(bsdf, count=1000)
    u, v = uniform(dr.width(si), 2, seed=1)
    wo = dr.select(u < 0.5, mi.warp.square_to_uniform_sphere(mi.Point2f(2 * u, v)), bs.wo)
    value, density = bsdf.eval_pdf(ctx, si, wo)
    np.testing.assert_array_equal(value[0], bsdf.eval(ctx, si, wo)[0])
    np.testing.assert_array_equal(density, bsdf.pdf(ctx, si, wo))
    if not model.is_delta and model.name != "blackbody-brdf":
        assert np.all(
            density.numpy()[(value[0].numpy() > 0)] > 0
        )  # what is reflected can be sampled


@pytest.mark.slow
@pytest.mark.parametrize(
    "model",
    [model for model in MODELS if model.name != "roughconductor"],
    ids=lambda model: model.name,
)
def test_at_the_horizon_and_beyond(model):
    """From below and from the horizon itself: nothing, not NaN. Just above it: finite, not
    negative. (Stock `roughconductor` gives NaN at 1e-20 of the horizon.)
    """
    bsdf, ctx = model.load(), mi.BSDFContext()
    cos = np.array([1, 0.5, 1e-3, 1e-7, 1e-20, 1e-38, 0, -1e-38, -1e-7, -0.5, -1], dtype=np.float32)
    cos_i, cos_o = (mi.Float(grid.ravel()) for grid in np.meshgrid(cos, cos))
    si = interaction(mi.Vector3f(dr.safe_sqrt(1 - dr.square(cos_i)), 0, cos_i))
    wo = mi.Vector3f(-dr.safe_sqrt(1 - dr.square(cos_o)), 0, cos_o)
    u, v, w = uniform(dr.width(wo), 3)
    bs, weight = bsdf.sample(ctx, si, u, mi.Point2f(v, w))
    value, density = bsdf.eval_pdf(ctx, si, wo)
    below = (cos_i <= 0).numpy() | (cos_o <= 0).numpy()
    value, density, weight, pdf = (
        np.broadcast_to(numbers.numpy(), len(below))
        for numbers in (value[0], density, weight[0], bs.pdf)
    )
    for numbers in (value, density, weight, pdf):
        assert np.all(np.isfinite(numbers)) and np.all(numbers >= 0)
    assert np.all(value[below] == 0) and np.all(density[below] == 0)
    assert np.all(weight[(cos_i <= 0).numpy()] == 0)
    if model.is_ours:
        emissivity = bsdf.eval_attribute_1("emissivity", si).numpy()
        assert np.all((emissivity >= 0) & (emissivity <= 1)) and np.all(
            emissivity[(cos_i <= 0).numpy()] == 0
        )


# ------------------------------------------------------- Properties of reflection models' BSDFs

OURS = [model for model in MODELS if model.is_ours]
every_rung = pytest.mark.parametrize("model", OURS, ids=lambda model: model.name)


@pytest.mark.slow
@every_rung
def test_inactive_lanes_are_zero(model):
    bsdf, ctx, off = model.load(), mi.BSDFContext(), mi.Bool(False)
    si = seen_at(ANGLES)
    _, weight = bsdf.sample(ctx, si, mi.Float(0.3), mi.Point2f(0.4, 0.6), off)
    for numbers in (
        bsdf.eval(ctx, si, si.wi, off)[0],
        bsdf.pdf(ctx, si, si.wi, off),
        weight[0],
        bsdf.eval_attribute_1("emissivity", si, off),
    ):
        assert np.all(numbers.numpy() == 0)


@pytest.mark.slow
@every_rung
def test_emissivity_is_what_is_not_reflected(model):
    """The default, Kirchhoff's law seen from the observer, on every rung; 1e-5 is the table's
    accuracy.
    """
    bsdf = model.load()
    assert bsdf.has_attribute("emissivity") and not bsdf.has_attribute("temperature")
    emissivity = bsdf.eval_attribute_1("emissivity", seen_at(ANGLES, 0.3)).numpy()
    np.testing.assert_allclose(emissivity, 1 - model.HDR(bsdf, ANGLES), rtol=0, atol=1e-5)


def test_the_emissivity_of_a_metal_rises_toward_grazing():
    """A narrow microfacet lobe against 1 - F by Fresnel's complex amplitudes."""
    theta = np.radians([0, 30, 60, 80])
    metal = {"alpha": 1e-3, "gamma": 4.0, "n": 10.0, "k": 30.0, "rho_d": 0.0}
    bsdf = mi.load_dict({"type": "microfacet", **metal})
    emissivity = bsdf.eval_attribute_1("emissivity", seen_at(theta)).numpy()
    fresnel = 1 - printed.fresnel(np, np.cos(theta), 10, 30)
    np.testing.assert_allclose(emissivity, fresnel, rtol=1e-4)
    assert emissivity[-1] > 1.5 * emissivity[0]


def points_of_the_box(model, count=30):
    """Parameters (count, n) on the feasible set and its faces."""
    if model.name == "sandford_robertson":
        return random_parameters(count, seed=4)
    rng = np.random.default_rng(4)
    u = rng.random((count, len(model.parameters)))
    u = np.where(rng.random(u.shape) < 0.2, rng.integers(0, 2, u.shape), u)
    return np.array([model.values_at(row) for row in u])


@pytest.mark.slow
@pytest.mark.parametrize(
    "model, form",
    [(model, form) for model in models.MODELS.values() for form in model.forms],
    ids=lambda value: getattr(value, "name", value),
)
def test_energy_and_emissivity_over_the_whole_box(model, form):
    """30 surfaces on the feasible set and its faces: 0 <= emissivity <= 1, and no more is reflected
    than arrives.

    10 / count: reflections below the horizon so rare that none need show among the samples
    (probability e^-10).
    """
    count = 1 << 14
    for k, parameters in enumerate(points_of_the_box(model)):
        bsdf = mi.load_dict(
            {
                "type": model.name,
                "form": form,
                **dict(zip(model.names, map(float, parameters))),
            }
        )
        emissivity = bsdf.eval_attribute_1("emissivity", seen_at(ANGLES)).numpy()
        assert np.all((emissivity >= 0) & (emissivity <= 1))
        np.testing.assert_allclose(
            emissivity, 1 - np.minimum(exact_HDR(bsdf, ANGLES), 1), rtol=0, atol=1e-5
        )
        for lobe in LOBES:
            bsdf.set_lobe(lobe)
            weight = (
                sample(bsdf, count=count, seed=k)[2][0]
                .numpy()
                .astype(float)
                .reshape(len(ANGLES), count)
            )
            error = weight.std(axis=1) / np.sqrt(count)
            assert np.all(weight >= 0)
            assert np.all(
                weight.mean(axis=1) + emissivity <= 1 + SIGMAS * error + 1e-5 + 10 / count
            ), (lobe, parameters)


@pytest.mark.slow
@pytest.mark.parametrize(
    "model", [model for model in OURS if not model.is_delta], ids=lambda model: model.name
)
def test_importance_swaps_source_and_observer(model):
    bsdf, importance = model.load(), mi.BSDFContext(mi.TransportMode.Importance)
    a, b = (
        seen_at(np.radians([10, 40, 70, 88]), 0.4),
        seen_at(np.radians([80, 41, 20, 87]), 0.4 + np.pi),
    )
    swapped = bsdf.eval(importance, a, b.wi)[0] / b.wi.z
    np.testing.assert_allclose(swapped, bsdf.eval(mi.BSDFContext(), b, a.wi)[0] / a.wi.z, rtol=1e-5)
    bs, weight = bsdf.sample(importance, a, mi.Float(0.3), mi.Point2f(0.4, 0.6))
    np.testing.assert_allclose(
        (weight[0] * bs.pdf).numpy(), bsdf.eval(importance, a, bs.wo)[0].numpy(), rtol=1e-5
    )


@pytest.mark.parametrize(
    "lobe, kind",
    [("brdf", "GlossyReflection"), ("mirror", "DeltaReflection"), ("diffuse", "DiffuseReflection")],
)
def test_flags(lobe, kind):
    model = next(model for model in OURS if model.name == f"gloss_black-LWIR-{lobe}")
    bsdf = model.load()
    others = {"GlossyReflection", "DeltaReflection", "DiffuseReflection"} - {kind}
    assert mi.has_flag(bsdf.flags(), getattr(mi.BSDFFlags, kind)) and mi.has_flag(
        bsdf.flags(), mi.BSDFFlags.FrontSide
    )
    assert not any(
        mi.has_flag(bsdf.flags(), getattr(mi.BSDFFlags, other)) for other in (*others, "BackSide")
    )
    assert bsdf.component_count() == 1
    bs, _ = bsdf.sample(mi.BSDFContext(), seen_at(0.5), mi.Float(0.3), mi.Point2f(0.4, 0.6))
    assert mi.has_flag(bs.sampled_type, getattr(mi.BSDFFlags, kind))[0]


def test_mirror_reflects_into_the_mirror_direction():
    model = next(model for model in OURS if model.name == "gloss_black-LWIR-mirror")
    bsdf = model.load()
    si, bs, weight = sample(bsdf, count=1)
    np.testing.assert_array_equal(bs.wo, mi.reflect(si.wi))
    np.testing.assert_allclose(weight[0], model.HDR(bsdf, ANGLES), rtol=0, atol=1e-5)


def test_rungs_reflect_the_same_total():
    """They differ only in where the light comes from; 0.5 % is the scatter of the sampled brdf."""
    bsdf = OURS[0].load()
    totals = []
    for lobe in LOBES:
        bsdf.set_lobe(lobe)
        totals.append(sample(bsdf)[2][0].numpy().reshape(len(ANGLES), -1).mean(axis=1))
    np.testing.assert_allclose(totals[1], totals[2], rtol=1e-6)
    np.testing.assert_allclose(totals[0], totals[1], rtol=5e-3)
    with pytest.raises(InputError, match="unknown lobe 'glossy'; known: "):
        bsdf.set_lobe("glossy")


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"epsilon": 0.9, "rho_d": 0.2}, r"epsilon \+ rho_d = 1.1; .* G\(b\) = 0.7"),
        ({"b": 2.0}, r"b = 2; .* 0\.\.1"),
        ({"e": 0.0}, "e = 0; "),
        ({"lobe": "glossy"}, "unknown lobe 'glossy'; known: "),
        ({"form": "exact"}, "unknown form 'exact'; known: thesis, normalized"),
        ({"emissivity": "nowhere.csv"}, "nowhere.csv"),
        ({"epsilonn": 0.1}, "epsilonn"),
        ({"epsilon": None}, "give `material` and `band`, or epsilon"),
        ({"material": "gold", "band": "MWIR"}, "gold"),
        ({"material": "gloss_black", "band": "SWIR"}, "SWIR"),
    ],
)
def test_bad_input_is_named(changes, message):
    """Mitsuba's loader wraps a plugin's exception; the message survives."""
    plugin = {
        "type": "sandford_robertson",
        "epsilon": 0.2,
        "rho_d": 0.1,
        "b": 0.5,
        "e": 0.3,
        **changes,
    }
    if "material" in changes:
        plugin = {"type": "sandford_robertson", **changes}
    with pytest.raises(RuntimeError, match=message):
        mi.load_dict({name: value for name, value in plugin.items() if value is not None})


def test_an_infeasible_update_is_refused():
    bsdf = mi.load_dict(
        {"type": "sandford_robertson", "epsilon": 0.2, "rho_d": 0.1, "b": 0.5, "e": 0.3}
    )
    params = mi.traverse(bsdf)
    params["epsilon"] = mi.Float(0.99)
    with pytest.raises(InputError, match=r"epsilon \+ rho_d"):
        params.update()
    params["epsilon"] = mi.Float(0.4)
    params.update()
    np.testing.assert_allclose(
        bsdf.eval_attribute_1("emissivity", seen_at(ANGLES)),
        1 - exact_HDR(bsdf, ANGLES),
        rtol=0,
        atol=1e-5,
    )
