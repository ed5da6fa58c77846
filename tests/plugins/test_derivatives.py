"""Derivatives of the image by path replay against central differences of the rendered radiance.

The floor emits and is hotter than what it reflects, so its parameters act through the emissivity
table as well as through the reflection. Replay and differences must agree within 2 % or, where that
is less, within 3 joint standard errors, which come from the scatter of every pixel over the seeds.
"""

import subprocess
import sys

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mi_lcair.plugins.derivatives import own_memory
from tests.physics.reflection.surfaces import direction
from tests.plugins.reflection_models import seen_at

SEEDS, SPP = 2, 512
STEPS = {
    "floor.bsdf.epsilon": 0.02,
    "floor.bsdf.rho_d": 0.03,
    "floor.bsdf.b": 0.01,
    "floor.bsdf.e": 0.005,
    "floor.emitter.temperature": 2.0,
    "left.emitter.temperature": 2.0,
}
# Where b is tried too, the forward derivatives by these are left to the other cases
DIFFUSE = ("floor.bsdf.epsilon", "floor.bsdf.rho_d", "floor.emitter.temperature")
MICROFACET = {"type": "microfacet", "alpha": 0.2, "gamma": 2, "n": 3, "k": 2, "rho_d": 0.2}
FLAT = ("floor.bsdf.gamma", "floor.bsdf.k", "floor.bsdf.rho_d")
MICROFACET_STEPS = {"alpha": 0.01, "gamma": 0.1, "n": 0.2, "k": 0.2, "rho_d": 0.05}
NARROW = {"epsilon": 0.11, "rho_d": 0.02, "b": 0.05, "e": 0.0042}


def mean_image(scene, seed, parameters=None):
    return dr.mean(mi.render(scene, parameters, spp=SPP, seed=seed), axis=None)


def mean_and_error(images):
    """Mean over pixels and seeds of images (seeds, pixels), and its standard error; pixels are
    independent.
    """
    return images.mean(), np.sqrt(np.sum(images.var(axis=0, ddof=1) / len(images))) / images.shape[
        1
    ]


def central_difference(make, key, step, index=0):
    """Mean and standard error; the same random numbers on both sides."""
    sides, scene = [], make()
    parameters = mi.traverse(scene)
    middle = np.array(parameters[key], dtype=np.float64)
    for sign in (1, -1):
        values = middle.copy()
        values[index] += sign * step
        parameters[key] = mi.Float(values)
        parameters.update()
        sides.append(
            np.array(
                [np.array(mi.render(scene, spp=SPP, seed=seed)).ravel() for seed in range(SEEDS)],
                dtype=np.float64,
            )
        )
    return mean_and_error((sides[0] - sides[1]) / (2 * step))


def prepared(make, keys, order):
    """Scene, its parameters, and the leaves that will carry the derivatives."""
    scene = make()
    parameters = mi.traverse(scene)
    if order == "computed":  # the scene's parameters are themselves computed from the leaves
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
    """Derivatives with respect to all keys at once: key -> mean over the seeds."""
    found = {key: [] for key in keys}
    for seed in range(SEEDS):
        scene, parameters, leaves = prepared(make, keys, order)
        dr.backward(mean_image(scene, seed, parameters))
        for key in keys:
            found[key].append(float(dr.grad(leaves[key])[index]))
    return {key: np.mean(values) for key, values in found.items()}


def forward(make, key, order, index=0, keys=()):
    """Mean and standard error. The other keys have tangents of 0, so that all share one kernel."""
    images = []
    for seed in range(SEEDS):
        scene, parameters, leaves = prepared(make, keys or [key], order)
        image = mi.render(scene, parameters, spp=SPP, seed=seed)
        for name, leaf in leaves.items():
            tangent = np.zeros(dr.width(leaf))
            tangent[index] = name == key
            dr.set_grad(leaf, mi.Float(tangent))
        dr.forward_to(image)
        images.append(np.array(dr.grad(image)).ravel())
    return mean_and_error(np.array(images, dtype=np.float64))


def assert_derivatives(make, key, step, order="enable, update", index=0, in_reverse=None, no=()):
    """Forward and reverse derivative by `key` against the central difference; both estimate with
    the same error. no: keys without the forward one, all of whose errors are small.
    """
    reference, reference_error = central_difference(make, key, step, index)
    in_reverse = reverse(make, [key], order, index) if in_reverse is None else in_reverse
    found, error = {"reverse": in_reverse[key]}, 0.0
    if key not in no:
        found["forward"], error = forward(make, key, order, index, tuple(in_reverse))
    allowed = max(0.02 * abs(reference), 3 * np.hypot(error, reference_error))
    for mode, value in found.items():
        assert abs(value - reference) <= allowed, (
            f"{key}, {mode}: {value:.5g} +- {error:.2g}, "
            f"central difference {reference:.5g} +- {reference_error:.2g}"
        )


@pytest.mark.slow
@pytest.mark.parametrize(
    "lobe, emitter_sampling, keys",
    [
        ("brdf", True, list(STEPS)),
        ("brdf", False, ["floor.bsdf.b", "floor.bsdf.e", "floor.emitter.temperature"]),
        ("mirror", False, ["floor.bsdf.epsilon", "left.emitter.temperature"]),
        ("diffuse", True, ["floor.bsdf.epsilon", "floor.bsdf.rho_d"]),
    ],
)
def test_forward_and_reverse(corner, lobe, emitter_sampling, keys):
    def make():
        return corner(
            {"type": "bounce_path", "max_bounces": 3, "emitter_sampling": emitter_sampling},
            {"lobe": lobe},
        )

    in_reverse = reverse(make, keys, "enable, update")
    no = DIFFUSE if "floor.bsdf.b" in keys else ()
    for key in keys:
        assert_derivatives(make, key, STEPS[key], in_reverse=in_reverse, no=no)


@pytest.mark.slow
def test_microfacet(corner):
    def make():
        return corner({"type": "bounce_path", "max_bounces": 2}, MICROFACET)

    steps = {f"floor.bsdf.{name}": step for name, step in MICROFACET_STEPS.items()}
    in_reverse = reverse(make, list(steps), "enable, update")
    for key, step in steps.items():
        assert_derivatives(make, key, step, in_reverse=in_reverse, no=FLAT)


@pytest.mark.slow
def test_microfacet_at_k_0():
    """k enters the BRDF as k^2 only. At its bound 0 its derivative is therefore 0, and the others
    are finite.
    """
    bsdf = mi.load_dict({**MICROFACET, "k": 0.0})
    parameters = mi.traverse(bsdf)
    for name in MICROFACET_STEPS:
        dr.enable_grad(parameters[name])
        parameters.set_dirty(name)
    parameters.update()
    si = seen_at(np.radians([0, 45, 89]))
    wo = direction(np.radians([1, 50, 88]), np.pi, mi.Vector3f)
    dr.backward(bsdf.eval(mi.BSDFContext(), si, wo)[0] + bsdf.eval_attribute_1("emissivity", si))
    derivatives = {name: dr.grad(parameters[name])[0] for name in MICROFACET_STEPS}
    assert all(np.isfinite(derivative) for derivative in derivatives.values())
    assert derivatives.pop("k") == 0 and 0 not in derivatives.values()


@pytest.mark.slow
def test_the_table_has_the_same_reverse_derivative_each_time():
    """That of the sum of HDR's table with respect to n, five times, against the forward one."""

    def table():
        bsdf = mi.load_dict(MICROFACET)
        parameters = mi.traverse(bsdf)
        dr.enable_grad(parameters["n"])
        parameters.set_dirty("n")
        parameters.update()
        return parameters["n"], dr.sum(bsdf.derived[1])

    n, total = table()
    dr.forward(n)
    forward, found = dr.grad(total)[0], []
    for _ in range(5):
        n, total = table()
        dr.backward(total)
        found.append(dr.grad(n)[0])
    np.testing.assert_allclose(found, forward, rtol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("order", ["update, enable", "computed"])
def test_order_of_enabling_and_updating(corner, order):
    """Derived tables are attached whenever a derivative is asked for, not only if the scene was
    updated after enable_grad.
    """
    key = "floor.bsdf.epsilon"
    assert_derivatives(
        lambda: corner({"type": "bounce_path", "max_bounces": 2}), key, STEPS[key], order
    )


@pytest.mark.slow
@pytest.mark.parametrize("facet, order", [(0, "enable, update"), (1, "update, enable")])
def test_facet_temperatures(corner, facet, order):
    def make():
        return corner({"type": "bounce_path", "max_bounces": 2}, floor_temperature=[450.0, 520.0])

    assert_derivatives(make, "floor.face_temperature", 2.0, order, facet)


@pytest.mark.slow
def test_stock_integrator_derives_at_its_first_use(corner):
    """Gradients that are enabled before prb has met a plugin reach its table."""
    key, gradients = "floor.bsdf.epsilon", []
    for order in ("enable, update", "update, enable"):
        scene, parameters, leaves = prepared(
            lambda: corner({"type": "prb", "max_depth": 3}), [key], order
        )
        dr.backward(mean_image(scene, 0, parameters))
        gradients.append(dr.grad(leaves[key])[0])
    assert gradients[1] == pytest.approx(gradients[0], rel=1e-4) and gradients[0] != 0


@pytest.mark.slow
def test_narrow_lobe(corner):
    """Bare aluminium, e = 0.0042: noisy in e, since the sampled directions do not move with it, but
    unbiased.
    """
    for key, step in {
        "floor.bsdf.epsilon": 0.02,
        "floor.bsdf.b": 0.005,
        "floor.bsdf.e": 0.0004,
    }.items():
        assert_derivatives(
            lambda: corner({"type": "bounce_path", "max_bounces": 2}, NARROW), key, step
        )


@pytest.mark.slow
def test_memory_does_not_grow_with_bounces(corner):
    """Path replay: the peak of a reverse pass with 64 reflections is that with 8."""

    def peak(bounces):
        scene, parameters, _ = prepared(
            lambda: corner({"type": "bounce_path", "max_bounces": bounces}, resolution=64),
            ["floor.bsdf.epsilon"],
            "enable, update",
        )
        dr.flush_malloc_cache()
        dr.detail.malloc_clear_statistics()
        dr.backward(mean_image(scene, 0, parameters))
        dr.eval()
        return dr.detail.malloc_watermark(dr.JitBackend.LLVM)

    assert peak(64) < 1.1 * peak(8)


def causes(error) -> str:
    """The texts of an exception and of all that led to it."""
    return "" if error is None else f"{error} {causes(error.__cause__)}"


def test_stock_integrator_refuses_a_lost_derivative(corner):
    """A table that Mitsuba's prb has used has no derivatives after enable_grad: an error, not 0."""
    scene = corner({"type": "prb", "max_depth": 3})
    parameters = mi.traverse(scene)
    mean_image(scene, 0, parameters)
    dr.enable_grad(parameters["floor.bsdf.epsilon"])
    with pytest.raises(RuntimeError) as caught:
        mean_image(scene, 0, parameters)
    assert "call params.update()" in causes(caught.value)
    parameters.set_dirty(
        "floor.bsdf.epsilon"
    )  # Dr.Jit's calls reach every BSDF that is alive: leave a sound one
    parameters.update()


@pytest.mark.slow
def test_stock_prb_in_reverse(corner):
    """Reverse derivative of Mitsuba's integrator through the plugins, in the supported order."""

    def make():
        return corner({"type": "prb", "max_depth": 4, "rr_depth": 100})

    key = "floor.bsdf.epsilon"
    reference, error = central_difference(make, key, STEPS[key])
    assert (
        abs(reverse(make, [key], "enable, update")[key] - reference)
        <= 0.02 * abs(reference) + 3 * error
    )


def test_tail_has_no_derivatives(corner):
    scene, parameters, _ = prepared(
        lambda: corner({"type": "bounce_path", "max_bounces": 3, "closure": "tail"}),
        ["floor.bsdf.epsilon"],
        "enable, update",
    )
    with pytest.raises(Exception) as caught:
        dr.backward(mean_image(scene, 0, parameters))
    assert "closure = tail has no derivatives" in causes(caught.value)


BEFORE_A_GAP = """
import ctypes, mmap, sys
import drjit as dr, mitsuba as mi, numpy as np
import mi_lcair
from mi_lcair.plugins.derivatives import own_memory

count, page = int(sys.argv[1]), mmap.PAGESIZE
memory = mmap.mmap(-1, 2 * page)
start = ctypes.addressof(ctypes.c_char.from_buffer(memory))
assert ctypes.CDLL(None).mprotect(ctypes.c_void_p(start + page), page, 0) == 0
values = np.frombuffer(memory, np.float32, count, page - 4 * count)
array = mi.Float(values)
own_memory([array])
print(dr.sum(array)[0], len(array))
"""


@pytest.mark.slow
def test_memory_ends_where_a_page_ends():
    """An array that ends before a page that cannot be read is copied."""
    command = [sys.executable, "-c", BEFORE_A_GAP, "1001"]
    assert subprocess.check_output(command, timeout=100, text=True) == "0.0 1001\n"


def test_one_entry_is_copied_without_a_kernel():
    """A kernel would read it by the alignment of NumPy's memory, and be another one in each run."""
    arrays = [mi.Float(np.array([2.5], dtype=np.float32)), mi.UInt32(np.array([7], np.uint32))]
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        own_memory(arrays)
        assert not dr.kernel_history([dr.KernelType.JIT])
    assert [array[0] for array in arrays] == [2.5, 7]
