"""Plans: what they choose where the right choice is known, whether their error holds, and that they leave the scene alone."""
import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.products.plan import fewest_bounces
from mi_lcair.products.probe import BATCHES, Settings
from mi_lcair.rendering.scene import checked
from tests.plugins.conftest import corner, plate  # noqa: F401, fixtures
from mi_lcair.methods.propagation import exact


def test_diffuse_plates_need_no_lobe_and_one_reflection():
    """A diffuse reflector and a blackbody: `diffuse` is exact, and looking at the emitter pays though the scene does not."""
    found = mi_lcair.plan(mi_lcair.load("two_plates", resolution=32, max_bounces=4, emitter_sampling="false"))
    assert set(found.lobe.values()) == {"diffuse"} and found.max_bounces == 1 and found.closure == "none"
    assert found.emitter_sampling and found.left_out == []


def test_a_furnace_must_not_look_at_its_emitters():
    found = mi_lcair.plan(mi_lcair.load("furnace", resolution=16, emitter_sampling="true"))
    assert not found.emitter_sampling and found.lobe["bare_aluminum"] == "mirror"


def test_gloss_black_in_the_range_needs_a_mirror_and_two_reflections():
    found = mi_lcair.plan(mi_lcair.load("cylinder_ir_range", finish="gloss_black", resolution=64))
    assert found.lobe == {"gloss_black": "mirror", "ir_range_wall": "diffuse"} and found.max_bounces <= 2
    assert any("gloss_black, taken as mirror" in sentence for sentence in found.left_out)


def test_a_broad_lobe_is_kept(corner):
    """e = 0.15 beside a hot wall: the mirror shows another picture, in each pixel and in all."""
    from pathlib import Path

    scene = checked(corner({"type": "bounce_path", "max_bounces": 4}, {"epsilon": 0.1, "rho_d": 0.02, "b": 0.1, "e": 0.15},
                           floor_temperature=300.0), Path("corner.xml"), {})
    for each_pixel in (False, True):
        assert set(mi_lcair.plan(scene, 0.01, each_pixel).lobe.values()) == {"brdf"}


@pytest.mark.parametrize("opening", [8, 80])
def test_reflections_of_a_cavity(opening):
    """emissivity 0.5: each reflection in a small opening's cavity brings half of the one before, and a tail mends the rest."""
    found = mi_lcair.plan(mi_lcair.load("cavity", opening=opening, resolution=16))
    assert found.closure == "tail" and found.max_bounces <= 4 and found.predicted_error <= 0.01


def test_the_error_holds():
    """Of 12 plans for 0.5 %, each carried out with another seed, at most 2 miss (2 % chance for a method that holds 95 %)."""
    missed = 0
    intensity = exact.open_box_intensity(*(float(in_band_radiance(band("total"), T)) for T in (800, 300)))
    scene = mi_lcair.load("open_box", resolution=32, emitter_sampling="false")
    for seed in range(12):
        found = mi_lcair.plan(scene, 0.005, seed=seed)
        with found.applied(scene):
            result = mi_lcair.signature(scene, spp=found.spp, seed=1000 + seed)
        missed += abs(result.target.intensity / intensity - 1) > 0.005
    assert missed <= 2


def test_each_pixel():
    """The rms error over the pixels, as a render at that plan reports it, is what was predicted."""
    scene = mi_lcair.load("cylinder_ir_range", finish="gloss_black", resolution=64)
    found = mi_lcair.plan(scene, 0.02, each_pixel=True)
    with found.applied(scene):
        image = mi_lcair.render(scene, spp=found.spp)
    assert found.each_pixel and image.rms_error == pytest.approx(found.predicted_error, rel=0.3)
    assert image.header["lobes"].count("mirror") == 1


def test_the_scene_is_left_as_it_was():
    scene = mi_lcair.load("furnace", resolution=16)
    before = Settings.of(scene)
    found = mi_lcair.plan(scene)
    assert Settings.of(scene) == before != found.settings
    with pytest.raises(KeyError), found.applied(scene):
        assert Settings.of(scene) == found.settings
        raise KeyError
    assert Settings.of(scene) == before


def test_geometric_series():
    """Counts that fall by a constant ratio: the tail closes them exactly from the third on; without it, log(budget) / log(ratio)."""
    looks = np.broadcast_to(0.5 ** np.arange(33)[None, :, None], (BATCHES, 33, 4))
    n, closure, missing = fewest_bounces(looks, 1e-3, False)
    assert (n, closure) == (2, "tail") and missing < 1e-8
    falling = np.broadcast_to(np.r_[1, 0.5, 0.001, np.zeros(30)][None, :, None], (BATCHES, 33, 4))
    assert fewest_bounces(falling, 1e-3, False)[:2] == (1, "none") and fewest_bounces(falling, 1e-4, True)[:2] == (2, "none")


@pytest.mark.parametrize("tolerance", [0, 1, -0.1])
def test_unusable_tolerance(tolerance):
    with pytest.raises(InputError, match="must lie between 0 and 1"):
        mi_lcair.plan(mi_lcair.load("open_box", resolution=16), tolerance)
