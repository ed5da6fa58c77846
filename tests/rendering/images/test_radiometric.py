"""Radiometric files: byte orders, what is missing or damaged, and files of other packages."""

import struct
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.rendering.images.files import read_values
from mi_lcair.rendering.images.radiometric import read
from tests.rendering.images import flir_files
from tests.rendering.images.flir_files import (
    air_transmittance,
    block,
    camera_record,
    fff,
    jpeg,
    raw_record,
    signal,
)

ROOT = Path(__file__).parents[3]
KELVIN = np.linspace(270, 420, 12 * 9).reshape(9, 12)  # of blackbodies
COUNTS = np.round(np.vectorize(signal)(KELVIN)).astype(np.uint16)


def written(path, content):
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("header", "<>")
@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("kind", ["raw", "png", "swapped"])
def test_byte_orders(tmp_path, header, order, kind):
    """An image whose shape and temperatures are known, in all orders of bytes."""
    content = fff(COUNTS, kind, header, order, humidity=40.0, window=0.9)
    for name in ("a.fff", "a.JPG"):
        content = content if name == "a.fff" else jpeg(content, 100, shuffled=True)
        image = read(written(tmp_path / name, content))
        np.testing.assert_allclose(image.kelvin, KELVIN, atol=0.02)
        assert (image.camera, image.band) == ("TEST 1", "7.5-14")
        assert image.conditions == {
            "emissivity": 0.95, "distance": 2, "reflected": 293.15, "air_temperature": 293.15,
            "humidity": 0.4, "window": 0.9, "window_temperature": 293.15,
        }  # fmt: skip


def test_the_curve_and_the_air_of_a_camera(tmp_path):
    """All its numbers differ; the formulas are those of the generator, written out."""
    curve = {"R1": 14000.0, "B": 1400.0, "F": 1.5, "O": -4000, "R2": 0.011}
    air = {"alpha1": 0.008, "alpha2": 0.015, "beta1": -0.003, "beta2": -0.007, "X": 1.7}
    camera = read(written(tmp_path / "a.fff", fff(COUNTS, **curve, **air))).calibration
    for kelvin in (250.0, 300.0, 500.0):
        of_none = signal(kelvin, curve) + curve["O"]
        assert camera.radiance(kelvin) == pytest.approx(of_none, rel=1e-5)
        assert camera.kelvin(of_none) == pytest.approx(kelvin, rel=1e-6)
    for metres, humidity, kelvin in ((2.0, 0.3, 270.0), (150.0, 0.9, 305.0)):
        expected = air_transmittance(metres, humidity, kelvin, air)
        given = camera.transmittance(metres, humidity, kelvin)
        assert given == pytest.approx(expected, rel=1e-6) and expected < 0.998


def test_other_segments_of_a_jpeg(tmp_path):
    """An APP1 segment of EXIF data, and bytes that fill, before those of FLIR."""
    content = jpeg(fff(COUNTS), 1000)
    exif = b"\xff\xe1\x00\x0bExif\0\0abc" + b"\xff\xff"
    path = written(tmp_path / "a.jpg", content[:2] + exif + content[2:])
    np.testing.assert_allclose(read(path).kelvin, KELVIN, atol=0.02)


def test_conditions_that_do_not_count(tmp_path):
    """No window has a transmittance of 0 or 1, and no air a length of 0."""
    path = written(tmp_path / "a.fff", fff(COUNTS, distance=0.0, window=0.0, B=2950.0))
    assert read(path).conditions == {"emissivity": 0.95, "reflected": 293.15}
    assert read(path).band == "3-5"


def test_pixels_without_signal_have_no_temperature(tmp_path):
    counts = COUNTS.copy()
    counts[0, 0] = 0  # below the offset of the curve
    kelvin = read(written(tmp_path / "a.fff", fff(counts))).kelvin
    assert np.isnan(kelvin[0, 0]) and np.isfinite(kelvin).sum() == kelvin.size - 1


def test_pixels_outside_the_range_of_the_camera(tmp_path):
    path = written(tmp_path / "a.fff", fff(COUNTS, lowest=300.0, highest=400.0))
    outside = np.sum((KELVIN < 300) | (KELVIN > 400))
    assert read(path).remarks == mi_lcair.temperature(path).remarks
    text = f"{outside} of 108 pixels are outside the camera's range of 300 to 400 K"
    assert read(path).remarks[0].startswith(text)
    for limits in ({}, {"lowest": 0.0, "highest": 0.0}):
        assert not read(written(path, fff(COUNTS, **limits))).remarks


def test_an_image_of_an_inverse_problem(tmp_path):
    path = str(written(tmp_path / "a.jpg", jpeg(fff(COUNTS, "swapped"))))
    for quantity in (None, "apparent_temperature"):
        kelvin, of = read_values(path, None, quantity, band("LWIR"))
        assert of == "apparent_temperature"
        np.testing.assert_allclose(kelvin, KELVIN, atol=0.02)
    with pytest.raises(InputError, match="contains apparent temperatures, not radiance"):
        read_values(path, None, "radiance", band("LWIR"))


EXAMPLE = ROOT / "scenes" / "examples" / "photo.jpg"


def test_the_example_is_that_of_the_generator():
    assert flir_files.example() == EXAMPLE.read_bytes()


RAW, CAMERA = (1, raw_record(COUNTS)), (0x20, camera_record(flir_files.CURVE | flir_files.STATED))
PLAIN = jpeg(b"")
WHOLE = jpeg(fff(COUNTS), 1000)
LOSSY = struct.pack("<3H26x", 2, 12, 9) + b"\xff\xd8\xff\xf7"


@pytest.mark.parametrize(
    "content, words",
    [
        (PLAIN, "a picture without radiometric data; use the camera's own file"),
        (b"", "no radiometric data of FLIR"),
        (b"\xff\xd8", "a picture without radiometric data"),
        (b"FPF \0".ljust(900, b"\0"), "contains no radiometric data of FLIR .block FFF."),
        (b"FFF\0", "are cut off"),
        (fff(COUNTS)[:-100], "are cut off"),
        (fff(COUNTS)[:150], "are cut off"),
        (WHOLE[:1500], "1 of 3 segments of its radiometric data are missing"),
        (jpeg(fff(COUNTS)[:2000], 1000), "are cut off"),
        (block([CAMERA]), "have no raw image"),
        (block([RAW]), "have no record of the camera"),
        (block([RAW, (0x20, CAMERA[1][:400])]), "are cut off"),
        (block([(1, RAW[1][:60]), CAMERA]), "are cut off"),
        (block([(1, raw_record(COUNTS, "png")[:90]), CAMERA]), "raw image cannot be read"),
        (block([(1, LOSSY), CAMERA]), "raw image is JPEG-LS, which is not read"),
        (fff(COUNTS, R1=0.0), "r1 = 0; must be positive"),
        (fff(COUNTS, R2=0.0), "r2 = 0; must be positive"),
        (fff(COUNTS, F=0.0), "its calibration: f = 0; must be positive"),
        (fff(COUNTS, B=0.0), "b = 0 K; must be positive"),
        (fff(COUNTS, R1=float("nan")), "r1 = nan; must be positive"),
        (fff(COUNTS, X=1e30), "x = 1e.30; must lie in -100..100"),
    ],
)
def test_bad_files_are_one_line(tmp_path, content, words):
    path = written(tmp_path / ("a.jpg" if content.startswith(b"\xff\xd8") else "a.fff"), content)
    with pytest.raises(InputError, match=words) as error:
        read(path)
    assert str(error.value).count("a.") >= 1 and "\n" not in str(error.value)


def test_files_of_other_packages(tmp_path, monkeypatch):
    """The temperatures of DJI's software for an emissivity of 1; the first frame of Telops."""
    asked = []

    def measure(path, settings=None, unit="C"):
        asked.append(settings)
        kelvin = np.array([[300.0, 0.0]], np.float32)
        return SimpleNamespace(temperature=kelvin, params={"emissivity": 0.9, "reflection": 20.0})

    fake = SimpleNamespace(measure=measure, Settings=lambda **given: given)
    monkeypatch.setitem(sys.modules, "dji_thermal_cli", fake)
    image = read(written(tmp_path / "a.jpg", PLAIN + b"DJI"))
    assert asked[-1] == {"emissivity": 1.0}
    assert image.conditions == {"emissivity": 0.9, "reflected": 293.15}
    assert image.kelvin[0, 0] == 300 and np.isnan(image.kelvin[0, 1])

    class Reader(SimpleNamespace):
        calibration_mode, data_exp, data_offset = 2, -4, 273.0

        def __init__(self, path):
            super().__init__()

        def __enter__(self):
            return self

        def __exit__(self, *error):
            return False

        def read_frames(self, start, stop):
            return np.array([[[160, 320]]], np.uint16)

    monkeypatch.setitem(sys.modules, "fasthcc", SimpleNamespace(HCCReader=Reader))
    path = written(tmp_path / "a.hcc", b"HCC")
    assert read(path).kelvin.tolist() == [[283.0, 293.0]]
    Reader.calibration_mode = 1
    with pytest.raises(InputError, match="is not calibrated in temperatures"):
        read(path)


@pytest.mark.parametrize("name", ["a.hcc", "a.jpg"])
def test_a_missing_package_is_named(tmp_path, monkeypatch, name):
    for library in ("fasthcc", "dji_thermal_cli"):
        monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(InputError, match=r"pip install 'mi_lcair\[cameras\]'"):
        read(written(tmp_path / name, PLAIN + b"DJI"))
