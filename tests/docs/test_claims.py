"""Numbers in the prose of how-to pages are those of the validation pages that they cite."""

import re

from tests.docs.fences import ROOT


def text(page: str) -> str:
    return (ROOT / "docs" / page).read_text(encoding="utf-8")


def rounded(count: int) -> str:
    """A number of paths with one significant digit, or two from 100,000 on, as the prose has it."""
    digits = len(str(count)) - (2 if count >= 100_000 else 1)
    number = round(count, -digits)
    return "a million" if number == 1_000_000 else f"{number:,}"


def test_paths_that_a_tolerance_takes():
    """The page on plans states the fewest and the most of the bundled scenes."""
    section = text("validation/paths.md").partition("## Number of paths to a tolerance")[2]
    cells = [line.split("|")[2:4] for line in section.splitlines() if line.count("|") == 4][2:]
    percent, tenth = (
        [int(number.replace(",", "")) for cell in column for number in re.findall(r"[\d,]+", cell)]
        for column in zip(*cells)
    )
    assert len(cells) > 3
    sentence = " ".join(text("howto/reflections.md").split())
    assert f"1 % after {rounded(min(percent))} to {rounded(max(percent))} paths" in sentence
    assert f"0.1 % after {rounded(min(tenth))} to {rounded(max(tenth))}" in sentence
