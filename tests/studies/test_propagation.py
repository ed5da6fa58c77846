"""The page of propagation methods: it says what the points say."""

import re

import pytest

from benchmarks.methods.propagation import METHODS
from docs.studies.propagation import CHOICE, fields, write
from tests.benchmarks.test_propagation import result


def test_page_says_what_the_points_say():
    text = fields(result(), "the command")
    assert (
        "mirror, one bounce"
        in text["tables"].split("### hall")[0].split("do not reach it within 0.1 s")[1]
    )
    assert "| radiosity (" in text["summary"].splitlines()[0]  # the fastest of the thesis's
    assert text["summary"].splitlines()[0].split(" | ")[4] == "10"
    assert text["ambient"] == "on 2 of 3 openings, up to 0.300 of the sphere"
    assert text["tail_worst"] == "0.020 %"
    assert "| hall | +30.0 % |" in text["closures"]


@pytest.mark.slow
def test_page(tmp_path):
    write(tmp_path, result())
    assert len(list(tmp_path.iterdir())) == 7
    assert not re.search(r"[{}]", (tmp_path / "propagation.md").read_text())


def test_choice_of_the_thesis_is_a_method():
    assert CHOICE in {method.name for method in METHODS}
