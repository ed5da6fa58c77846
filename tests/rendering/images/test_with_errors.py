"""Standard errors and tolerances of scenes of Mitsuba's own plugins."""

import subprocess
import sys

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.plugins.samplers.lattice import Lattice
from mi_lcair.rendering.images.with_errors import ImageWithErrors


@pytest.fixture(scope="module")
def room():
    """Mitsuba's Cornell box, 16 x 16 pixels, by the name of its sampler."""

    def of(sampler):
        description = mi.cornell_box()
        description["sensor"]["film"] |= {"width": 16, "height": 16, "rfilter": {"type": "box"}}
        description["sensor"]["sampler"] = {"type": sampler}
        return mi.load_dict(description)

    return {name: of(name) for name in ("lattice", "multijitter", "independent")}


@pytest.fixture(scope="module")
def converged(room):
    return mi_lcair.render_with_errors(room["lattice"], spp=2**13, seed=1000)


def test_errors_are_those_of_the_mean_of_independent_images():
    """Closed form: images 0 and 2 in every pixel have the mean 1 and the standard error 1."""
    images = np.zeros((2, 3, 4, 1))
    images[1] = 2
    result = ImageWithErrors.of(images, 16)
    assert np.all(result.image == 1) and np.allclose(result.standard_error, 1)
    assert result.mean == 1 and result.mean_error == pytest.approx(1) and result.spp == 16
    assert repr(result) == "image: mean 1 +- 1 (standard errors), 16 samples per pixel"
    assert result.rms_error == pytest.approx(1)
    assert ImageWithErrors.of(0 * images, 16).rms_error == 0


@pytest.mark.parametrize("sampler", ["lattice", "multijitter"])
def test_intervals_hold_the_converged_image(room, converged, sampler):
    """95 % intervals of 256 pixels for each of 4 seeds, and of their mean."""
    results = [mi_lcair.render_with_errors(room[sampler], spp=128, seed=k) for k in range(4)]
    miss = np.abs([result.image - converged.image for result in results])
    half_width = [np.hypot(result.half_width, converged.half_width) for result in results]
    # Errors of pixels with few bright samples are skewed, so that fewer than 95 % hold
    assert 0.90 < np.mean(miss <= half_width) < 0.98
    rms = np.sqrt(np.mean(miss**2)) / converged.image.mean()
    stated = np.sqrt(np.mean([result.rms_error**2 for result in results]))
    assert rms == pytest.approx(stated, rel=0.3)
    for result in results:
        assert np.all(np.abs(result.mean - converged.mean) < 5 * result.mean_error)


def test_a_tolerance_continues_the_lattice(room):
    """After doublings its image is the one of as many samples from the beginning."""
    progress = []
    result = mi_lcair.render_with_errors(
        room["lattice"], tolerance=1e-6, max_spp=256, progress=lambda *work: progress.append(work)
    )
    assert result.reached is False and result.spp == 256
    assert progress == [(64, 256), (128, 256), (256, 256)]
    at_once = mi_lcair.render_with_errors(room["lattice"], spp=256)
    np.testing.assert_allclose(result.image, at_once.image, rtol=1e-4)
    assert room["lattice"].sensors()[0].sampler().first_point == 0


def test_a_tolerance_is_met_with_any_sampler(room, converged):
    spp = {}
    for name, scene in room.items():
        result = mi_lcair.render_with_errors(scene, tolerance="10%", seed=2)
        assert result.reached and result.rms_error <= 0.1
        rms = np.sqrt(np.mean((result.image - converged.image) ** 2)) / converged.image.mean()
        assert rms < 0.15
        spp[name] = result.spp
    assert spp["lattice"] < spp["independent"]


def test_renders_of_other_samplers_have_other_seeds(room):
    """A second turn with the seeds of the first would change nothing."""
    one, two = (
        mi_lcair.render_with_errors(room["independent"], tolerance=1e-6, max_spp=spp)
        for spp in (64, 128)
    )
    assert two.rms_error / one.rms_error == pytest.approx(2**-0.5, rel=0.2)


def test_unusable_input_is_one_line(room):
    scene = room["lattice"]
    for options, message in (
        ({"spp": 8, "tolerance": 0.1}, "spp sets a fixed number"),
        ({"sensor": 3}, "sensor = 3; the scene has 1"),
        ({"spp": 0}, "must be positive"),
        ({"seed": -1}, "seed"),
        ({"integrator": "path"}, "str is no integrator"),
    ):
        with pytest.raises(InputError, match=message):
            mi_lcair.render_with_errors(scene, **options)
    with pytest.raises(InputError, match="str is not a scene"):
        mi_lcair.render_with_errors("cavity")
    bad = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path"},
            "light": {"type": "constant", "radiance": float("nan")},
            "sensor": {"type": "perspective", "film": {"type": "hdrfilm", "width": 4, "height": 4}},
        }
    )
    with pytest.raises(InputError, match="^16 of 16 pixels are NaN or infinite"):
        mi_lcair.render_with_errors(bad, spp=8)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["direct", "prbvolpath", "ptracer", "depth", "moment"])
def test_every_kind_of_integrator(room, kind):
    """The means of the channels are those of independent samples, with smaller errors."""
    inner = {"inner": {"type": "path"}} if kind == "moment" else {}
    integrator = mi.load_dict({"type": kind, **inner})
    lattice, independent = (
        mi_lcair.render_with_errors(room[sampler], spp=128, integrator=integrator, seed=7)
        for sampler in ("lattice", "independent")
    )
    error = np.hypot(lattice.mean_error, independent.mean_error)
    assert np.all(np.abs(lattice.mean - independent.mean) < 5 * error)
    assert lattice.rms_error < 0.9 * independent.rms_error


VARIANTS = """
import mi_lcair, mitsuba as mi
for variant in ("llvm_ad_rgb", "llvm_ad_spectral"):
    mi.set_variant(variant)
    box = mi.cornell_box()
    box["sensor"]["film"] |= {"width": 8, "height": 8}
    for sampler in ("lattice", "independent"):
        box["sensor"]["sampler"] = {"type": sampler}
        result = mi_lcair.render_with_errors(mi.load_dict(box), spp=512)
        print(*result.mean, *result.mean_error)
mi.set_variant("scalar_rgb")
try:
    mi.load_dict({"type": "lattice"})
except RuntimeError as error:
    print(str(error).splitlines()[-1])
"""


@pytest.mark.slow
def test_other_variants():
    """In colour the lattice has the means of independent samples; a scalar variant refuses it."""
    run = subprocess.run([sys.executable, "-c", VARIANTS], capture_output=True, text=True)
    *lines, refusal = run.stdout.splitlines()
    numbers = np.array([list(map(float, line.split())) for line in lines]).reshape(2, 2, 2, 3)
    for (lattice, its_error), (independent, error) in numbers:
        assert np.all(np.abs(lattice - independent) < 5 * np.hypot(its_error, error))
        assert np.all(its_error < error)
    assert refusal.startswith("InputError: plugin 'lattice' needs Dr.Jit's arrays, which variant")


def test_a_copy_keeps_the_first_point():
    sampler = Lattice(mi.Properties())
    sampler.set_sample_count(8)
    sampler.seed(3, 8)
    start = sampler.next_1d().numpy()
    sampler.first_point = 8
    later = sampler.clone()
    later.seed(3, 8)
    both = np.concatenate([start, later.next_1d().numpy()])
    sampler.first_point = 0
    sampler.set_sample_count(16)
    sampler.seed(3, 16)
    np.testing.assert_array_equal(both, sampler.next_1d().numpy())
