"""Rendering in passes: channels, standard errors, tolerance, seeds, and what must never reach an
image.
"""

import json

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.formats import OF_PARTS
from mi_lcair.plugins.paths.walk import Walk
from mi_lcair.rendering import window
from mi_lcair.rendering.images.render import write_tiff


def load(**parameters):
    return mi_lcair.load("open_box", resolution=16, max_bounces=3, **parameters)


@pytest.fixture(scope="module")
def image():
    return mi_lcair.render(load(), spp=64, seed=1, parts=True)


def total(image, kind):
    return sum(
        channel.astype(np.float64)
        for name, channel in image.channels.items()
        if name.startswith(kind)
    )


@pytest.mark.parametrize("kind", ["bounce", "group.", "seen."])
def test_every_split_sums_to_the_radiance(image, kind):
    np.testing.assert_allclose(
        total(image, kind), image.channels["Y"], rtol=1e-6, atol=1e-6 * image.mean
    )


@pytest.mark.parametrize(
    "name, parameters",
    [
        ("open_box", {"max_bounces": 3}),
        ("furnace", {"band": "MWIR"}),
        ("a340_landing", {"position": 3, "band": "LWIR"}),
    ],
)
@pytest.mark.parametrize("more", [{}, {"bins": 4}, {"atmosphere": "midlat_summer"}])
def test_parts_change_no_other_channel(name, parameters, more):
    """Bit for bit, with the same errors, and the image without them has nothing split."""
    if more and name == "open_box":
        parameters = parameters | {"band": "MWIR"}
    scene = mi_lcair.load(name, resolution=16, **parameters)
    whole, lean = (mi_lcair.render(scene, spp=16, parts=parts, **more) for parts in (True, False))
    for channel, values in lean.channels.items():
        np.testing.assert_array_equal(values, whole.channels[channel], err_msg=channel)
    assert (lean.mean, lean.mean_error) == (whole.mean, whole.mean_error)
    assert lean.rms_error == whole.rms_error and lean.by_bounce == []
    split = set(whole.channels) - set(lean.channels)
    assert split == {channel for channel in whole.channels if channel.startswith(OF_PARTS)}
    assert {"Y", "temperature.Y", "stderr.Y", "target.Y", "range.Y"} <= set(lean.channels)


def test_a_channel_of_parts_is_explained():
    """The error of a channel that an image lacks says what records it."""
    lean = mi_lcair.render(load(), spp=4)
    for draw in (lambda: lean.picture("bounce00.Y"), lambda: write_tiff("x", lean, "seen.floor.Y")):
        with pytest.raises(InputError, match=r"Y'; parts=True of render makes it$"):
            draw()
    with pytest.raises(InputError, match="unknown channel of the image of open_box 'y'; known: Y"):
        lean.picture("y")
    with pytest.raises(InputError, match="known: bounce0"):
        mi_lcair.render(load(), spp=4, parts=True).picture("bounce09.Y")


def test_splits_say_who(image):
    """The floor shows itself and reflects the wall; the sensor sees the wall edge-on."""
    floor, wall = image.channels["seen.floor.Y"], image.channels["seen.wall.Y"]
    assert floor.mean() > 0 and wall.mean() == 0
    np.testing.assert_allclose(
        image.channels["group.floor.Y"].mean(), image.channels["bounce00.Y"].mean(), rtol=1e-5
    )


def test_header(image):
    assert (
        image.header["band"] == "total"
        and image.header["spp"] == 64
        and image.header["seed"] == "1"
    )
    assert json.loads(image.header["parameters"]) == {"resolution": "16", "max_bounces": "3"}
    assert image.header["paths"] == str(64 * 16 * 16) and image.header["max_bounces"] == 3
    assert "W m^-2 sr^-1" in image.header["units"] and mi.__version__ in image.header["versions"]


@pytest.mark.slow
@pytest.mark.parametrize("drawn, most", [("false", 1.0), ("true", 3.0)])
def test_standard_error_is_the_scatter_of_seeds(drawn, most):
    """Per pixel: the mean of the squared standard errors against the variance over 40 seeds.

    Without drawn emitters both agree (chi-square, 5 sigma). With them the scatter is a hundredth,
    and what paths may have missed is the larger part of the error.
    """
    scene, seeds = load(emitter_sampling=drawn), 40
    images = [mi_lcair.render(scene, spp=16, seed=seed) for seed in range(seeds)]
    means = np.array([image.channels["Y"] for image in images], dtype=np.float64)
    claimed = np.mean([image.channels["stderr.Y"].astype(np.float64) ** 2 for image in images])
    scatter = means.var(axis=0, ddof=1).mean()
    pixels = np.count_nonzero(means.var(axis=0))
    chance = 5 * np.sqrt(2 / (seeds - 1) / pixels) + 0.02
    assert 1 - chance < claimed / scatter < most * (1 + chance)


@pytest.mark.slow
def test_passes_do_not_change_the_statistics(monkeypatch):
    """Many small passes, over runs of pixels that do not divide the image, trace the same paths as
    one large pass.
    """
    whole = mi_lcair.render(load(), spp=96, seed=1)
    monkeypatch.setattr(window, "PASS_SAMPLES", 100)  # less than one sample per pixel of the 256
    parts = mi_lcair.render(load(), spp=96, seed=1)
    for name in ("Y", "stderr.Y"):
        np.testing.assert_allclose(
            parts.channels[name], whole.channels[name], rtol=1e-4, atol=1e-5 * whole.mean
        )
    # the distance to what is seen is no average over passes that saw nothing
    np.testing.assert_allclose(parts.channels["range.Y"], whole.channels["range.Y"], rtol=0.02)


@pytest.mark.slow
def test_same_seed_same_image():
    images = [mi_lcair.render(load(), spp=8, seed=seed).channels["Y"] for seed in (7, 7, 8)]
    np.testing.assert_array_equal(images[0], images[1])
    assert np.any(images[0] != images[2])


@pytest.mark.slow
def test_tolerance():
    """The rms standard error over the pixels ends below the tolerance, and not far below it."""
    steps = []
    result = mi_lcair.render(
        load(), tolerance=0.02, progress=lambda done, goal: steps.append((done, goal))
    )
    errors = result.channels["stderr.Y"].astype(np.float64)
    rms = np.sqrt(np.mean(errors**2))
    # Errors of pixels are averaged over their neighbourhoods, which changes their rms at the border
    assert result.reached and result.rms_error == pytest.approx(rms / result.mean, rel=0.2)
    assert 0.008 < result.rms_error <= 0.02
    assert steps[-1][0] == result.spp and [done for done, _ in steps] == sorted(
        {done for done, _ in steps}
    )


def test_tolerance_not_reached():
    result = mi_lcair.render(load(), tolerance=1e-4, max_spp=64)
    assert result.reached is False and result.spp == 64 and result.rms_error > 1e-4


def test_one_sample_has_no_standard_error():
    result = mi_lcair.render(load(), spp=1)
    assert "stderr.Y" not in result.channels and result.rms_error is None


@pytest.mark.slow
def test_invalid_samples_are_counted_and_left_out(monkeypatch):
    """A NaN or infinity in two of 10,000 samples: counted, reported, and the rest of the pixel
    stands.
    """
    walk = Walk.walk

    def poisoned(self, *arguments, **keywords):
        (L, state), *others = walk(self, *arguments, **keywords)
        index = dr.arange(mi.UInt32, dr.width(L))
        L = dr.select(index % 10000 == 0, dr.nan, dr.select(index % 10000 == 1, dr.inf, L))
        return (L, state), *others

    clean = mi_lcair.render(load(), spp=200, seed=1)
    monkeypatch.setattr(Walk, "walk", poisoned)
    result = mi_lcair.render(load(), spp=200, seed=1)
    assert result.invalid == 2 * 6 and result.header["invalid_samples"] == "12"
    assert all(np.isfinite(channel).all() for channel in result.channels.values())
    assert result.mean == pytest.approx(clean.mean, rel=0.02)


@pytest.mark.parametrize(
    "keywords, name",
    [
        ({"spp": 0}, "spp"),
        ({"tolerance": -1.0}, "tolerance"),
        ({"max_spp": 0, "tolerance": 0.1}, "max_spp"),
    ],
)
def test_unusable_sampling(keywords, name):
    with pytest.raises(InputError, match=f"^{name} = "):
        mi_lcair.render(load(), **keywords)


def test_a_number_of_samples_stands_alone():
    with pytest.raises(InputError, match="spp sets a fixed number of samples"):
        mi_lcair.render(load(), spp=4, tolerance=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("closure", ["none", "tail"])
@pytest.mark.parametrize("parts", [False, True])
def test_paths_are_traced_once(closure, parts):
    """One kernel of a render is large, that of the paths; whatever is reduced from them must not
    trace them again.
    """
    scene = load()
    scene.mi.integrator().closure = closure
    mi_lcair.render(scene, spp=4, parts=parts)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        mi_lcair.render(scene, spp=4, seed=1, parts=parts)
        kernels = dr.kernel_history([dr.KernelType.JIT])
    assert sum(kernel["operation_count"] > 200 for kernel in kernels) == 1


@pytest.mark.slow
@pytest.mark.parametrize("name", ["open_box", "cavity"])
def test_errors_of_pixels_hold_with_few_samples(name):
    """The interval of 1.96 standard errors holds the pixel in 90 to 99.5 of 100 at 16 samples.

    The scatter of the pixel's own samples alone: in 82 and in 40 of 100.
    """
    scene = mi_lcair.load(name, resolution="32")
    exact = mi_lcair.render(scene, spp=512, seed=99).channels["Y"].astype(float)
    inside = []
    for seed in range(4):
        found = mi_lcair.render(scene, spp=16, seed=seed).channels
        error = 1.96 * found["stderr.Y"].astype(float) + 1e-5 * exact
        inside.append(np.mean((np.abs(found["Y"] - exact) <= error)[exact > 0]))
    assert 0.90 < np.mean(inside) < 0.995
