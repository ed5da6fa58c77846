"""Speed of the renderer as a table, with a substitute for the measurement."""

import json
from pathlib import Path

from benchmarks import throughput
from benchmarks.throughput import Row, ThroughputChart

RESULT = ThroughputChart(
    rows=[
        Row("box", "bounce_path", 1e6, 2e7, "path", 1.25, 0.5),
        Row("box", "path", 8e5, 1.6e7, "", None, 0.25),
    ],
    bounces=5,
    spp=64,
    resolution=128,
    repeats=3,
)


def test_table_and_files(monkeypatch, tmp_path, capsys):
    """A contestant that is compared with none has an empty cell, or null in JSON."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(throughput, "measured", lambda quick, progress: RESULT)
    throughput.main(["-o", "out"])
    heading, *lines = capsys.readouterr().out.splitlines()
    assert heading.split("  ")[:2] == ["scene", "name"] and "ratio" in heading
    assert lines[0].split()[-3:] == ["path", "1.25", "0.5"] and lines[1].split()[-1] == "0.25"
    assert len(Path("out/throughput.csv").read_text().splitlines()) >= 3
    throughput.main(["--json"])
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["ratio"] for row in rows] == [1.25, None]
