"""Shares and rows of the page of measured cases, and its data."""

import numpy as np
import pytest

from docs.studies.cases import nist
from docs.studies.cases.comparison import Comparison, columns, write_rows


def test_shares_rms_and_bias():
    case = Comparison("a", "K", [1.0, 2.0, 4.0, 3.0], [1.0, 1.0, 1.0, 3.5], half_width=1.0)
    assert case.inside == 0.75 and case.width == 2.0
    assert case.rms == pytest.approx(np.sqrt(10.25 / 4)) and case.bias == pytest.approx(0.875)
    assert case.row == "| a | 4 | 75.0% | 1.6 | +0.88 | 2 | K |"
    assert np.isnan(Comparison("b", "K", [1.0], [2.0]).inside)


def test_data_have_numbers_and_names(tmp_path):
    data = columns("surfrad_alamosa.csv")
    assert len(data["surface_K"]) == 144 and data["surface_K"].min() > 240
    assert (columns("l_room_view_factors.csv")["F"] > 0).sum() == 48
    write_rows(tmp_path / "rows.csv", {"hour": np.arange(2), "x": np.array([1.5, 2.5])})
    assert (tmp_path / "rows.csv").read_text() == "hour,x\n0,1.5\n1,2.5\n"


def test_least_squares_have_ten_digits_of_certified_values():
    """Of NIST's problems, also from the start of MGH09 that is far away."""
    case = nist.compare()
    assert len(case.residual) == 26 and abs(case.residual).max() < 1e-10
