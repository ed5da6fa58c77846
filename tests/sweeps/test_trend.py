"""Tests of trends: rows against signatures, files, and what is traced again."""

import json

import numpy as np
import pandas
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.rendering.views import View, seen_from
from mi_lcair.signatures.trend_result import Trend, settings_file

AZIMUTHS = np.arange(0, 360, 45.0)


@pytest.fixture(scope="module")
def cylinder():
    return mi_lcair.load("cylinder_ir_range", finish="gloss_black", max_bounces=2)


def trend(scene, **changes):
    return mi_lcair.trend(
        scene, **{"azimuths_deg": AZIMUTHS, "resolution": 16, "spp": 4, **changes}
    )


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:in 8 of 16 views terrain")  # the floor, from below
def test_rows_are_signatures(cylinder):
    """Each row agrees with a signature of its view, by group and by bounce."""
    columns = trend(cylinder, elevations_deg=(-10, 20), tolerance=0.01, spp=None).table
    assert len(columns["azimuth_deg"]) == 16 and columns["reached"].all()
    for k in (3, 12):
        view = View(columns["azimuth_deg"][k], columns["elevation_deg"][k])
        alone = mi_lcair.signature(seen_from(cylinder, view, 64), spp=16, seed=7, by_spectrum=True)
        error = np.hypot(columns["standard_error_W_sr"][k], alone.target.standard_error)
        assert abs(columns["intensity_W_sr"][k] - alone.target.intensity) < 4 * error
        assert columns["projected_area_m2"][k] == pytest.approx(
            alone.effective_areas.projected_area, rel=0.03
        )
        for label, value in alone.target.by_group.items():
            assert columns[f"group.{label}_W_sr"][k] == pytest.approx(value, rel=0.05)
        assert columns["bounce.0_W_sr"][k] == pytest.approx(alone.target.by_bounce[0], rel=0.05)
    for kind in ("group", "bounce"):
        parts = sum(values for name, values in columns.items() if name.startswith(kind))
        assert parts == pytest.approx(columns["intensity_W_sr"], rel=1e-5)


def test_both_sides_are_alike(cylinder):
    """The model and its room are symmetric, and so is the trend."""
    columns = trend(cylinder, azimuths_deg=[60, 300, 120, 240], resolution=64).table
    left, right = columns["intensity_W_sr"][::2], columns["intensity_W_sr"][1::2]
    assert np.abs(left - right).max() < 5 * columns["standard_error_W_sr"].max()


def test_views_that_are_equal(cylinder):
    """A full turn more is the same view. It has a row of its own."""
    columns = trend(cylinder, azimuths_deg=[30, 390, 120], resolution=64).table
    intensity, error = columns["intensity_W_sr"], columns["standard_error_W_sr"]
    (alone,) = trend(cylinder, azimuths_deg=[30], resolution=64).table["intensity_W_sr"]
    assert np.abs(intensity[:2] - alone).max() < 5 * error.max()


class Stopped(Exception):
    pass


def test_what_was_interrupted_goes_on(cylinder, tmp_path, monkeypatch):
    """Batches that a folder holds are not traced again, and the rows are the same to the bit."""
    monkeypatch.setattr("mi_lcair.sweeps.subject.VIEWS_AT_ONCE", 3)
    # Angles without a finite decimal form are found again
    views = {"azimuths_deg": [0, 0.1 + 0.2, 100, 200 + 1 / 3], "elevations_deg": [0, -1 / 7]}
    whole, done = trend(cylinder, **views), []

    def stop(views, of):
        done.append((views, of))
        if len(done) == 2:
            raise Stopped

    with pytest.raises(Stopped):
        trend(cylinder, areas=tmp_path / "areas", progress=stop, **views)
    resumed = trend(cylinder, areas=tmp_path / "areas", progress=lambda *n: done.append(n), **views)
    assert [of for _, of in done] == [8] * 3 and done[2][0] == 8
    assert list(resumed.table) == list(whole.table)
    for name, values in whole.table.items():
        np.testing.assert_array_equal(resumed.table[name], values, err_msg=name)
    for changes in ({"seed": 1}, {"spp": 8}, {"resolution": 8}, {"max_bounces": 1}):
        calls = []
        trend(
            cylinder,
            areas=tmp_path / "areas",
            progress=lambda *n, calls=calls: calls.append(n),
            **(views | changes),
        )
        assert calls


def test_reflections_are_chosen_for_the_views():
    plates = mi_lcair.load("two_plates", resolution=8)
    views = {"azimuths_deg": [45, 90], "elevations_deg": [60], "resolution": 8, "spp": 4}
    automatic = mi_lcair.trend(plates, **views, max_bounces="auto")
    by_hand = mi_lcair.trend(plates, **views, max_bounces=1)
    np.testing.assert_allclose(automatic.table["intensity_W_sr"], by_hand.table["intensity_W_sr"])
    more = mi_lcair.trend(plates, **views, max_bounces=2)
    assert automatic.made["fingerprint"] != more.made["fingerprint"]


def test_pandas_reads_it_without_options_or_a_path_of_this_machine(cylinder, tmp_path):
    """Plain columns, and no path of a folder in either file; `read` gives the same back."""
    path = tmp_path / "trend.csv"
    result = trend(cylinder)
    result.save(path)
    frame = pandas.read_csv(path)
    assert list(frame) == list(result.columns())
    for name, values in result.columns().items():
        np.testing.assert_allclose(frame[name], values, rtol=1e-8)
    both = path.read_text() + settings_file(path).read_text()
    assert str(tmp_path) not in both and "/" not in both.replace("W/sr", "")
    made = json.loads(settings_file(path).read_text())["made"]
    assert (made["scene"], made["samples"]) == ("cylinder_ir_range", "spp 4 over each view")
    again = Trend.read(path)
    assert (again.scene_name, again.band) == (result.scene_name, result.band)


@pytest.mark.parametrize("made", ["", "[1]", '{"made": 1}', "[" * 100_000, "\x89PNG\x00"])
def test_a_file_beside_it_of_another_kind(tmp_path, made):
    path = tmp_path / "trend.csv"
    path.write_text("azimuth_deg,elevation_deg,intensity_W_sr\n0,0,1\n")
    settings_file(path).write_bytes(made.encode("latin-1"))
    with pytest.raises(InputError, match="has no settings|not a text file"):
        Trend.read(path)


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"azimuths_deg": []}, "needs views"),
        ({"azimuths_deg": [10, 10]}, "twice"),
        ({"resolution": 10**5}, "resolution = 100000 must lie in"),
        ({"max_spp": 4}, "do not go with it"),
        ({"elevations_deg": [100]}, "-90..90"),
        ({"tolerance": 0.1}, "do not go with it"),
    ],
)
def test_bad_input(cylinder, changes, message):
    with pytest.raises(InputError, match=message):
        trend(cylinder, **changes)


def test_plot(cylinder, figures, tmp_path):
    result = trend(cylinder, elevations_deg=(0, 30))
    result.plot(tmp_path / "trend.png")
    by_elevation, by_group, by_bounce = figures[0].axes
    azimuth, values = by_elevation.lines[1].get_data()
    # The curve of all azimuths is closed.
    assert np.degrees(azimuth) == pytest.approx(np.arange(0, 361, 45)) and values[0] == values[-1]
    assert values[:-1] == pytest.approx(result.at_elevation(30).table["intensity_W_sr"])
    assert [line.get_label() for line in by_group.lines] == ["self", "walls"] and len(
        by_bounce.lines
    ) >= 2
