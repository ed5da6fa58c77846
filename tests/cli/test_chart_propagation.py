"""Tests of mi-lcair chart propagation, with a substitute for the measurement."""

import json

import pytest

from tests.benchmark.test_propagation_chart import result


@pytest.fixture
def measured(monkeypatch):
    calls = []
    from mi_lcair.benchmark import propagation_chart

    def measure(quick, progress):
        calls.append(quick)
        progress(1, 2)
        return result()

    monkeypatch.setattr(propagation_chart, "measure", measure)
    return calls


@pytest.mark.slow
def test_writes_its_files(run, folder, measured):
    found = run("chart", "propagation", "-o", "out", "--quick")
    assert found.exit_code == 0 and measured == [True]
    assert len(list((folder / "out").iterdir())) == 6
    assert "box    1%         lattice points" in found.stdout
    assert "none reaches it within 0.1 s" in found.stdout
    assert "more than 0.1 s of processor time on each thread" in found.stdout


@pytest.mark.slow
def test_json(run, measured):
    found = json.loads(run("chart", "propagation", "--json").stdout)
    assert found["limit_processor_seconds"] == 0.1
    assert len(found["points"]) == 10 and found["closures"][0]["closure"] == "none"


def test_folder_is_refused_before_the_work(refused, folder, measured):
    (folder / "file").touch()
    assert "not a folder" in refused("chart", "propagation", "-o", "file")
    assert measured == []
