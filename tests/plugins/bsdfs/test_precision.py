"""How well the plugin, which computes in Float32, keeps the model: value, tabulated reflectance,
scatter of samples.
"""

import mitsuba as mi
import numpy as np
import pytest
from drjit.llvm.ad import Array3f64

from mi_lcair.physics import reflection
from mi_lcair.physics.reflection import sandford_robertson_equations as sr
from tests.physics import thesis
from tests.physics.reflection.surfaces import MATERIALS, direction, random_parameters
from tests.physics.reflection.test_microfacet import random_parameters as microfacet_parameters
from tests.plugins.reflection_models import exact_HDR, exact_surface, interaction, seen_at

PAIRS = 6000  # of directions, per surface
SANDFORD_ROBERTSON, MICROFACET = (
    reflection.model(name) for name in ("sandford_robertson", "microfacet")
)
FORMS = [(model, form) for model in (SANDFORD_ROBERTSON, MICROFACET) for form in model.forms]
every_form = pytest.mark.parametrize(
    "model, form", FORMS, ids=lambda one: getattr(one, "name", one)
)
LIMIT = np.radians(89.5)


def load(model, parameters, form):
    return mi.load_dict(
        {"type": model.name, "form": form, **dict(zip(model.names, map(float, parameters)))}
    )


def narrow_and_broad_lobes(count):
    """Rows with e from 0.0015 to 0.6; every third with epsilon + rho_d within 1e-6 of G."""
    rows = random_parameters(count, seed=8)
    rng = np.random.default_rng(8)
    rows[:, 3] = np.exp(rng.uniform(np.log(0.0015), np.log(0.6), count))
    rows[:4, 3] = 0.0015, 0.0015, 0.6, 0.0042
    near = np.arange(count) % 3 == 0
    bound = sr.surface(*(mi.Float64(column) for column in rows.T)).G.numpy()
    share = rng.random(count)
    total = bound * (1 - 1e-6 * rng.random(count))
    rows[near, :2] = (total * np.array([share, 1 - share])).T[near]
    return rows


def pairs_of_directions(e, rng):
    """(i, r) to 89.5 degrees in Float32: half of them anywhere, half on the flanks of the lobe
    around the mirror direction, where the half-vector is 0.03 to 30 lobe widths off the normal.
    """
    theta_r = np.where(
        rng.random(PAIRS) < 0.5,
        LIMIT * rng.random(PAIRS),
        np.arccos(rng.uniform(np.cos(LIMIT), 1, PAIRS)),
    )
    r = direction(theta_r, 2 * np.pi * rng.random(PAIRS)).numpy()
    slope, azimuth = e * 10 ** rng.uniform(-1.5, 1.5, PAIRS), 2 * np.pi * rng.random(PAIRS)
    half = np.array([slope * np.cos(azimuth), slope * np.sin(azimuth), np.ones(PAIRS)])
    half /= np.linalg.norm(half, axis=0)
    flank = 2 * np.sum(r * half, axis=0) * half - r
    anywhere = direction(
        np.arccos(rng.uniform(np.cos(LIMIT), 1, PAIRS)), 2 * np.pi * rng.random(PAIRS)
    ).numpy()
    i = np.where((rng.random(PAIRS) < 0.5) & (flank[2] > np.cos(LIMIT)), flank, anywhere)
    return i.astype(np.float32), r.astype(np.float32)


def theta_of(vectors):
    """Angle to the normal, in Float64, of the Float32 vectors that the plugin gets."""
    x, y, z = np.array(vectors, dtype=float)
    return np.arctan2(np.hypot(x, y), z)


@pytest.mark.slow
@every_form
def test_value_in_float32(model, form):
    """Against Float64 at the identical Float32 vectors and parameters, the division by max(1, HDR)
    included.
    """
    rng, errors = np.random.default_rng(9), []
    if model is SANDFORD_ROBERTSON:
        rows = narrow_and_broad_lobes(20)
    else:
        rows = microfacet_parameters(20, seed=8)
    for row in rows:
        bsdf = load(model, row, form)
        i, r = pairs_of_directions(float(model.lobe_width(bsdf.surface)[0]), rng)
        found = (
            (bsdf.eval(mi.BSDFContext(), interaction(mi.Vector3f(r)), mi.Vector3f(i))[0])
            .numpy()
            .astype(float)
        )
        exact = model.f(exact_surface(bsdf), Array3f64(i), Array3f64(r)).numpy() * i[2]
        if model is SANDFORD_ROBERTSON:  # the other model's HDR is at most 1
            exact /= np.maximum(exact_HDR(bsdf, theta_of(r)), 1)
        errors.append(np.abs(found - exact) / np.maximum(np.abs(exact), 1e-30))
    errors = np.concatenate(errors)
    print(form, "median, 99.9 % and largest relative error:", np.quantile(errors, [0.5, 0.999, 1]))
    assert np.mean(errors <= 1e-5) >= 0.999
    assert errors.max() <= 1e-3


def largest_error_of_HDR(bsdf):
    """Of the table after interpolation, in HDR as rendered: relative where the raw model exceeds 1
    and is divided by it.
    """
    si = seen_at(
        np.concatenate(
            [np.linspace(0, np.radians(85), 1000), np.linspace(np.radians(85), LIMIT, 1000)]
        )
    )
    floor, lobe = bsdf.raw_HDR(sr.cos_theta(si.wi), sr.sin2_theta(si.wi))
    exact = exact_HDR(bsdf, theta_of(si.wi))
    return np.max(np.abs((floor + lobe).numpy() - exact) / np.maximum(exact, 1))


def test_the_stated_error_of_the_emissivity_holds():
    """That of 1 - HDR in single precision, to 60 degrees, in 95 % intervals; a mirror has none."""
    si, ratios = seen_at(np.radians(np.linspace(0, 60, 200))), []
    for row in [*MATERIALS, *random_parameters(12, seed=3)]:
        bsdf = load(SANDFORD_ROBERTSON, row, "thesis")
        exact = 1 - exact_HDR(bsdf, theta_of(si.wi))
        if exact[0] > 0.01:
            error = np.abs(bsdf.eval_attribute_1("emissivity", si).numpy() / exact - 1)
            ratios.append(error.max() / (1.96 * bsdf.relative_error))
    assert len(ratios) > 8
    assert max(ratios) < 1
    assert max(ratios) > 0.2  # nor is it far too large
    assert mi.load_dict({"type": "grey", "emissivity": 0.0}).relative_error == 0


@pytest.mark.slow
@every_form
def test_tabulated_HDR(model, form):
    """To 89.5 degrees: 1e-5 over the whole box, and for the materials."""
    if model is SANDFORD_ROBERTSON:
        rows = [*MATERIALS, *random_parameters(20, seed=11), *narrow_and_broad_lobes(10)]
    else:
        rows = microfacet_parameters(8, seed=11)
    errors = [largest_error_of_HDR(load(model, row, form)) for row in rows]
    print(form, f"{max(errors):.1e}")
    assert max(errors) <= 1e-5


@pytest.mark.slow
@pytest.mark.parametrize(
    "material, angles_deg, bound",
    [("bare_aluminum", range(0, 61, 10), 0.01), ("gloss_black", range(0, 86, 5), 0.1)],
)
@pytest.mark.parametrize("band", ["MWIR", "LWIR"])
def test_scatter_of_one_reflectance_sample(material, angles_deg, bound, band):
    """Relative standard deviation of one sample's weight w = f cos / pdf, by quadrature over all
    samples: the rare ones (a reflection below the horizon, w = 0, or the floor's into the lobe)
    make up half of it and hide from an estimate by sampling.
    """
    bsdf = mi.load_dict({"type": "sandford_robertson", "material": material, "band": band})
    scatter = []
    for theta in np.radians(angles_deg):
        theta_i, phi, solid_angle = (
            grid.ravel() for grid in thesis.hemisphere(theta, 2 * bsdf.parameters["e"][0])
        )
        value, density = bsdf.eval_pdf(
            mi.BSDFContext(),
            seen_at(np.full(len(phi), theta)),
            direction(theta_i, np.pi - phi, mi.Vector3f),
        )
        weight, probability = (
            (value[0] / density).numpy().astype(float),
            density.numpy() * solid_angle,
        )
        mean, lost = np.sum(weight * probability), 1 - np.sum(probability)
        assert -1e-6 < lost < 1e-3
        scatter.append(np.sqrt(np.sum((weight - mean) ** 2 * probability) + lost * mean**2) / mean)
    print(material, band, dict(zip(angles_deg, np.round(scatter, 4).tolist())))
    assert max(scatter) <= bound
