"""What the commands claim about adverse scenes holds."""

import tempfile
from pathlib import Path

import numpy as np
import pytest

from docs.studies.claims.__main__ import add_to, main, run
from docs.studies.claims.claims import Claim
from docs.studies.claims.coverage import defects, interval, rows
from docs.studies.claims.pairs import COMBINED, Pairs
from docs.studies.claims.scenes import case

SEED, SCENES = 1, 2


@pytest.mark.slow
def test_claims_hold():
    found = run(SEED, range(SCENES))
    assert len(found) > 10 * SCENES
    assert not defects(found, by_kind=False)


def claim(held: bool, scene: int, name: str = "interval, target") -> Claim:
    return Claim(name, "lamp", "off", 1, scene, 0.5 if held else 1.2, 0.01)


def test_interval_of_independent_claims_is_that_of_clopper_and_pearson():
    held = np.arange(100) < 90
    lower, upper = interval(held, np.arange(100))
    assert lower == pytest.approx(0.8238, abs=2e-3)  # tables: .8238 to .9510
    assert upper == pytest.approx(0.9510, abs=2e-3)


def test_claims_that_fail_together_count_as_one():
    """Ten scenes of ten claims each, of which one scene fails: like 9 of 10."""
    held, scenes = np.repeat(np.arange(10) > 0, 10), np.repeat(np.arange(10), 10)
    lower, upper = interval(held, scenes)
    assert lower == pytest.approx(0.555, abs=0.05)  # tables: .555 to .9975
    assert upper == pytest.approx(0.9975, abs=0.005)


def test_a_defect_is_coverage_below_90_beyond_chance():
    assert not defects([claim(k % 10 > 0, k) for k in range(100)])  # 90 of 100
    assert not defects([claim(k > 0, k) for k in range(4)])  # 3 of 4
    (text,) = defects([claim(k % 3 > 0, k) for k in range(100)]).values()
    assert text == "34 of 100 false, worst 1.2 times (lamp, --seed 1 --first 0)"


def test_an_interval_that_is_far_off_is_a_defect_however_rare():
    held = [claim(True, k) for k in range(200)]
    near, far = (Claim("interval, target", "lamp", "off", 1, 7, excess, 0.3) for excess in (29, 31))
    assert not defects([*held, near])
    assert list(defects([*held, far])) == [("interval, target", "lamp")]


def test_a_tolerance_that_is_far_off_is_a_defect_however_rare():
    held = [claim(True, k, "tolerance") for k in range(200)]
    far = Claim("tolerance", "lamp", "off", 1, 7, 3.1, 0.3)
    assert not defects(held)
    assert list(defects([*held, far])) == [("tolerance", "lamp")]
    (row,) = rows([*held, far])
    assert row.beyond == pytest.approx([1 / 201] * 3)
    assert row.worst is far


@pytest.mark.slow
def test_command_writes_the_page(tmp_path, capsys):
    arguments = ["--scenes", "1", "--first", "3", "--seed", "7"]
    main([*arguments, "--page", str(tmp_path / "claims.md"), "--csv", str(tmp_path / "claims.csv")])
    assert "interval, target" in capsys.readouterr().out
    page = (tmp_path / "claims.md").read_text()
    assert "| tolerance | 1 | 1 | 100.0% |" in page
    again = tmp_path / "again.md"
    main([*arguments, "--page", str(again), "--read", str(tmp_path / "claims.csv")])
    assert again.read_text() == page


def test_runs_with_repeats_have_a_section_of_their_own(tmp_path):
    """Ten claims of each of 20 scenes, of which two fail by 1.2 times."""
    claims = [
        claim(scene > 1 or k > 0, scene, "tolerance") for scene in range(20) for k in range(10)
    ]
    for name, some in (("one.csv", claims[::10]), ("many.csv", claims)):
        add_to(str(tmp_path / name), some)
    page = tmp_path / "claims.md"
    files = {"--read": "one.csv", "--repeated": "many.csv"}
    options = [part for key, name in files.items() for part in (key, str(tmp_path / name))]
    main([*options, "--page", str(page)])
    once, many = page.read_text().split("## Ten runs for each scene")
    assert "| tolerance | 20 | 20 | 90.0% |" in once
    assert "| tolerance | 200 | 20 | 99.0% | 96.4% to 99.9% | 1.00% | 0.00% | 0.00% |" in many
    assert "This section has 20 scenes: 20 scenes of seed 1." in many


def test_repeats_of_a_command_have_other_random_numbers():
    found = run(SEED, [2], only=["to_tolerance"], repeats=2, most_paths=2**12)
    first, second = (entry.error for entry in found if entry.name == "interval, stopped")
    assert first != second


@pytest.mark.slow
def test_pairs_that_must_agree():
    """A box that is mirrored, halved, aimed at or of two sheets; a pair that differs is told."""
    with tempfile.TemporaryDirectory() as folder:
        number = next(k for k in range(100) if case(SEED, k).kind == "box")
        pairs = Pairs(SEED, number, Path(folder))
        value, half = pairs.mean(pairs.case)
        one_sheet, two_sheets = pairs.two_sheets()
        assert abs(one_sheet[0] - two_sheets[0]) < COMBINED * np.hypot(one_sheet[1], two_sheets[1])
        for other, half_of_other in (pairs.mirrored(), pairs.divided(), pairs.aimed()):
            assert other != value
            assert abs(other - value) < COMBINED * np.hypot(half, half_of_other)
    far = Claim("pair, turned", "box", "on", 1, 7, 1.1, 0.01)
    assert list(defects([far])) == [("pair, turned", "box")]
