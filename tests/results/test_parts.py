"""Parts that results share: strict JSON, facts, details, and tables of contributions."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.estimate import Contribution, Estimate
from mi_lcair.results import (
    Recorded,
    Result,
    check_options,
    columns_of,
    contributions,
    details,
    entry,
    extremes,
    settings_section,
    strict,
    summary_of,
)
from mi_lcair.sections import Facts, Remarks, Section


class View(NamedTuple):
    azimuth: float
    elevation: float = np.inf


@dataclass
class Plate:
    area: np.float32
    views: list


def test_strict_json():
    plate = Plate(np.float32(0.5), [View(np.int64(3)), (True, None)])
    assert strict(plate) == {
        "area": 0.5,
        "views": [{"azimuth": 3, "elevation": None}, [True, None]],
    }
    assert strict({1: np.array([[1.5, np.nan]]), "e": Estimate(2.0, 0.5)}) == {
        "1": [[1.5, None]],
        "e": {"value": 2, "standard_error": 0.5},
    }


def test_columns_from_lists():
    columns = columns_of({"range_m": [1, None], "name": ["a", None]})
    np.testing.assert_array_equal(columns["range_m"], [1, np.nan])
    assert columns["name"].tolist() == ["a", None]


def test_extremes_are_those_of_quantities():
    """Not of errors, flags, texts and columns without a value."""
    numbers = np.array([3.0, np.nan, 1.23456])
    columns = dict.fromkeys(
        ("a_K", "a_standard_error_K", "half_width_K", "a_half_width_K"), numbers
    )
    columns |= {"reached": np.array([1, 0, 1]), "name": np.array(["x", "y", "z"])}
    columns |= {"nothing": np.full(3, np.nan), "facet": np.array([5, 4, 6])}
    rows = [("a_K", "1.2346 to 3"), ("half_width_K", "1.2346 to 3"), ("facet", "4 to 6")]
    assert extremes(columns) == Facts(rows)


def test_details_are_numbers_and_texts():
    entries = {"kind": "x", "range_m": 5.0, "time_s": 2, "made": '{"a": 1}', "list": [1], "spp": 4}
    (facts,) = details(entries).parts
    assert facts.rows == [("range (m)", 5), ("made", "a=1"), ("spp", 4)]
    assert details(entries).is_detail and details(entries, "How").title == "How"


@dataclass
class Settings:
    sensor: dict = field(default_factory=dict)
    path: dict = field(default_factory=dict)
    name: str = "no table"


def test_settings_that_are_given():
    given = {"fov_deg": 0, "name": "", "band": None, "list": [], "table": {}, "pair": ()}
    section = settings_section("Scenario", Settings(given), [("range", "5 m")])
    assert section.parts == [Facts([("range", "5 m"), ("[sensor]", "fov_deg = 0, name = ")])]


def test_contributions_of_a_group_and_of_noise():
    """A derivative has its error from 0.1 % of it on."""
    members = [
        Contribution.of("a", 2.0, -3.14159265, value=20.5, unit="K", sensitivity_error=0.0032),
        Contribution.of("b", 0.12345, 3.0, value=0.5, sensitivity_error=0.0029, unit="1"),
    ]
    group = Contribution("a & b", 6.0, 0.64, members=tuple(members))
    noise = Contribution("noise", 4.5, 0.36)
    table = contributions(Estimate(1.0, 7.5, "W/sr", contributions=(group, noise)))
    assert table.columns[-2:] == ["contribution W/sr", "share"]
    assert table.rows == [
        ["a & b", "", "", "", "6", "64.00 %"],
        ["  a", "20.5 K", "2", "-3.1416 +- 0.003", "-6.283", ""],
        ["  b", "0.5", "0.123", "3", "+0.3704", ""],
        ["noise", "", "", "", "4.5", "36.00 %"],
    ]
    uniform = Contribution.of("c", 1.0, 2.0, share=1.0, distribution="uniform")
    assert contributions(Estimate(0.0, contributions=(uniform,))).rows[0][0] == "c (uniform)"


@dataclass(frozen=True, repr=False)
class Leak(Result):
    """A result whose facts are given."""

    words: str = "leak of a box: 5 W"
    parts: tuple = entry(default=())

    kind = "heat_leak"

    def summary(self):
        return self.words

    def columns(self):
        return {"time_s": np.array([1.0, 2.0]), "name": np.array(["a", "b"])}

    def facts(self):
        yield from self.parts or super().facts()


def test_a_result_in_one_line():
    assert summary_of(Leak()) == Facts([("leak of a box", "5 W")])
    assert summary_of(Leak("none")) == Facts([("heat leak", "none")])
    assert Leak().page_title() == "Leak of a box" and Leak("").page_title() == ""
    assert len(repr(Leak("x" * 300))) == 199 and repr(Leak("x" * 199)) == "x" * 199


def test_sections_of_facts():
    """Facts that follow each other are one part; remarks come once, and details once."""
    more, facts = Section("More", []), [("a", 1), ("b", 2), "a text", ("c", 3)]
    first, last = Leak(parts=(more, *facts)).sections()
    assert first == Section("Heat leak", [
        Facts([("a", 1), ("b", 2)]), "a text", Facts([("c", 3)]), Remarks([])
    ])  # fmt: skip
    assert last is more
    (first,) = Leak(parts=(("a", 1), Remarks(["take care"]))).sections()
    assert first.parts == [Facts([("a", 1)]), Remarks(["take care"])]
    assert [section.title for section in Leak().page()] == ["Heat leak", "How it was made"]
    told = Leak(parts=(("a", 1), Section("Details", [], is_detail=True)))
    assert [section.title for section in told.page()] == ["Heat leak", "Details"]


def test_a_result_without_a_picture(tmp_path):
    leak = Leak()
    assert leak.as_rows() == [{"time_s": 1, "name": "a"}, {"time_s": 2, "name": "b"}]
    assert leak.suffixes() == [".json", ".csv", ".nc", ".html"] and leak.picture() is None
    with pytest.raises(InputError, match=r"'heat_leak' has no picture; it can be saved as .json, "):
        leak.plot()
    assert "<table" in leak._repr_html_() and "<img" not in leak._repr_html_()


class Recording(Leak):
    """What its JSON states is all that is shown of it."""

    @staticmethod
    def facts_of(entries, digits=3):
        yield "area", f"{entries['area']:.{digits}g}"


def test_a_result_that_was_saved():
    read = Recording.of_entries({"scenario_name": "box", "area": 1.23456, "remarks": ["old"]})
    assert isinstance(read, Recorded) and read.as_dict()["area"] == 1.23456
    assert read.summary() == "heat_leak of box: as it was saved" and not read.has_picture
    (section,) = read.sections(digits=2)
    assert section.parts == [Facts([("area", "1.2")]), Remarks(["old"])]
    assert Recording.of_entries({}).summary() == "heat_leak of no name: as it was saved"
    with pytest.raises(InputError, match="option of the page of .*'heat_leak' 'digit'; known: dig"):
        read.sections(digit=2)


def test_options_that_are_passed_on_are_checked_where_they_arrive():
    check_options("a picture", lambda result, **options: None, {"any": 1})
    with pytest.raises(InputError, match="unknown option of a picture 'result'"):
        check_options("a picture", lambda result, width=1: None, {"result": 1})
