"""Fuzz: a damaged file of any kind is accepted or refused by one line; no process dies or hangs."""

import pytest

from tests.fuzz.kinds import KINDS
from tests.fuzz.mutants import Worker, campaign

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
