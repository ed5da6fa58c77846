"""The number of reflections that a tolerance needs, and the error of what is left out."""

import re
from math import sqrt

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.rendering import measure
from mi_lcair.rendering.reflections import (
    Probe,
    beyond_last,
    bounce_settings,
    ending,
    fewest_bounces,
    left_out,
    needed_bounces,
    pixels_launch,
    reflecting,
)
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.views import View


@pytest.fixture
def plain_furnace():
    """Function that gives the inside of an isothermal cube with diffuse walls of an emissivity."""

    def made(emissivity):
        T = mi.ScalarTransform4f
        return mi_lcair.load(
            mi.load_dict(
                {
                    "type": "scene",
                    "integrator": {"type": "bounce_path"},
                    "sensor": {
                        "type": "orthographic",
                        "to_world": T().look_at([0, 0, 0], [0, 0, 1], [0, 1, 0]) @ T().scale(0.5),
                        "film": {
                            "type": "hdrfilm",
                            "width": 8,
                            "height": 8,
                            "pixel_format": "luminance",
                            "rfilter": {"type": "box"},
                        },
                        "sampler": {"type": "lattice"},
                    },
                    "wall": {
                        "type": "cube",
                        "flip_normals": True,
                        "bsdf": {"type": "diffuse", "reflectance": 1 - emissivity},
                        "emitter": {"type": "thermal", "band": "LWIR", "temperature": 300.0},
                    },
                },
                optimize=False,
            )
        )

    return made


@pytest.mark.parametrize("tolerance, number", [(0.2, 5), (0.01, 9), (0.002, 12)])
def test_a_furnace_of_emissivity_one_half(plain_furnace, tolerance, number):
    """Of the radiance, 0.5^(n + 1) lies beyond n reflections."""
    scene = plain_furnace(0.5)
    for each_pixel in (False, True):
        most, error = needed_bounces(scene, each_pixel, Sampling(tolerance=tolerance))
        assert most == number
        assert error == pytest.approx(0.5 ** (number + 1) / 1.96, rel=0.02)


def test_auto_keeps_its_tolerance(plain_furnace):
    """The errors hold what is left out: the truth is inside, and the scene is as before."""
    scene = plain_furnace(0.5)
    truth = mi_lcair.signature(scene, tolerance=1e-3, max_bounces=40).target
    result = mi_lcair.signature(scene, tolerance=0.01, max_bounces="auto").target
    image = mi_lcair.render(scene, tolerance=0.01, max_bounces="auto")
    missing = 0.5**10
    assert result.intensity == pytest.approx((1 - missing) * truth.intensity, rel=1e-4)
    assert result.standard_error / result.intensity > missing / 2
    assert abs(result.intensity - truth.intensity) < 2 * result.standard_error
    assert image.header["max_bounces"] == 9 and image.rms_error > missing / 2
    integrator = scene.mi.integrator()
    assert (integrator.max_bounces, integrator.truncation) == (4, 0)


def test_slow_reflections_are_refused(plain_furnace):
    scene = plain_furnace(0.01)
    with pytest.raises(InputError, match="auto finds no number: 52 % of .* beyond 64 reflections"):
        needed_bounces(scene, False, Sampling(tolerance=0.01))


def test_a_number_that_is_given(plain_furnace):
    scene = plain_furnace(0.5)
    for given in (3, "3"):
        with reflecting(scene, given, True, Sampling()):
            assert scene.mi.integrator().max_bounces == 3
    for wrong in ("otto", "-1", 2.5, True):
        with (
            pytest.raises(InputError, match="known: auto, a whole number"),
            reflecting(scene, wrong, True, Sampling()),
        ):
            pass


def test_truncation_is_a_systematic_error(plain_furnace):
    scene = plain_furnace(0.5)
    scene.mi.integrator().truncation = 0.03
    with scene.prepared() as tracer:
        whole = tracer.systematic_error
    scene.mi.integrator().truncation = 0.0
    with scene.prepared() as tracer:
        assert whole == pytest.approx(sqrt(0.03**2 + tracer.systematic_error**2))


def test_the_view_that_needs_most_decides():
    """One side of the plates shows no reflections, another one does, and from below all is dark."""
    plates = mi_lcair.load("two_plates", resolution=8)
    views = [View(45, -45), View(90, 60), View(0, -60)]

    def number(*views):
        return bounce_settings(plates, "auto", False, Sampling(), views)["max_bounces"]

    assert [number(view) for view in views[:2]] == [0, 1]
    assert number(*views) == 1
    with pytest.raises(InputError, match="no path of the test run finds radiance"):
        number(views[2])


# How many reflections are needed, from invented radiances of each number of reflections
# --------------------------------------------------------------------------------------


@pytest.mark.parametrize("each_pixel", [False, True])
@pytest.mark.parametrize("ratio", [0.1, 0.5, 0.8])
def test_geometric_series(ratio, each_pixel):
    """Beyond n lies ratio^(n + 1) of all, also where the last recorded number is smaller than n."""
    by_bounce = np.broadcast_to(ratio ** np.arange(17)[None, :, None], (8, 17, 4))
    for n in (1, 3, 16):
        number, error = fewest_bounces(by_bounce, 1.01 * ratio ** (n + 1), each_pixel)
        assert number == n and error == pytest.approx(ratio ** (n + 1), rel=1e-6)
    number, error = fewest_bounces(by_bounce, 0.5 * ratio**17, each_pixel)
    assert number == 16 and error == pytest.approx(ratio**17, rel=1e-6)


def test_radiance_that_grows_cannot_be_truncated():
    growing = np.ones((8, 33, 4)) * np.linspace(1.0, 1.2, 33)[:, None]
    assert fewest_bounces(growing, 1e-3, False)[1] > 0.9


def test_pixels_differ():
    """The rms over the pixels, as a fraction of the mean over all of them."""
    by_bounce = np.zeros((8, 3, 2))
    by_bounce[:, 0], by_bounce[:, 1, 0] = 1.0, 0.2
    number, error = fewest_bounces(by_bounce, 0.5, True)
    assert number == 0 and error == pytest.approx(0.2 / np.sqrt(2) / 1.1)
    assert fewest_bounces(by_bounce, 0.1, True) == (1, 0)


def test_the_bound_of_a_noisy_truncation():
    """Of the mean: Student's 95 % bound of the missing part; of pixels: its rms."""
    random = np.random.default_rng(0)
    by_bounce = np.zeros((8, 4, 3))
    by_bounce[:, 0] = 10.0
    by_bounce[:, 1] = 2 + random.normal(size=(8, 3))
    missing = by_bounce[:, 1].mean(axis=1) / by_bounce.sum(axis=1).mean(axis=1)
    expected = missing.mean() + 2.364624 * missing.std(ddof=1) / np.sqrt(8)
    assert fewest_bounces(by_bounce, 0.5, False) == (0, pytest.approx(expected))
    by_pixel = by_bounce[:, 1].mean(axis=0)
    expected = np.sqrt(np.mean(by_pixel**2)) / by_bounce.sum(axis=1).mean()
    assert fewest_bounces(by_bounce, 0.5, True) == (0, pytest.approx(expected))


def test_a_batch_that_met_nothing_knows_nothing():
    by_bounce = np.ones((2, 2, 1)) * [[[1.0], [0.0]]]
    by_bounce[1] = 0
    assert fewest_bounces(by_bounce, 0.01, False)[1] > 1


def test_what_lies_beyond_the_last():
    """A geometric series of the last numbers; the last entry may hold several of them."""
    assert beyond_last(np.array([8.0, 4.0, 3.0])) == pytest.approx(0.75 / 0.25)
    assert beyond_last(np.array([4.0, 5.0])) == pytest.approx(0.999 / 0.001)
    assert beyond_last(np.array([4.0])) == beyond_last(np.array([4.0, 0.0])) == 0
    assert beyond_last(np.array([0.0, 4.0])) == beyond_last(np.zeros(3), 2) == 0
    r = 0.5
    part = r**2 + r**3 + r**4
    rest = r**5 / (1 - r)
    assert beyond_last(np.array([1.0, r, part]), 2) * part == pytest.approx(rest)
    falling = 0.9 ** np.arange(40)
    falling[-1] *= 1.2  # noise of one number
    assert beyond_last(falling) * ending(falling) == pytest.approx(0.9**40 * 10, rel=0.25)


def test_what_max_bounces_leaves_out():
    """The rest of a series, and nothing where it is not known, or may not be one."""
    series, no_error = 0.9 ** np.arange(80), np.zeros(80)
    assert left_out(series[:20], no_error[:20], 19) == pytest.approx(series[20] * 10)
    merged = np.append(series[:64], series[64:].sum())
    assert left_out(merged, no_error[:65], 79) == pytest.approx(0.9**80 * 10)
    assert left_out(series[:20], no_error[:20] + series[18] / 2, 19) is None
    assert left_out([1.0, 0.5], [0, 0], 1) is None
    assert left_out([1.0, 0.2, 0.3, 2.0], [0, 0, 0, 0], 3) is None
    taking_turns = series * np.tile([1.0, 0.1], 40)
    rest = taking_turns[20:].sum() / (1 - 0.9**60)
    assert left_out(taking_turns[:20], no_error[:20], 19) == pytest.approx(rest)


# Probes: the radiance by number of reflections, through a window or some pixels
# ------------------------------------------------------------------------------


@pytest.mark.parametrize("each_pixel, size", [(False, 1), (True, 50)])
def test_the_furnace_by_number_of_reflections(each_pixel, size):
    """All numbers add up to what a render gives. Sources that no path has met are bounded."""
    scene = mi_lcair.load("furnace", resolution=16, max_bounces=12)
    probe = Probe.of(scene, each_pixel, seed=1, sensor=0, factor=1)
    assert probe.by_bounce.shape[1] == 13 and probe.by_bounce.shape[2] >= size
    rendered = mi_lcair.render(scene, spp=64)
    assert probe.by_bounce.sum(axis=1).mean() == pytest.approx(rendered.mean, rel=1e-3)
    more = Probe.of(scene, each_pixel, seed=1, sensor=0, factor=4)
    assert 0 < more.may_lack == pytest.approx(probe.may_lack / 4, rel=1e-3)


@pytest.mark.parametrize(
    ("size", "windows"), [((8, 8), 64), ((32, 32), 64), ((128, 128), 1024), ((1000, 500), 2048)]
)
def test_number_of_pixels(size, windows):
    """One of 16, between 64 and 2048; a stride without a divisor of the width."""
    launch = pixels_launch(*size, seed=3, factor=5)
    assert 0.85 * windows <= launch.windows <= windows + 10
    assert np.gcd(launch.stride, size[0]) == 1
    assert (launch.points, launch.randomisations, launch.seed) == (10, 8, 3)
    assert (launch.columns, launch.rows) == size


def followed(result):
    pairs = (part for part in result.facts() if isinstance(part, tuple))
    return dict(pairs)["followed"]


def test_results_say_what_they_followed_and_left_out(plain_furnace):
    """After n reflections in the furnace (1 - emissivity)^(n + 1) of the radiance is missing."""
    furnace = plain_furnace(0.5)
    result = mi_lcair.signature(furnace, max_bounces=5, spp=4)
    assert followed(result) == "5 reflections; emitters not drawn; the rest would add about 1.6 %"
    (bound,) = re.findall(
        r"^6 reflections \(auto: at most (.*) % is beyond\); emitters not drawn$",
        followed(mi_lcair.signature(furnace, max_bounces="auto", tolerance="8%", parts=False)),
    )
    assert 99 * 0.5**7 <= float(bound) <= 0.8
    view = mi_lcair.trend(furnace, [0], resolution=8, max_bounces=9, tolerance="5%")
    assert followed(view).startswith("9 reflections; emitters drawn where that saves paths; the")


def test_results_say_which_settings_a_pilot_chose(monkeypatch):
    for is_drawn, words in ((True, "drawn"), (False, "not drawn")):
        chosen = {"emitter_sampling": is_drawn, "opening_sampling": False}
        monkeypatch.setattr(measure, "cheapest", lambda *_: chosen)
        monkeypatch.setattr(measure, "WORTH_ASKING", 0)
        image = mi_lcair.render("cavity", tolerance="50%", parameters={"resolution": 8})
        assert followed(image).startswith(f"24 reflections; emitters {words}; the rest")
