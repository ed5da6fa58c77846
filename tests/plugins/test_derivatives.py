"""Derivatives of the image by path replay against central differences of the rendered radiance.

The floor emits and is hotter than what it reflects, so its parameters act through the emissivity table as well as through
the reflection. Means over 8 seeds; AD and differences must agree within 2 % or within 3 joint standard errors.
"""
import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

SEEDS, SPP = 8, 128
STEPS = {"floor.bsdf.epsilon": 0.02, "floor.bsdf.rho_d": 0.03, "floor.bsdf.b": 0.01, "floor.bsdf.e": 0.005,
         "floor.emitter.temperature": 2.0, "left.emitter.temperature": 2.0}
NARROW = {"epsilon": 0.11, "rho_d": 0.02, "b": 0.05, "e": 0.0042}


def mean_image(scene, seed, parameters=None):
    return dr.mean(mi.render(scene, parameters, spp=SPP, seed=seed), axis=None)


def central_difference(make, key, step, index=0):
    """Mean over the seeds and its standard error; the same random numbers on both sides."""
    sides = []
    for sign in (1, -1):
        scene = make()
        parameters = mi.traverse(scene)
        values = np.array(parameters[key], dtype=np.float64)
        values[index] += sign * step
        parameters[key] = mi.Float(values)
        parameters.update()
        # pixel by pixel in Float64: the differences are small beside the radiance
        sides.append([np.array(mi.render(scene, spp=SPP, seed=seed), dtype=np.float64).mean() for seed in range(SEEDS)])
    differences = (np.array(sides[0]) - sides[1]) / (2 * step)
    return differences.mean(), differences.std(ddof=1) / np.sqrt(SEEDS)


def prepared(make, keys, order):
    """Scene, its parameters, and the leaves that will carry the derivatives."""
    scene = make()
    parameters = mi.traverse(scene)
    if order == "computed":                # the scene's parameters are themselves computed from the leaves
        leaves = {key: mi.Float(np.array(parameters[key])) for key in keys}
        dr.enable_grad(leaves)
        for key, leaf in leaves.items():
            parameters[key] = leaf * 1
        parameters.update()
        return scene, parameters, leaves
    if order == "update, enable":
        parameters.update()
    for key in keys:
        dr.enable_grad(parameters[key])
    if order == "enable, update":
        for key in keys:
            parameters.set_dirty(key)
        parameters.update()
    return scene, parameters, {key: parameters[key] for key in keys}


def reverse(make, keys, order, index=0):
    """Derivatives with respect to all keys at once: key -> (mean, standard error)."""
    found = {key: [] for key in keys}
    for seed in range(SEEDS):
        scene, parameters, leaves = prepared(make, keys, order)
        dr.backward(mean_image(scene, seed, parameters))
        for key in keys:
            found[key].append(float(dr.grad(leaves[key])[index]))
    return {key: (np.mean(values), np.std(values, ddof=1) / np.sqrt(SEEDS)) for key, values in found.items()}


def forward(make, key, order, index=0):
    values = []
    for seed in range(SEEDS):
        scene, parameters, leaves = prepared(make, [key], order)
        tangent = np.zeros(dr.width(leaves[key]))
        tangent[index] = 1
        image = mean_image(scene, seed, parameters)
        dr.set_grad(leaves[key], mi.Float(tangent))
        dr.forward_to(image)
        values.append(float(dr.grad(image).array[0]))
    return np.mean(values), np.std(values, ddof=1) / np.sqrt(SEEDS)


def assert_agree(measured, expected, what):
    (value, error), (reference, reference_error) = measured, expected
    assert abs(value - reference) <= max(0.02 * abs(reference), 3 * np.hypot(error, reference_error)), \
        f"{what}: {value:.5g} +- {error:.2g}, central difference {reference:.5g} +- {reference_error:.2g}"


@pytest.mark.parametrize("emitter_sampling", [False, True])
@pytest.mark.parametrize("lobe", ["brdf", "mirror", "diffuse"])
def test_forward_and_reverse(corner, lobe, emitter_sampling):
    integrator = {"type": "bounce_path", "max_bounces": 3, "emitter_sampling": emitter_sampling}

    def make():
        return corner(integrator, {"lobe": lobe})

    in_reverse = reverse(make, list(STEPS), "enable, update")
    for key, step in STEPS.items():
        expected = central_difference(make, key, step)
        assert_agree(in_reverse[key], expected, f"{key}, reverse")
        assert_agree(forward(make, key, "enable, update"), expected, f"{key}, forward")


@pytest.mark.parametrize("order", ["enable, update", "update, enable", "computed"])
def test_order_of_enabling_and_updating(corner, order):
    """Derived tables are attached whenever a derivative is asked for, not only if the scene was updated after enable_grad."""
    def make():
        return corner({"type": "bounce_path", "max_bounces": 2})

    key = "floor.bsdf.epsilon"
    expected = central_difference(make, key, STEPS[key])
    assert_agree(reverse(make, [key], order)[key], expected, "reverse")
    assert_agree(forward(make, key, order), expected, "forward")


@pytest.mark.parametrize("facet", [0, 1])
def test_facet_temperatures(corner, facet):
    def make():
        return corner({"type": "bounce_path", "max_bounces": 2}, floor_temperature=[450.0, 520.0])

    key = "floor.face_temperature"
    expected = central_difference(make, key, 2.0, facet)
    assert_agree(reverse(make, [key], "enable, update", facet)[key], expected, "reverse")
    assert_agree(forward(make, key, "update, enable", facet), expected, "forward")


def test_narrow_lobe(corner):
    """Bare aluminium, e = 0.0042: noisy in e, since the sampled directions do not move with it, but unbiased."""
    def make():
        return corner({"type": "bounce_path", "max_bounces": 2}, NARROW)

    steps = {"floor.bsdf.epsilon": 0.02, "floor.bsdf.b": 0.005, "floor.bsdf.e": 0.0004}
    found = reverse(make, list(steps), "enable, update")
    for key, step in steps.items():
        assert_agree(found[key], central_difference(make, key, step), key)


def test_memory_does_not_grow_with_bounces(corner):
    """Path replay: the peak of a reverse pass with 64 reflections is that with 2."""
    def peak(bounces):
        scene, parameters, _ = prepared(lambda: corner({"type": "bounce_path", "max_bounces": bounces}, resolution=64),
                                        ["floor.bsdf.epsilon"], "enable, update")
        dr.flush_malloc_cache()
        dr.detail.malloc_clear_statistics()
        dr.backward(mean_image(scene, 0, parameters))
        dr.eval()
        return dr.detail.malloc_watermark(dr.AllocType.Host)

    assert peak(64) < 1.1 * peak(2)


def test_stock_integrator_refuses_a_lost_derivative(corner):
    """Under stock prb nobody can attach the table after enable_grad: an error, not a silent zero."""
    scene, parameters, _ = prepared(lambda: corner({"type": "prb", "max_depth": 3}), ["floor.bsdf.epsilon"], "update, enable")
    with pytest.raises(RuntimeError) as caught:
        mean_image(scene, 0, parameters)
    chain = []
    error = caught.value
    while error is not None:
        chain.append(str(error))
        error = error.__cause__
    assert any("call params.update()" in text for text in chain)


def test_stock_prb_in_reverse(corner):
    """The stock integrator's reverse derivative through our plugins, in the order that it supports."""
    def make():
        return corner({"type": "prb", "max_depth": 4, "rr_depth": 100})

    key = "floor.bsdf.epsilon"
    assert_agree(reverse(make, [key], "enable, update")[key], central_difference(make, key, STEPS[key]), key)


def test_tail_has_no_derivatives(corner):
    from mi_lcair.errors import InputError

    scene, parameters, _ = prepared(lambda: corner({"type": "bounce_path", "max_bounces": 3, "closure": "tail"}),
                                    ["floor.bsdf.epsilon"], "enable, update")
    with pytest.raises(Exception) as caught:
        dr.backward(mean_image(scene, 0, parameters))
    assert "closure = tail has no derivatives" in str(caught.value) + str(caught.value.__cause__)
