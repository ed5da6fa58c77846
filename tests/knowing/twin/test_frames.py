"""Frames of a camera through a day: derivatives, truths, what is untold, and bad input."""

import numpy as np
import pytest

import mi_lcair
from mi_lcair.api.scenes import scene_of
from mi_lcair.errors import InputError
from mi_lcair.heating.temperatures.description import HeatDescription
from mi_lcair.knowing.twin.answers import expected, of_rows
from mi_lcair.knowing.twin.estimate import evaluated
from mi_lcair.knowing.twin.model import Twin
from mi_lcair.knowing.twin.problem import twin_problem
from tests.knowing.twin import box_day

HOURS = (4, 9, 13, 19)
FEW = ("lid.absorptance", "lid.thickness_mm", "terrain.inertia")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return box_day.folder(tmp_path_factory.mktemp("twin"))


@pytest.fixture(scope="module")
def problem(folder):
    """A problem with all unknowns, its truth, and four small frames."""
    random = np.random.default_rng(3)
    truth = box_day.drawn(random, {n: box_day.PRIORS[n] for n in FEW})
    run = {"steps": 24, "rays": 256}
    heat = mi_lcair.heat(box_day.heat_of(folder, truth, sigma={"model_K": 0}, run=run))
    frames = box_day.frames_of(folder, heat, HOURS, random, resolution=32)
    sigma = box_day.SIGMA | {"model_K": 0.1}
    box_day.write_heat(folder / "heat.toml", box_day.heat_of(folder, sigma=sigma, run=run))
    return box_day.problem(folder, frames), truth


def twin_of(tree: dict) -> Twin:
    stated = twin_problem(tree)
    description = HeatDescription.read(stated.heat.file)
    target = description.target
    return Twin(scene_of(target.scene, target.parameters), description, stated)


def test_derivatives_are_those_of_differences(problem, folder):
    """Of the frames with respect to every unknown, within 1e-4 of the largest."""
    run = {"steps": 24, "rays": 64, "start_K": 290.0}  # no days until they are periodic
    tree = box_day.heat_of(folder, run=run)
    tree["groups"]["sides"]["internal_by_hour"] = [0.0, 10.0, 20.0]
    box_day.write_heat(folder / "series.toml", tree)
    more = dict.fromkeys(("sides.internal_by_hour[1]", "sides.density", "south.back_h"), {})
    problem = problem[0] | {"heat": {"file": str(folder / "series.toml")}}
    twin = twin_of(problem | {"unknowns": problem["unknowns"] | more})
    z, step = np.zeros(len(twin.mean)), 1e-3
    course = twin.course(z)

    def residuals(at, like):
        return np.concatenate([row.block.residual for row in twin.rows(like, at)])

    slopes = []
    for row in twin.rows(course, z):
        slopes.append(
            np.array([row.block.facets @ of for of in row.of_facets[:, : len(twin.unknowns)].T])
        )
    slopes = np.concatenate(slopes, axis=1)
    for k, unknown in enumerate(twin.unknowns):
        ends = []
        for side in (step, -step):
            moved = np.where(np.arange(len(z)) == k, side, z)
            ends.append(residuals(moved, twin.course(moved, course)))
        difference = (ends[1] - ends[0]) / (2 * step)
        error = abs(slopes[k] - difference).max()
        assert error < 1e-4 * abs(difference).max(), unknown.name


def test_truths_are_found_with_a_camera_of_unknown_gain(problem, folder, tmp_path):
    """Within four standard errors; what is saved holds the values and goes together as found."""
    tree, truth = problem
    tree = tree | {"unknowns": {name: tree["unknowns"][name] for name in FEW}}
    found = mi_lcair.invert(tree, advise=False)
    assert found.p_value > 1e-3 and not found.alike
    for name, value, error in zip(found.names, found.value, found.standard_error):
        assert abs(value - truth[name]) < 4 * error, name
    assert found.verdicts == ["determined"] * 3
    assert found.rms_K < found.rms_before_K
    assert [name.partition(": ")[2] for name in found.instruments] == ["gain [1]", "offset [K]"]
    found.save(tmp_path / "twin.toml")
    heat = mi_lcair.heat(tmp_path / "twin.toml")
    changes = {row.quantity: row.contribution for row in heat.inputs}
    names = [f"{name} and others" for name in FEW]
    assert set(names) < set(changes)
    # The same variance from errors that do not go together, and their correlations
    text = (tmp_path / "twin.toml").read_text()
    (tmp_path / "alone.toml").write_text(text.partition("\n[correlation]")[0])
    alone = {r.quantity: r.contribution for r in mi_lcair.heat(tmp_path / "alone.toml").inputs}
    by_input = np.array([alone[name] for name in FEW])
    expected = np.einsum("ij,imn,jmn->mn", found.correlation, by_input, by_input)
    together = sum(changes[name] ** 2 for name in names)
    np.testing.assert_allclose(together, expected, rtol=2e-3, atol=1e-6)


@pytest.mark.parametrize("number", [0])
def test_combinations_that_no_reading_tells_are_named(folder, number):
    tree, expected = box_day.untold(folder, number)
    found = mi_lcair.invert(tree)
    named = box_day.named(found.alike, found.names)
    assert sorted(map(sorted, named)) == sorted(map(sorted, expected))
    assert len(found.advice) == len(expected)


def test_a_frame_in_another_band_tells_what_it_promises(problem, folder, tmp_path):
    """Its information without taking it is that of a problem which has this frame."""
    (tmp_path / "box").symlink_to(folder / "box")
    unknowns = {"gloss_black.epsilon": {"prior": [0.9, 0.05]}, "lid.internal_W_m2": {}}
    tree = problem[0] | {"unknowns": unknowns}
    twin = twin_of(tree)
    z = np.zeros(len(twin.mean))
    state = evaluated(twin, z)
    alone = np.linalg.inv(state.information + twin.precision)[:2, :2]
    other = twin.in_band(state.course, z, 0, "MWIR")
    more = of_rows(*expected(twin, other, other.traced.cameras[0], 13, twin.cameras[0]))
    promised = np.linalg.inv(state.information + twin.precision + more)[:2, :2]
    heat = mi_lcair.heat(folder / "heat.toml")
    random = np.random.default_rng(4)
    frame = box_day.frames_of(tmp_path, heat, (13,), random, resolution=32, band="MWIR")
    both = twin_of(tree | {"frames": [*tree["frames"], frame]})
    state = evaluated(both, np.zeros(len(both.mean)))
    kept = np.linalg.inv(state.information + both.precision)[:2, :2]
    errors = np.sqrt([np.diag(covariance) for covariance in (promised, kept, alone)])
    np.testing.assert_allclose(errors[0], errors[1], rtol=0.15)  # of groups in place of facets
    assert (errors[1] < 0.8 * errors[2]).any()


def test_a_wrong_model_is_withdrawn(problem, folder):
    """A lid without its thickness among the unknowns, and no error of the model."""
    tree, _ = problem
    wrong = box_day.heat_of(folder, {"lid.thickness_mm": 20.0}, sigma={"model_K": 0, "air_K": 0.1})
    box_day.write_heat(folder / "wrong.toml", wrong)
    unknowns = {"lid.absorptance": tree["unknowns"]["lid.absorptance"]}
    heat = {"file": str(folder / "wrong.toml")}
    found = mi_lcair.invert(tree | {"heat": heat, "unknowns": unknowns}, advise=False)
    assert found.p_value < 1e-3 and "the model misses" in found.verdicts[0]


BAD = {
    "hours": ({"list": "hour,image\n30,frame_00.npy\n"}, "hours 30 to 30 are not those of one day"),
    "no image": ({"list": "hour,image\n3,none.npy\n"}, "none.npy"),
    "sensor": ({"sensor": 4}, "sensor"),
    "size": ({"parameters": {"band": "LWIR", "resolution": 16}}, "has 32 x 32 pixels"),
    "noise": ({"netd_mK": 0.0}, "netd_mK"),
    "gain": ({"gain_sigma": "three"}, "gain_sigma|three"),
    "mask": ({"mask": "mask.npy"}, "the mask has 4 x 4 pixels"),
    "twice": (
        {"list": "hour,image\n3,frame_00.npy\n3,frame_01.npy\n"},
        "hour 3 stands in two rows",
    ),
    "column": ({"list": "hour,image,moon.temperature\n3,frame_00.npy,4\n"}, "moon.temperature"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_frames_are_refused(problem, folder, case):
    change, message = BAD[case]
    tree, _ = problem
    if "list" in change:
        (folder / "bad.csv").write_text(change["list"])
        change = {"list": str(folder / "bad.csv")}
    if "mask" in change:
        np.save(folder / "mask.npy", np.ones((4, 4)))
        change = {"mask": str(folder / "mask.npy")}
    with pytest.raises(InputError, match=message):
        mi_lcair.invert(tree | {"frames": [tree["frames"][0] | change]})


def test_cameras_of_one_name_are_refused(problem):
    frames = problem[0]["frames"][0] | {"name": "mast"}
    with pytest.raises(InputError, match="two cameras have the name 'mast'"):
        mi_lcair.invert(problem[0] | {"frames": [frames, frames]})


def test_inertia_beside_its_part_is_refused(problem):
    with pytest.raises(InputError, match="is a factor of 'lid.density'; give one"):
        mi_lcair.invert(problem[0] | {"unknowns": {"lid.inertia": {}, "lid.density": {}}})


def test_emissivity_of_a_group_is_refused_beside_frames(problem):
    with pytest.raises(InputError, match="frames need the parameter of its material"):
        mi_lcair.invert(problem[0] | {"unknowns": {"lid.emissivity": {}}})
