"""Views of a scene's model: where the cameras stand, and the intensities of many views rendered
together.
"""

from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import checked
from mi_lcair.rendering.views import Target, View, seen_from, terrain_before, terrain_remark
from mi_lcair.rendering.window import FIRST_PATHS
from tests.plugins.conftest import plate  # noqa: F401, a fixture
from tests.plugins.small_scenes import camera
from tests.signatures.rendered_views import render_views

BLACK = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}}
L_300 = float(in_band_radiance(band("LWIR"), 300.0))
SLAB = [[-0.2, -0.1, 0.3], [0.2, -0.1, 0.3], [0.2, 0.1, 0.3], [-0.2, 0.1, 0.3]]  # faces up


def loaded(**shapes):
    scene = mi.load_dict(
        {"type": "scene", "integrator": {"type": "bounce_path"}, "sensor": camera(), **shapes},
        optimize=False,
    )
    return checked(scene, Path("scene.xml"), {})


@pytest.fixture(scope="module")
def cylinder():
    return mi_lcair.load("cylinder_ir_range")


def test_target_holds_the_model_and_not_its_background(cylinder):
    """The cylinder is 1.2 m long and lifts its nose by 45 degrees; the room is 3 m wide."""
    target = Target.of(cylinder)
    assert 0.6 <= target.radius < 0.75 and np.abs(target.centre).max() < 0.1


@pytest.mark.slow
def test_one_view_is_the_scenes_own_sensor(cylinder):
    """The scene's camera at the tail and the view from there: other windows, the same intensity."""
    own = mi_lcair.signature(cylinder, spp=16).target
    view = mi_lcair.signature(seen_from(cylinder, View(180.0), 128), spp=16).target
    assert view.intensity == pytest.approx(
        own.intensity, abs=4 * np.hypot(own.standard_error, view.standard_error)
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "view, area",
    [
        (View(0, 90), 0.08),
        (View(77, 90), 0.08),
        (View(0, 30), 0.04),
        (View(45, 60), 0.08 * np.sqrt(0.75)),
        (View(0, -30), 0.0),
    ],
)
def test_a_black_slab_is_seen_by_its_projected_area(plate, view, area):
    found = render_views(
        loaded(slab=plate("slab", SLAB, BLACK, 300.0)), [view], 32, Sampling(spp=64)
    )
    for name, expected in (
        ("hit", 0.04 if view.elevation_deg < 0 else area),
        ("target", area * L_300),
        ("bounce.0", area * L_300),
    ):
        value, error = found.parts[name][:, 0]
        assert abs(value - expected) <= 4 * error + 1e-5 * expected
        # What is not seen at all has the error of what paths may have missed
        assert error <= (0.01 * value if value else 1e-3 * L_300)


def test_terrain_before_a_view(plate):
    """A slab over a floor of 2 m: from below all of it is hidden, from above and aside nothing."""
    floor = plate("floor", [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], BLACK, 290.0)
    floor["emitter"]["facet_type"] = "terrain"
    scene = loaded(slab=plate("slab", SLAB, BLACK, 300.0), floor=floor)
    views = [View(0, 90), View(20, 0), View(45, -90), View(30, -80)]
    assert terrain_before(scene, views).tolist() == [0, 0, 1, 1]
    (remark,) = terrain_remark(scene, views)
    assert remark.startswith("in 2 of 4 views terrain is in front of up to 100 % of the view")
    ceiling = floor | {"to_world": mi.ScalarTransform4f().translate([0, 0, 2])}
    room = loaded(slab=plate("slab", SLAB, BLACK, 300.0), floor=floor, ceiling=ceiling)
    assert not terrain_before(room, [View(45, -90)]).any()


@pytest.mark.slow
def test_views_together_are_the_views_apart(cylinder):
    """Three views in one film against each alone: the pixels of one do not end up in another."""
    views = [View(0, 0), View(90, 10), View(200, -20)]
    together = render_views(cylinder, views, 32, Sampling(spp=32, seed=1))
    for k, view in enumerate(views):
        alone = mi_lcair.signature(seen_from(cylinder, view, 32), spp=32, seed=5 + k).target
        value, error = together.parts["target"][:, k]
        assert abs(value - alone.intensity) <= 4 * np.hypot(error, alone.standard_error)
        groups = [
            together.parts[name][0, k] for name in together.parts if name.startswith("group.")
        ]
        bounces = [
            together.parts[name][0, k] for name in together.parts if name.startswith("bounce.")
        ]
        assert sum(groups) == pytest.approx(value, rel=1e-5) and sum(bounces) == pytest.approx(
            value, rel=1e-5
        )


@pytest.mark.slow
@pytest.mark.parametrize("spp, resolution, low", [(4, 16, 0.5), (1, 32, 0.3)])
def test_standard_errors_are_those_of_repetitions(cylinder, spp, resolution, low):
    """The scatter over 30 seeds against the errors stated: within the 99.9 % range of chi squared
    for 2 x 29; from neighbours, smaller.
    """
    runs = [
        render_views(cylinder, [View(0, 20), View(120)], resolution, Sampling(spp=spp, seed=seed))
        for seed in range(30)
    ]
    values, errors = np.moveaxis([run.parts["target"] for run in runs], 1, 0)
    ratio = values.var(axis=0, ddof=1).sum() / np.mean(errors**2, axis=0).sum()
    assert low < ratio < 1.7


@pytest.mark.slow
def test_a_seed_gives_its_numbers_and_a_tolerance_its_error(cylinder):
    views = [View(10.0), View(170.0)]
    first, again, other = (
        render_views(cylinder, views, 32, Sampling(tolerance=0.004, seed=seed))
        for seed in (3, 3, 4)
    )
    assert np.array_equal(first.parts["target"], again.parts["target"])
    assert not np.array_equal(first.parts["target"], other.parts["target"])
    assert first.excess.max() <= 1 and first.paths.sum() > FIRST_PATHS
    stopped = render_views(cylinder, views, 32, Sampling(tolerance=1e-4, max_spp=4))
    assert set(stopped.paths) == {4 * 32**2} and stopped.excess.min() > 1
    # 7 x 31 x 31 = 6727 paths are not a multiple of the 8 randomisations
    assert render_views(
        cylinder, views, 31, Sampling(tolerance=1e-4, max_spp=7)
    ).paths.tolist() == [
        6728,
        6728,
    ]


@pytest.mark.slow
def test_a_hot_source_that_no_path_met_counts(plate):
    """A speck at 3000 K, 4 mm wide, before a cold slab: the first paths miss it, and the tolerance
    asks for more.
    """
    speck = [
        [-0.002, -0.002, 0.31],
        [0.002, -0.002, 0.31],
        [0.002, 0.002, 0.31],
        [-0.002, 0.002, 0.31],
    ]
    scene = loaded(
        slab=plate("slab", SLAB, BLACK, 300.0),
        speck=plate("speck", speck, BLACK, 3000.0, group="speck"),
    )
    found = render_views(scene, [View(0, 90)], 16, Sampling(tolerance=0.02))
    exact = (0.08 - 1.6e-5) * L_300 + 1.6e-5 * float(in_band_radiance(band("LWIR"), 3000.0))
    assert found.paths[0] > FIRST_PATHS and found.parts["target"][0, 0] == pytest.approx(
        exact, rel=0.1
    )


@pytest.mark.slow
def test_a_view_of_nothing_does_not_keep_the_others(plate):
    """A one-sided slab, from above and from below, where it sends nothing: no tolerance of nothing
    can be reached.
    """
    found = render_views(
        loaded(slab=plate("slab", SLAB, BLACK, 300.0)),
        [View(0, 90), View(0, -90)],
        16,
        Sampling(tolerance=0.01),
    )
    assert (
        found.parts["target"][0, 1] == 0 and found.excess.max() <= 1 and found.paths.max() <= 2**18
    )
    alone = render_views(
        loaded(slab=plate("slab", SLAB, BLACK, 300.0)), [View(0, -90)], 16, Sampling(tolerance=0.01)
    )
    assert alone.excess.max() <= 1 and 2**12 < alone.paths[0] <= 2**18


def test_bad_input(plate, cylinder):
    for view, message in (
        ((np.nan, 0), "azimuth_deg = nan; must be finite"),
        ((0, 91), "elevation_deg = 91; must lie in -90..90"),
    ):
        with pytest.raises(InputError, match=message):
            View(*view)
    slab = plate("slab", SLAB, BLACK, 300.0)
    slab["emitter"]["facet_type"] = "sky"
    with pytest.raises(InputError, match="no model to look at"):
        Target.of(loaded(slab=slab))


def test_the_text_of_a_view_does_not_depend_on_how_numpy_prints():
    """Seeds are made from the text, also in other processes."""
    with np.printoptions(legacy="1.25"):
        old = repr(View(np.float64(0.1), np.float64(-2)))
    assert repr(View(np.float64(0.1), np.float64(-2))) == old == repr(View(0.1, -2))
