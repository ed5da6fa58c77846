"""Draws of a data set: their distributions, and that each has random numbers of its own."""

import numpy as np
import pytest
from scipy import stats

from mi_lcair.detection.datasets.description import DatasetDescription
from mi_lcair.detection.datasets.draws import cases_of
from mi_lcair.detection.scenario import Scenario
from mi_lcair.detection.setting import target_scene
from tests.detection.datasets.box_set import write_box

DRAWS = {
    "background.temperature": {"uniform": [270, 290]},
    "lid.temperature": 5,
    "self.temperature": "1 %",
    "camera.f_number": {"triangular": 0.2},
    "gloss_black.epsilon": {"normal": 0.02, "upper": 0.91},
    "atmosphere.table": {"choice": ["vacuum", "us_standard", "midlat_summer"]},
}
# Closed forms with the values of the scene: lid 330 K, self 310 K, f/2, epsilon 0.912
LAWS = {
    "background.temperature": stats.uniform(270, 20),
    "target.parameters.lid.temperature": stats.norm(330, 5),
    "target.parameters.self.temperature": stats.norm(310, 3.1),
    "camera.f_number": stats.triang(0.5, 1.8, 0.4),
}


@pytest.fixture(scope="module")
def of(tmp_path_factory):
    """A function that gives the cases for some tables."""
    folder, known = tmp_path_factory.mktemp("draws"), {}

    def cases(**tables):
        description = DatasetDescription.read(write_box(folder, **tables))
        if not known:
            known["scenario"] = Scenario.read(description.base.scenario)
            known["scene"] = target_scene(known["scenario"], known["scenario"].sensor.detector())
        return cases_of(description, known["scenario"], known["scene"])

    return cases


VIEWS = {"random": 100, "range_m": [40, 60], "elevation_deg": [10, 60]}


def test_draws_have_the_stated_distributions(of):
    """Kolmogorov and Smirnov's test, at a significance of 1e-3; choices by chi squared."""
    cases = of(draws=DRAWS | {"gloss_black.epsilon": 0.01}, views=VIEWS, frames={"cases": 4})
    assert len(cases) == 400
    for name, law in LAWS.items():
        values = [case.changes[name] for case in cases]
        assert stats.kstest(values, law.cdf).pvalue > 1e-3, name
    tables = [case.changes["atmosphere.table"] for case in cases]
    counts = [tables.count(name) for name in DRAWS["atmosphere.table"]["choice"]]
    assert sum(counts) == 400 and stats.chisquare(counts).pvalue > 1e-3
    drawn = np.array([[case.changes[name] for name in LAWS] for case in cases])
    correlation = np.corrcoef(drawn.T)[np.triu_indices(len(LAWS), 1)]
    assert np.max(np.abs(correlation)) < 4 / np.sqrt(400)


def test_directions_fill_the_part_of_the_sphere(of):
    """Sines of elevations, azimuths and ranges are even between their ends."""
    for views, exact in ((VIEWS, False), ({**VIEWS, "random": None, "sphere": 100}, True)):
        views = {name: value for name, value in views.items() if value is not None}
        changes = [case.changes for case in of(views=views, draws=None, frames={"seed": 1})]
        sine = np.sin(np.radians([of["observer.elevation_deg"] for of in changes]))
        low, high = np.sin(np.radians([10, 60]))
        turns = np.array([of["observer.azimuth_deg"] for of in changes]) / 360
        ranges = (np.array([of["observer.range_m"] for of in changes]) - 40) / 20
        for values in ((sine - low) / (high - low), turns, ranges):
            assert stats.kstest(values, stats.uniform.cdf).pvalue > 1e-3
        if exact:
            np.testing.assert_allclose(
                np.sort(sine), low + (high - low) * (np.arange(100) + 0.5) / 100
            )


def test_a_view_depends_on_the_seed_and_its_number_alone(of):
    """Neither on the number of views and cases, nor on other draws."""
    few = of(views=VIEWS | {"random": 3}, frames={"seed": 5}, draws={"lid.temperature": 5})
    many = of(
        views=VIEWS | {"random": 9},
        frames={"seed": 5, "cases": 2},
        draws=DRAWS | {"gloss_black.epsilon": 0.01},
    )
    other = of(views=VIEWS | {"random": 3}, frames={"seed": 6}, draws={"lid.temperature": 5})
    for case in few:
        same = next(of for of in many if of.view == case.view)
        assert {name: same.changes[name] for name in case.changes} == case.changes
    names = ("render.seed", "observer.range_m", "target.parameters.lid.temperature")
    for first, second in zip(few, other):
        assert all(first.changes[name] != second.changes[name] for name in names)
    seeds = [case.changes["render.seed"] for case in many]
    assert len(set(seeds)) == 9


def test_splits_have_their_shares(of):
    cases = of(views=VIEWS, frames={"cases": 2}, splits={"train": 0.7, "val": 0.2, "test": 0.1})
    splits = {case.view: case.split for case in cases}
    assert {name: [*splits.values()].count(name) for name in ("train", "val", "test")} == {
        "train": 70,
        "val": 20,
        "test": 10,
    }
    assert all(case.split == splits[case.view] for case in cases)
    assert len(set(list(splits.values())[:20])) > 1  # not in the order of the views
