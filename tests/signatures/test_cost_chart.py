"""The chart of error against processor time, on a room with a closed form."""

import json

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.show.kinds import read_result
from mi_lcair.signatures.cost_chart import Way, frontier
from tests.plugins.small_scenes import camera

REFLECTED = 0.3  # of the room's walls


@pytest.fixture(scope="module")
def room():
    """Inside of a sphere of one temperature, whose n reflections leave out 0.3^(n+1)."""
    walls = {
        "type": "sphere",
        "flip_normals": True,
        "bsdf": {"type": "diffuse", "reflectance": {"type": "uniform", "value": REFLECTED}},
        "emitter": {"type": "thermal", "temperature": 300.0, "band": "LWIR"},
    }
    integrator = {"type": "bounce_path", "max_bounces": 8}
    sensor = camera(height=0.5, origin=(0, 0, 0.5))
    return mi.load_dict({"type": "scene", "integrator": integrator, "sensor": sensor, "a": walls})


@pytest.fixture(scope="module")
def chart(room):
    return mi_lcair.chart(room, tolerance=0.01, seconds=30)


def test_what_few_reflections_leave_out(chart):
    table = chart.table
    for count, change, error in zip(
        table["max_bounces"], table["left_out"], table["left_out_error"]
    ):
        assert change == pytest.approx(-(REFLECTED ** (count + 1)), abs=4 * error + 1e-5)
        assert error < 0.002
    assert {2, 3, 4} <= set(table["max_bounces"])
    # With all reflections it is the reference, without an error of rounding
    assert table["left_out"][(table["reflection"] == "scene").nonzero()[0]].max() == 0
    assert chart.words(chart.recommended).startswith(f"{table['max_bounces'][chart.recommended]} r")
    assert ", LWIR 8-12 um: for 1 % use" in chart.summary()


def test_the_cheapest_way_that_meets_the_tolerance_is_recommended(chart, room):
    best = chart.recommended
    left_out = abs(chart.table["left_out"]) + chart.table["left_out_error"]
    met = (chart.table["error"] <= chart.tolerance) & (left_out <= 0.6 * chart.tolerance)
    assert met[best] and chart.table["cpu_s"][best] == chart.table["cpu_s"][met].min()
    # 3 reflections leave out .81 %, too near to 1 %
    assert chart.table["max_bounces"][best] >= 4
    assert f"--max-bounces {chart.table['max_bounces'][best]}" in chart.command
    way = Way(int(chart.table["max_bounces"][best]), "", "", -(REFLECTED**5), 0)
    truth = chart.intensity_W_sr
    for seed in range(5):
        made = mi_lcair.signature(
            room, tolerance=way.noise(0.01), max_bounces=way.max_bounces, seed=seed
        )
        assert made.intensity == pytest.approx(truth, rel=0.01 + chart.half_width_W_sr / truth)


def test_noise_and_what_is_left_out_share_the_tolerance():
    assert Way(3, "", "", 0.0, 0.0).noise(0.01) == 0.01
    assert Way(3, "", "", -0.002, 0.001).noise(0.005) == pytest.approx(0.004)
    assert Way(3, "", "", 0.006, 0.001).noise(0.01) == 0  # nothing is left for the noise


def test_the_frontier_is_what_nothing_beats():
    cost, error = np.random.default_rng(1).integers(0, 9, (2, 40)).astype(float)
    on_it = frontier(cost, error).astype(bool)
    for k in range(40):
        beaten = any(
            cost[j] <= cost[k]
            and error[j] <= error[k]
            and (cost[j], error[j]) != (cost[k], error[k])
            for j in range(40)
        )
        assert not (on_it[k] and beaten)
        same = (cost == cost[k]) & (error == error[k])
        assert beaten or on_it[same].sum() == 1


def test_no_time_leaves_ways_untried(room):
    chart = mi_lcair.chart(room, tolerance=0.05, seconds=1e-3)
    assert len(chart.table["error"]) == 1 and chart.untried > 0
    assert f"{chart.untried} settings, because the time was over" in str(chart.sections())


def test_files_hold_the_chart(chart, tmp_path):
    chart.save(tmp_path / "chart.json")
    again = read_result(tmp_path / "chart.json")
    assert again.summary() == chart.summary()
    assert json.loads((tmp_path / "chart.json").read_text())["kind"] == "chart"
    chart.save(tmp_path / "chart.csv")
    assert "cpu_s" in (tmp_path / "chart.csv").read_text()


def test_the_picture_has_a_point_for_each_way(chart):
    (axes,) = chart.plot().axes
    numbers = [text.get_text() for text in axes.texts]
    assert numbers == [str(count) for count in chart.table["max_bounces"]]
    assert axes.get_xscale() == axes.get_yscale() == "log"
    assert "processor time" in axes.get_xlabel() and "%" in axes.get_ylabel()


@pytest.mark.parametrize("wrong", [{"seconds": 0}, {"tolerance": 0}])
def test_wrong_numbers_are_refused(room, wrong):
    with pytest.raises(InputError, match=next(iter(wrong))):
        mi_lcair.chart(room, **wrong)
