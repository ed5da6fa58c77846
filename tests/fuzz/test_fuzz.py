"""Fuzz: a damaged file of any kind is accepted or refused by one line; no process dies or hangs."""

import pytest

from tests.fuzz.kinds import KINDS
from tests.fuzz.mutants import Worker, campaign, judge

MUTANTS = 25  # of each kind


@pytest.fixture(scope="module")
def worker():
    with Worker() as worker:
        yield worker


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_mutants(kind, tmp_path, worker):
    """Every mutant ends well, and enough of them are refused for the fuzzer to have damaged any."""
    verdicts = list(campaign(kind, tmp_path, MUTANTS, worker=worker))
    wrong = {content: verdict for content, verdict in verdicts if not verdict.is_right}
    assert not wrong
    assert sum(verdict.outcome == "refused" for _, verdict in verdicts) > MUTANTS / 10


@pytest.mark.parametrize(
    "name, old, new, message",
    [
        ("spectral", b"gamma = 2", b"gamma = {}", "gamma = {}; must be a number, a text or a list"),
        ("spectral", b"nk.csv", b"A" * 5000, "cannot be read"),
        ("solution", b'"state": "', b'"station": "', "incomplete: entry 'state' is missing"),
        ("result", b'"share": 0.377027', b'"share": null', "a result that is incomplete"),
        ("result", b'"theta_deg": [\n', b'"theta_deg": [1,', "a fit that is incomplete"),
        ("npy", b"}", b" ", "is no NumPy array"),
        ("radiometric", b"IHDR", b"IHDS", "its raw image cannot be read: not an image"),
    ],
)
def test_one_line(name, old, new, message, tmp_path):
    """What once ended in an exception's name is refused by a line that names the file."""
    kind = next(kind for kind in KINDS if kind.name == name)
    content = next(example for example in kind.examples if old in example)
    for file, beside in (kind.beside or {}).items():
        (tmp_path / file).write_bytes(beside)
    path = tmp_path / f"damaged{kind.suffix}"
    path.write_bytes(content.replace(old, new))
    verdict = judge(kind, path)
    assert verdict.outcome == "refused"
    assert message in verdict.message and (
        "damaged" in verdict.message or new in verdict.message.encode()
    )
