"""The number of reflections that a tolerance needs, and the error of what is left out."""

from math import sqrt

import mitsuba as mi
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.rendering.reflections.number import bounce_settings, needed_bounces, reflecting
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
    for wrong in ("otto", "-1", 2.5):
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
    with pytest.raises(InputError, match="no pilot path meets radiance"):
        number(views[2])
