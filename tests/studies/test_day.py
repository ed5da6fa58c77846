"""The page of the airliner by day: the parts of the target's irradiance, and the table of it."""

import numpy as np
import pytest

import mi_lcair
from docs.studies import day
from docs.studies.landing import CASES
from mi_lcair.estimate import Estimate

FEW = {"render.resolution": 32, "render.spp": 16, "render.max_bounces": 1}


@pytest.fixture(scope="module")
def contrasts():
    return {light: mi_lcair.contrast(day.scenario(2, "MWIR", light, **FEW)) for light in day.LIGHTS}


def test_the_parts_add_up_to_the_target(contrasts):
    by_day = contrasts["day"]
    row = by_day.rows[-1]
    groups = {source.group for source in row.irradiance.areas.sources}
    parts = {group: day.part(by_day, group) for group in groups}
    total = sum(part.value for part in parts.values())
    assert total == pytest.approx(row.target.value, rel=1e-12)
    assert parts["sun"].value > 0 and 0 < parts["sun"].standard_error < np.inf


def test_a_group_that_is_not_there_has_no_part(contrasts):
    assert day.part(contrasts["night"], "sun") == Estimate(0.0, 0.0)


def test_rows_of_the_table(contrasts):
    table = day.contrast_rows(
        {(*case, light): contrasts[light] for case in CASES for light in day.LIGHTS}
    )
    assert [row.split("|")[1:3] for row in table.splitlines()] == [
        [f" {position} ", f" {band} "] for position, band in CASES
    ]
    assert day.measured(Estimate(4.151e-3, 1.2e-5)) == "(4.15 ± 0.012)·10⁻³"
    assert day.measured(Estimate(-4.151e-3, 1.2e-5)) == "(-4.15 ± 0.012)·10⁻³"
