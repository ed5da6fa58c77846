"""Tests of the frames of a flight: a plate that passes, what is rendered, histories, files."""

import numpy as np
import pytest
from PIL import Image

import mi_lcair
from mi_lcair.detection.camera.electronics import electrons
from mi_lcair.detection.camera.sequence import FilmedFlight
from mi_lcair.detection.scenario import Scenario
from mi_lcair.errors import InputError
from tests.detection.camera.plate_scenario import CAMERA, plate

COLUMNS = "time_s,x_m,y_m,z_m,yaw_deg,pitch_deg,roll_deg"
RECEDING = "0,-1000,0,90,0,0,0\n4,-1600,0,90,0,0,0\n"


def flown(folder, path=RECEDING, columns=COLUMNS, **entries) -> Scenario:
    """A plate of 6 m x 4 m at 300 K before 280 K, which faces an observer at (0, 0, 90)."""
    plate(folder, 6, 4)
    text = (folder / "disc.toml").read_text()
    start, end = text.index("[observer]"), text.index("[atmosphere]")
    (folder / "path.csv").write_text(f"{columns}\n{path}")
    table = '[flight]\npath = "path.csv"\nrate_hz = 1\nobserver_m = [0, 0, 90]\n'
    (folder / "flown.toml").write_text(text[:start] + table + text[end:])
    changes = {
        "target.parameters.temperature": 300,
        "background.temperature": 280,
        **{f"camera.{name}": value for name, value in CAMERA.items()},
        "render.spp": 16,
        "render.resolution": 16,
    }
    return Scenario.read(folder / "flown.toml", **changes | entries)


def totals(filmed, numbers):
    """Electrons of the target less those of the background, summed over the frame."""
    signals = [filmed.signal(number) for number in numbers]
    empty = electrons(filmed.camera.band, 280.0)
    return np.array([np.sum(signal - empty) for signal in signals]), empty


def test_plate_that_recedes_fills_as_many_pixels_as_it_is_large(tmp_path):
    filmed = FilmedFlight(flown(tmp_path), 0)
    total, empty = totals(filmed, range(5))
    assert len(set(filmed.rendered_at)) == 5
    excess = electrons(filmed.camera.band, 300.0) - empty
    pixels = 24 / (filmed.moments.range_m * filmed.scenario.camera.pixel_angle) ** 2
    assert total == pytest.approx(excess * pixels, rel=0.02)


def test_frames_are_rendered_anew_when_the_target_has_moved(tmp_path):
    """From 1000 m to 1006 m a corner moves by .14 pixels: renders follow [flight] pixels."""
    path = "0,-1000,0,90,0,0,0\n6,-1006,0,90,0,0,0\n"
    for pixels, rendered in ((0.5, 1), (0.05, 3)):
        filmed = FilmedFlight(flown(tmp_path, path, **{"flight.pixels": pixels}), 0)
        frames = list(filmed.counts())
        assert len(set(filmed.rendered_at)) == rendered
        assert len({frame.tobytes() for frame in frames}) == 7  # noise is new in each
    alone = FilmedFlight(filmed.scenario, 0).pages([5])  # as another process would
    np.testing.assert_array_equal(alone[0], frames[5])


def test_histories_of_temperatures_are_seen(tmp_path):
    path = "0,-1000,0,90,0,0,0,300\n1,-1000,0,90,0,0,0,280\n"
    filmed = FilmedFlight(flown(tmp_path, path, f"{COLUMNS},temperature.self"), 0)
    (warm, same), _ = totals(filmed, (0, 1))
    assert len(set(filmed.rendered_at)) == 2 and abs(same) < 1e-6 * warm


def test_files_have_a_page_for_each_moment(tmp_path):
    scenario = flown(tmp_path)
    paths = {"frames": tmp_path / "seen.tif", "video": tmp_path / "seen.gif"}
    made = mi_lcair.flight(scenario, **paths, seed=3)
    assert made.rendered == 5
    expected = list(FilmedFlight(scenario, 3).counts())
    with Image.open(paths["frames"]) as pages:
        assert pages.n_frames == 5 and pages.mode == "I;16"
        for number in (0, 4):
            pages.seek(number)
            np.testing.assert_array_equal(np.array(pages), expected[number])
    with Image.open(paths["video"]) as video:
        assert video.n_frames == 5 and video.size == (64, 48) and video.info["duration"] == 1000
        first = np.array(video.convert("L"), float)
    assert first[20:28, 28:36].mean() > first[:8].mean() + 100


@pytest.mark.parametrize(
    "entries, options, message",
    [
        ({}, {"frames": "seen.png"}, "does not end in .tif"),
        ({}, {"video": "seen.mp4"}, "does not end in .gif"),
        ({"flight.rate_hz": 2e5}, {"frames": "seen.tif"}, "GiB, and a TIFF at most"),
    ],
)
def test_unusable_files_are_refused(tmp_path, monkeypatch, entries, options, message):
    monkeypatch.chdir(tmp_path)
    scenario = flown(tmp_path, **entries)
    before = set(tmp_path.iterdir())
    with pytest.raises(InputError, match=message):
        mi_lcair.flight(scenario, **options)
    assert set(tmp_path.iterdir()) == before
