"""The result of an exchange: table, pairs with errors, files, console, picture, and its claims."""

import json

import mitsuba as mi
import numpy as np
import pytest
from matplotlib.colors import rgb_to_hsv
from scipy import sparse

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.heating.conductors import RINGS_DEG
from mi_lcair.physics.blackbody import STEFAN_BOLTZMANN
from mi_lcair.rendering.statistics import student_factor
from mi_lcair.sections import Table
from tests.heating.scenes import box, emits, grey, mirror_box, scene_of, spheres, square


@pytest.fixture(scope="module")
def result():
    """A black box in whose middle a plate floats, both with temperatures."""
    plate = square({"type": "twosided", "bsdf": grey(0.5)}, emitter=emits("plate", 350.0))
    plate["to_world"] = plate["to_world"] @ plate["to_world"].scale([0.5, 0.5, 1])
    scene = scene_of(box=box(grey(0.8), emitter=emits("box")), plate=plate)
    return mi_lcair.exchange(scene, paths=512, sun_deg=(40, 30))


def test_the_irradiance_is_that_of_both_temperatures(result):
    columns = result.columns()
    assert "irradiance_W_m2" in columns  # nothing escapes
    low, high = STEFAN_BOLTZMANN * np.array([300.0, 350.0]) ** 4
    E, error = columns["irradiance_W_m2"], columns["irradiance_error_W_m2"]
    assert low < E.min() and E.max() < high and np.all(error < 0.1 * E)
    np.testing.assert_allclose(STEFAN_BOLTZMANN * columns["environment_K"] ** 4, E)


def test_pairs_have_their_errors(result):
    pairs = result.pairs()
    n = result.facets.number.max() + 1
    i, j = pairs["facet"], pairs["other_facet"]
    upper = sparse.triu(result.conductors.between, 1).toarray()
    dense = sparse.coo_array((pairs["conductor_m2"], (i, j)), shape=(n, n)).toarray()
    np.testing.assert_allclose(dense, upper)
    scatter = result.traced.standard_error(lambda C: C.between.toarray())[i, j]
    area = result.facets.radiating_area
    share = 1 - np.transpose([area[i], area[j]]) / (area[i] + area[j])[:, None]
    path = (share * np.transpose([result.traced.path_area[k] for k in (i, j)])).max(axis=1)
    value, agree = pairs["conductor_m2"], scatter < 0.01 * pairs["conductor_m2"]
    expected = np.maximum(scatter, np.where(agree, np.minimum(1.5 * path, value), 0))
    np.testing.assert_allclose(pairs["conductor_error_m2"], expected)


def test_pairs_that_few_paths_meet_are_within_their_errors():
    """Of some seeds, equally many paths of each randomisation meet the other square."""
    T, held = mi.ScalarTransform4f(), []
    half = T.translate([0, 0, 2]).rotate([1, 0, 0], 180)
    scene = scene_of(
        lower=square(grey(1.0), emitter=emits("lower")),
        upper=square(grey(1.0), half, emitter=emits("upper")),
    )
    # Two equal squares of side 2 at the distance 2
    exact = 4 * 0.199825
    for seed in range(60):
        pairs = mi_lcair.exchange(scene, paths=64, seed=seed).pairs()
        (value,), (error,) = pairs["conductor_m2"], pairs["conductor_error_m2"]
        held.append(abs(value - exact) < student_factor(7) * error)
    assert np.mean(held) >= 0.9


def test_files_hold_the_facets_and_the_matrix(result, tmp_path):
    xarray = pytest.importorskip("xarray")
    for suffix in (".csv", ".nc", ".vtp", ".png", ".json"):
        result.save(tmp_path / f"exchange{suffix}")
    with xarray.open_dataset(tmp_path / "exchange.nc", engine="scipy") as dataset:
        assert dataset["to_sky_m2"].shape == (len(result.facets.number), len(RINGS_DEG) - 1)
        for name, values in result.pairs().items():
            np.testing.assert_array_equal(dataset[f"pair_{name}"], values)
    result.save(tmp_path / "exchange.html")
    entries = json.loads((tmp_path / "exchange.json").read_text())
    assert entries["groups"] == ["box", "plate"]


def test_the_console_shows_groups_conductors_and_sunlight(result):
    tables = [part for part in result.sections()[0].parts if isinstance(part, Table)]
    groups, pairs, sky, sun = tables
    assert [row[:2] for row in groups.rows] == [("box", 12), ("plate", 1)]
    shares = np.array([[cell[0] for cell in row[4:8]] for row in groups.rows])
    np.testing.assert_allclose(shares.sum(axis=1), 1, atol=0.02)
    assert pairs.rows[0][:2] == ("box", "plate") and len(sky.rows) == len(sun.rows) == 2


def test_a_group_that_emits_nothing_has_tables_and_a_picture(tmp_path):
    shapes = mirror_box(0.9, 0.9)
    shapes["mirror0"]["emitter"] = emits("mirror")
    result = mi_lcair.exchange(scene_of(**shapes), paths=64, sky_K=300, ground_K=300)
    result.save(tmp_path / "e.html")
    result.save(tmp_path / "e.png")
    mirror = result.facets.groups.index("mirror")
    assert result.facets.share_of_groups(result.astray["buried"])[mirror] == 0
    assert np.isnan(result.columns()["irradiance_W_m2"]).sum() == 1


def test_the_rings_of_the_sky_have_shades_and_other_parts_have_colours_of_their_own(result):
    panel = result.plot().axes[0]
    colours = {
        bars.get_label(): rgb_to_hsv(bars.patches[0].get_facecolor()[:3])
        for bars in panel.containers
    }
    sky = np.array([colour for name, colour in colours.items() if name.startswith("sky")])
    others = np.array([colour for name, colour in colours.items() if not name.startswith("sky")])
    assert len(sky) == 9 and len(others) == 4
    assert np.ptp(sky[:, 0]) < 0.1 and np.all(np.diff(sky[:, 1]) < 0)
    assert np.abs(others[:, 0] - sky[:, 0].mean()).min() > 0.1
    assert len(np.unique(others[:, 0])) == 4


def test_the_irradiance_needs_all_temperatures():
    scene = scene_of(plate=square(grey(0.8), emitter=emits()))
    assert mi_lcair.exchange(scene, paths=64).irradiance is None
    result = mi_lcair.exchange(scene, paths=64, sky_K=250.0)
    np.testing.assert_allclose(result.columns()["environment_K"], 250.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"paths": 0}, "paths = 0"),
        ({"sky_K": -1.0}, "sky_K = -1"),
        ({"sun_deg": (91, 0)}, "elevation of the sun = 91"),
    ],
)
def test_bad_arguments_are_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        mi_lcair.exchange("cavity", **arguments)


def test_intervals_of_conductors_cover_the_truth():
    """40 seeds of concentric spheres: 34 to 40 of the 95 % intervals hold the exact conductor."""
    scene = spheres(grey(0.5), grey(0.3))
    exact = 4 * np.pi / (1 / 0.5 + (1 / 0.3 - 1) / 4)
    covers = 0
    for seed in range(40):
        traced = mi_lcair.exchange(scene, paths=256, seed=seed).traced
        error = traced.standard_error(lambda C: C.between[[0], [1]])[0]
        covers += abs(traced.mean.between[0, 1] - exact) < student_factor(7) * error
    assert covers >= 34


def test_derivatives_follow_from_common_random_numbers():
    """The conductor of grey plates for two emissivities with the same seed."""
    step = 1e-3
    low, high = (
        mi_lcair.exchange(scene_of(**mirror_box(e, 0.2)), paths=512).conductors.between[0, 1]
        for e in (0.5 - step, 0.5 + step)
    )
    exact = 4 / (1 / 0.5 + 1 / 0.2 - 1) ** 2 / 0.5**2
    assert (high - low) / (2 * step) == pytest.approx(exact, rel=1e-3)


def test_shares_that_few_paths_meet_are_within_their_errors():
    """A ceiling over a small plate that one path of the plate meets, or two, or none."""
    T = mi.ScalarTransform4f()
    rays, share = 64, 0.02  # view factor of a disc of area pi at the height h: 1 / (1 + h^2)
    height = (1 / share - 1) ** 0.5
    disc = {"type": "disk", "to_world": T.translate([0, 0, height]).rotate([1, 0, 0], 180)}
    scene = scene_of(
        plate=square(grey(1.0), T.scale([1e-2, 1e-2, 1]), emitter=emits("plate")),
        disc={**disc, "bsdf": grey(1.0), "emitter": emits("disc", 310.0)},
    )
    met, held = set(), 0
    for seed in range(40):
        columns = mi_lcair.exchange(scene, paths=rays, seed=seed).columns()
        (k,) = np.flatnonzero(columns["group"] == "plate")
        to_sky, error = columns["sky"][k], columns["sky_error"][k]
        assert error > 0 and columns["ground_error"][k] == pytest.approx(1.5 / rays)
        met.add(round((1 - to_sky) * rays))
        held += abs(1 - share - to_sky) < student_factor(7) * error
    assert {0, 1, 2} <= met and held >= 36
