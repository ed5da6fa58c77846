"""The two baselines on a small data set that the test makes."""

import pytest

from docs.studies import baselines


@pytest.mark.slow
def test_the_inversion_beats_the_guess(tmp_path, monkeypatch):
    """Bare metal, of which the guess is wrong, and a lid, of which it is nearly right."""
    for name, value in {"VIEWS": 4, "WIDTH": 32, "HEIGHT": 24}.items():
        monkeypatch.setattr(baselines, name, value)
    coarse = {"camera.focal_length_mm": 4, "camera.width": 32, "camera.height": 24}
    few = {"render.spp": 16, "atmosphere.table": "vacuum"}
    monkeypatch.setattr(baselines, "CHANGES", coarse | few)
    monkeypatch.setattr(baselines, "AROUND", {"sky": "265", "ground": "288"})
    rows = {tuple(row[:2]): row[2:] for row in baselines.table(baselines.small_set(tmp_path))}
    assert set(rows) == {
        (method, group) for method in ("guess", "invert") for group in ("lid", "self")
    }
    rms = {key: float(row[1]) for key, row in rows.items()}
    inside = {key: float(row[3].rstrip(" %")) for key, row in rows.items()}
    # The guess sees metal of 300 K, emissivity 0.08, as the colder sky and ground that it reflects
    assert rms["guess", "self"] > 8 and inside["guess", "self"] == 0
    assert rms["guess", "lid"] < 5 and inside["guess", "lid"] > 90
    for group in ("lid", "self"):
        assert rms["invert", group] < 2 and inside["invert", group] > 90
