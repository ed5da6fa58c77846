"""Tests of trends: rows against signatures, resuming a file, and rendering on a Dask cluster."""

import json
from pathlib import Path

import mitsuba as mi
import numpy as np
import pandas
import pytest

import mi_lcair
from mi_lcair import scenes
from mi_lcair.errors import InputError
from mi_lcair.rendering.scene import checked
from mi_lcair.rendering.views import View, seen_from
from mi_lcair.signatures.trend import loaded
from mi_lcair.signatures.trend_file import beside
from tests.plugins.conftest import plate  # noqa: F401, a fixture
from tests.plugins.small_scenes import camera

AZIMUTHS = np.arange(0, 360, 45.0)


@pytest.fixture(scope="module")
def cylinder():
    return mi_lcair.load("cylinder_ir_range", finish="gloss_black", max_bounces=2)


def trend(scene, path=None, **changes):
    return mi_lcair.trend(
        scene,
        **{
            "azimuths_deg": AZIMUTHS,
            "resolution": 16,
            "spp": 4,
            "batch": 3,
            "path": path,
            **changes,
        },
    )


@pytest.fixture(scope="module")
def whole(cylinder, tmp_path_factory):
    """Text of the file of a trend that was not interrupted."""
    path = tmp_path_factory.mktemp("trend") / "whole.csv"
    trend(cylinder, path)
    return path.read_text() + MARK + beside(path).read_text()


MARK = "------\n"  # between the texts of the CSV and of the file beside it


def write_both(path, text):
    """Write the CSV and the file beside it from their texts."""
    table, _, made = text.partition(MARK)
    path.write_text(table)
    if made:
        beside(path).write_text(made)


def both(path) -> str:
    """The texts of the CSV and of the file beside it."""
    return path.read_text() + MARK + beside(path).read_text()


@pytest.mark.slow
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


class Stopped(Exception):
    pass


@pytest.mark.slow
@pytest.mark.parametrize("batches", [1, 2])
def test_what_was_interrupted_is_resumed(cylinder, whole, tmp_path, batches):
    path, done = tmp_path / "trend.csv", []

    def stop(views, of):
        done.append(views)
        if len(done) == batches:
            raise Stopped

    with pytest.raises(Stopped):
        trend(cylinder, path, progress=stop)
    assert json.loads(beside(path).read_text())["done"] == done[-1]
    assert len(path.read_text().splitlines()) == done[-1] + 1

    calls = []
    trend(cylinder, path, resume=True, progress=lambda *counts: calls.append(counts))
    assert both(path) == whole and len(calls) == 3 - batches
    trend(
        cylinder, path, resume=True, progress=lambda *counts: pytest.fail("nothing is left to do")
    )


def test_a_view_that_is_missing_is_rendered_with_its_batch(cylinder, whole, tmp_path):
    """A missing view is rendered with its whole batch, and has the same numbers as before."""
    path = tmp_path / "trend.csv"
    write_both(path, "\n".join(line for line in whole.splitlines() if not line.startswith("90,")))
    with pytest.warns(UserWarning, match="1 of 3 batches do not match"):
        trend(cylinder, path, resume=True)
    assert both(path) == whole


def test_angles_that_have_no_end_are_resumed(cylinder, tmp_path):
    """Angles without a finite decimal form, such as 0.1 + 0.2 and 200 + 1 / 3, can be resumed."""
    path = tmp_path / "trend.csv"
    angles = {"azimuths_deg": [0.1 + 0.2, 200 + 1 / 3], "elevations_deg": [-1 / 7]}
    trend(cylinder, path, **angles)
    trend(
        cylinder,
        path,
        resume=True,
        progress=lambda *counts: pytest.fail("rendered again"),
        **angles,
    )


@pytest.mark.slow
def test_a_scene_that_was_edited_is_not_resumed(plate, tmp_path):
    """A scene whose file has another temperature is refused on resuming and by a worker."""

    def scene(temperature):
        shape = plate(
            "slab",
            [[-0.2, -0.1, 0.3], [0.2, -0.1, 0.3], [0.2, 0.1, 0.3], [-0.2, 0.1, 0.3]],
            {"type": "diffuse"},
            temperature,
        )
        return checked(
            mi.load_dict(
                {
                    "type": "scene",
                    "integrator": {"type": "bounce_path"},
                    "sensor": camera(),
                    "slab": shape,
                }
            ),
            Path("s.xml"),
            {},
        )

    path = tmp_path / "trend.csv"
    trend(scene(300.0), path)
    trend(scene(300.0), path, resume=True)
    with pytest.raises(InputError, match="made with fingerprint"):
        trend(scene(301.0), path, resume=True)
    source = tmp_path / "scene.xml"
    source.write_text(
        scenes.path("two_plates").read_text().replace("meshes/", f"{scenes.FOLDER}/meshes/")
    )
    before = mi_lcair.load(source).fingerprint
    assert loaded(str(source), (), before).fingerprint == before
    source.write_text(source.read_text().replace("800", "810"))
    after = mi_lcair.load(source).fingerprint
    assert loaded(str(source), (), after).fingerprint == after != before
    with pytest.raises(InputError, match="is another one on the Dask worker"):
        loaded(str(source), (), "0123456789abcdef")


def test_reflections_are_chosen_for_the_views_and_known_to_workers(tmp_path):
    """The file says the fingerprint, which a worker finds again with the same settings alone."""
    path, plates = tmp_path / "trend.csv", mi_lcair.load("two_plates", resolution=8)
    views = {"azimuths_deg": [45, 90], "elevations_deg": [60], "resolution": 8, "spp": 4}
    automatic = mi_lcair.trend(plates, **views, max_bounces="auto", path=path)
    by_hand = mi_lcair.trend(plates, **views, max_bounces=1)
    np.testing.assert_allclose(
        automatic.columns()["intensity_W_sr"], by_hand.columns()["intensity_W_sr"]
    )
    made = json.loads(beside(path).read_text())["made"]["fingerprint"]
    parameters = tuple(plates.parameters.items())
    settings = ("max_bounces", 1), ("truncation", 0.0)
    assert loaded("two_plates", parameters, made, settings).fingerprint == made


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"seed": 1}, "made with seed = 0"),
        ({"spp": 8}, "made with samples = spp 4"),
        ({"resolution": 32}, "made with resolution = 16"),
        ({"batch": 4}, "made with batch = 3"),
        ({"azimuths_deg": [0, 45]}, "made with views = 8"),
    ],
)
def test_another_trend_is_not_resumed(cylinder, whole, tmp_path, changes, message):
    path = tmp_path / "trend.csv"
    write_both(path, whole)
    with pytest.raises(InputError, match=message):
        trend(cylinder, path, resume=True, **changes)
    assert both(path) == whole


def nth_line(text: str, start: str, change) -> str:
    """The text, with `change` applied to the first line that begins with `start`."""
    lines = text.splitlines(keepends=True)
    place = next(k for k, line in enumerate(lines) if line.startswith(start))
    return "".join([*lines[:place], change(lines[place]), *lines[place + 1 :]])


def cell(k: int, content: str):
    """Function that replaces the content of cell k of a line."""
    return lambda line: (
        ",".join(
            [*line.rstrip("\n").split(",")[:k], content, *line.rstrip("\n").split(",")[k + 1 :]]
        )
        + ("\n")
    )


def swapped(line: str) -> str:
    """The line with intensity and standard error exchanged."""
    cells = line.split(",")
    cells[2], cells[3] = cells[3], cells[2]
    return ",".join(cells)


@pytest.mark.slow
@pytest.mark.parametrize(
    "spoil, batches",
    [
        (lambda text: nth_line(text, "45,", cell(2, "1234.5")), 1),
        (lambda text: nth_line(text, "45,", cell(2, "nan")), 1),
        (lambda text: nth_line(text, "45,", cell(2, "-5")), 1),
        (lambda text: nth_line(text, "45,", cell(2, "x")), 1),
        (lambda text: nth_line(text, "45,", cell(2, "\u0663")), 1),
        (lambda text: nth_line(text, "45,", cell(0, "46")), 1),
        (lambda text: nth_line(text, "45,", lambda line: line + line), 1),
        (lambda text: nth_line(text, "45,", lambda line: ""), 1),
        (lambda text: nth_line(text, "45,", lambda line: line[: len(line) // 2]), 1),
        (lambda text: nth_line(text, "azimuth_deg", swapped), 3),
        (
            lambda text: "".join(
                swapped(x) if x[0] in "012349" else x for x in text.splitlines(True)
            ),
            3,
        ),
        (lambda text: text.replace(",reached,", ",raeched,"), 3),
        (lambda text: text.replace("azimuth_deg,", "", 1), 3),
        (lambda text: text.replace('"1": "', '"1": "0'), 1),
        (lambda text: nth_line(text, '    "1": ', lambda line: ""), 1),
    ],
)
def test_rows_that_were_edited_are_rendered_again(cylinder, whole, tmp_path, spoil, batches):
    """Changed rows are rendered again, with a warning, and the file is the original one."""
    path = tmp_path / "trend.csv"
    write_both(path, spoil(whole))
    assert both(path) != whole
    with pytest.warns(UserWarning, match=f"{batches} of 3 batches do not match their checksum"):
        result = trend(cylinder, path, resume=True)
    assert both(path) == whole
    assert (result.table["intensity_W_sr"] > 0).all()


def test_line_ends_of_another_system_are_no_edit(cylinder, whole, tmp_path):
    path = tmp_path / "trend.csv"
    write_both(path, whole)
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    trend(cylinder, path, resume=True, progress=lambda *counts: pytest.fail("rendered again"))


@pytest.mark.parametrize(
    "content, made, message",
    [
        (b"a,b\n1,2\n", None, "cannot be resumed without 'trend.csv.json' beside it"),
        (b"a,b\n1,2\n", b"", "does not state how"),
        (b"a,b\n1,2\n", b"[1]", "does not state how"),
        (b"a,b\n1,2\n", b'{"made": [], "batches": {}}', "does not state how"),
        (b"a,b\n1,2\n", b'{"made": {}, "batches": {}}', "made with scene = nothing"),
        (b"a,b\n1,2\n", b"[" * 100_000, "does not state how"),
        (b"a,b\n1,2\n", b"\x89PNG\r\n\x00", "not a text file"),
        (b"\x89PNG\r\n\x00", b'{"made": {}, "batches": {}}', "not a text file"),
        (
            b"a,b\n",
            json.dumps({"made": {"scene": "\u202e" + "x" * 100_000}, "batches": {}}).encode(),
            r"made with scene = \\u202exx",
        ),
    ],
)
def test_a_file_of_another_kind_is_not_resumed(cylinder, tmp_path, content, made, message):
    path = tmp_path / "trend.csv"
    path.write_bytes(content)
    if made is not None:
        beside(path).write_bytes(made)
    with pytest.raises(InputError, match=message):
        trend(cylinder, path, resume=True)
    assert path.read_bytes() == content


def test_pandas_reads_it_without_options_or_a_path_of_this_machine(cylinder, whole, tmp_path):
    """Plain columns, and no path of a folder in either file."""
    path = tmp_path / "trend.csv"
    result = trend(cylinder, path)
    frame = pandas.read_csv(path)
    assert list(frame) == list(result.columns())
    for name, values in result.columns().items():
        np.testing.assert_allclose(frame[name], values, rtol=1e-8)
    assert str(tmp_path) not in both(path) and "/" not in both(path).replace("W/sr", "")
    assert json.loads(beside(path).read_text())["made"]["scene"] == "cylinder_ir_range"


def test_a_file_that_exists_is_not_overwritten_without_a_word(cylinder, tmp_path):
    path = tmp_path / "trend.csv"
    path.write_text("precious")
    with pytest.raises(InputError, match="exists; give --resume"):
        trend(cylinder, path)
    assert path.read_text() == "precious" and len(list(tmp_path.iterdir())) == 1
    trend(cylinder, path, overwrite=True)
    assert path.read_text().startswith("azimuth_deg,")


def test_an_empty_file_is_resumed_from_nothing(cylinder, whole, tmp_path):
    """What an interrupted copy may leave: the CSV is empty, and the other file states batches."""
    path = tmp_path / "trend.csv"
    write_both(path, MARK + whole.partition(MARK)[2])
    with pytest.warns(UserWarning, match="3 of 3 batches do not match"):
        trend(cylinder, path, resume=True)
    assert both(path) == whole


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes, message",
    [
        ({"azimuths_deg": []}, "needs views"),
        ({"azimuths_deg": [10, 10]}, "twice"),
        ({"batch": 0}, "batch = 0 must lie in 1.."),
        ({"batch": 10**6}, "batch = 1000000 must lie in"),
        ({"resolution": 10**5}, "resolution = 100000 must lie in"),
        ({"max_spp": 4}, "do not go with it"),
        ({"elevations_deg": [100]}, "-90..90"),
        ({"tolerance": 0.1}, "do not go with it"),
        ({"resume": True}, "needs a file"),
    ],
)
def test_bad_input(cylinder, changes, message):
    with pytest.raises(InputError, match=message):
        trend(cylinder, **changes)


@pytest.mark.slow
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
