"""Radiance images survive the way to the disk and back, whole or not at all."""

import os

import numpy as np
import OpenEXR
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from mi_lcair.errors import InputError
from mi_lcair.files import check_writable, replacing
from mi_lcair.rendering.images.files import STRUCTURE, read_exr, write_exr
from mi_lcair.rendering.loading.parsing import exr_files

ONE = {"Y": np.ones((2, 3), np.float32)}

label = st.from_regex(r"[A-Za-z0-9_-]{1,40}", fullmatch=True)
channel_name = st.one_of(
    st.just("Y"), st.builds("{}.{}.Y".format, st.sampled_from(["group", "seen"]), label)
)
text = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=200)
attribute_name = st.text(
    st.characters(codec="utf-8", exclude_characters="\0"), min_size=1, max_size=60
).filter(lambda name: name not in STRUCTURE | {"name"})
values = st.one_of(
    text,
    st.integers(-(2**31), 2**31 - 1),
    st.floats(width=32, allow_nan=False, allow_infinity=False),
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("images")


@pytest.mark.slow
@given(st.data())
@settings(max_examples=30, deadline=None)
def test_round_trip(folder, data):
    """Every finite float32, every label and every header value comes back bit for bit."""
    shape = data.draw(hnp.array_shapes(min_dims=2, max_dims=2, max_side=7))
    finite = st.floats(width=32, allow_nan=False, allow_infinity=False)
    channels = data.draw(
        st.dictionaries(
            channel_name, hnp.arrays(np.float32, shape, elements=finite), min_size=1, max_size=4
        )
    )
    header = data.draw(st.dictionaries(attribute_name, values, max_size=4))
    write_exr(folder / "image.exr", channels, header)
    channels_back, header_back = read_exr(folder / "image.exr")
    assert channels_back.keys() == channels.keys()
    for name, pixels in channels.items():
        assert channels_back[name].dtype == np.float32
        assert channels_back[name].tobytes() == pixels.tobytes()
    assert header_back == header


def test_mitsuba_reads_the_same_pixels(tmp_path):
    """An independent reader agrees, also for arrays that are not contiguous (which the OpenEXR
    package writes wrong).
    """
    import mitsuba as mi

    film = np.arange(4 * 5 * 2, dtype=np.float32).reshape(4, 5, 2)
    cases = {
        "slice": film[..., 1],
        "transposed": film[..., 0].T,
        "float64": np.arange(20.0).reshape(4, 5),
    }
    for name, pixels in cases.items():
        write_exr(tmp_path / f"{name}.exr", {"Y": pixels}, {"band": "MWIR"})
        with exr_files():
            seen = np.array(mi.Bitmap(str(tmp_path / f"{name}.exr")))
        np.testing.assert_array_equal(seen.reshape(pixels.shape), pixels, err_msg=name)


def test_header_numbers(tmp_path):
    """Counts beyond 31 bits become strings, where the format would store 0; NumPy scalars become
    numbers.
    """
    header = {
        "paths": 2048**2 * 1024,
        "low": -(2**31) - 1,
        "spp": np.int64(64),
        "mean": np.float32(0.5),
    }
    given_header, given_channels = dict(header), dict(ONE)
    write_exr(tmp_path / "image.exr", given_channels, given_header)
    assert (given_header, given_channels) == (
        header,
        ONE,
    )  # the package alone would add entries to both
    assert read_exr(tmp_path / "image.exr")[1] == {
        "paths": "4294967296",
        "low": "-2147483649",
        "spp": 64,
        "mean": 0.5,
    }


@pytest.mark.parametrize("value", [0, 0.5, "first"])
def test_the_name_of_a_part_is_a_string(tmp_path, value):
    write_exr(tmp_path / "image.exr", ONE, {"name": value})
    assert read_exr(tmp_path / "image.exr")[1] == {"name": str(value)}


@pytest.mark.parametrize(
    "channels, header",
    [
        ({"Y": np.array([[1, np.nan]])}, {}),
        ({"Y": np.array([[1, -np.inf]])}, {}),
        ({"Y": np.ones((2, 3)), "Z": np.ones((3, 2))}, {}),
        ({"Y": np.ones((2, 3, 1))}, {}),
        ({"Y": np.ones((0, 3))}, {}),
        ({}, {}),
        ({"": np.ones((2, 3))}, {}),
        ({"x" * 256: np.ones((2, 3))}, {}),
        (ONE, {"version": "1.0"}),
        (ONE, {"mean": float("nan")}),
        (ONE, {"mean": 1e39}),
        (ONE, {"bands": [3, 5]}),
    ],
    ids=[
        "nan",
        "inf",
        "shapes",
        "3D",
        "empty",
        "none",
        "unnamed",
        "long name",
        "reserved",
        "nan header",
        "float64 header",
        "list header",
    ],
)
def test_mistakes_of_the_caller(tmp_path, channels, header):
    """What the format would drop, damage or refuse is a ValueError (not an InputError), and nothing
    is written.
    """
    with pytest.raises(ValueError) as caught:
        write_exr(tmp_path / "image.exr", channels, header)
    assert not isinstance(caught.value, InputError)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("interruption", [KeyboardInterrupt, OSError, RuntimeError])
def test_an_interrupted_write_changes_nothing(tmp_path, monkeypatch, interruption):
    """The old file stays as it was, and no temporary is left."""
    path = tmp_path / "image.exr"
    write_exr(path, ONE, {"spp": 1})
    before = path.read_bytes()

    def interrupted(self, name):
        with open(name, "wb") as file:
            file.write(b"half")
        raise interruption

    monkeypatch.setattr(OpenEXR.File, "write", interrupted)
    with pytest.raises(interruption):
        write_exr(path, {"Y": np.zeros((2, 3))}, {})
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_gets_the_usual_permissions(tmp_path):
    (tmp_path / "usual").touch()
    write_exr(tmp_path / "image.exr", ONE, {})
    assert (tmp_path / "image.exr").stat().st_mode == (tmp_path / "usual").stat().st_mode


def test_check_writable(tmp_path):
    """Says yes without a trace, and says in one line why not."""
    (tmp_path / "old.exr").write_bytes(b"old")
    check_writable(tmp_path / "old.exr")
    check_writable(tmp_path / "new.exr")
    assert [path.name for path in tmp_path.iterdir()] == ["old.exr"]
    assert (tmp_path / "old.exr").read_bytes() == b"old"
    for path, reason in [
        (tmp_path / "nowhere" / "a.exr", "does not exist"),
        (tmp_path, "not a file"),
        (tmp_path / "old.exr" / "a.exr", "does not exist"),
        ("/dev/null", "not a file"),
        (tmp_path / ("x" * 300 + ".exr"), "cannot write"),
    ]:
        with pytest.raises(InputError, match=reason) as caught:
            check_writable(path)
        assert "\n" not in str(caught.value)


def test_a_folder_without_permission(tmp_path, monkeypatch):
    """A refusal of the system becomes an InputError (simulated: a test run by root may write
    anywhere).
    """

    def refused(self, *args, **kwargs):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("pathlib.Path.touch", refused)
    with (
        pytest.raises(InputError, match="Permission denied"),
        replacing(tmp_path / "image.exr"),
    ):
        pytest.fail("the block must not start")


def test_images_of_other_programs(tmp_path):
    """Half floats, whole numbers, any names, attributes of other types, a window off the origin,
    several parts.
    """
    half = np.array([[0.5, 1, 2]], np.float16)
    whole = np.array([[7, 8, 9]], np.uint32)
    window = (np.array([5, 6], np.int32), np.array([7, 6], np.int32))
    OpenEXR.File(
        {
            "type": OpenEXR.scanlineimage,
            "dataWindow": window,
            "owner": "me",
            "whiteLuminance": 2.0,
            "adoptedNeutral": np.array([0.3, 0.3], np.float32),
        },
        {"R": half, "G": half, "B": half, "A": half, "left eye.Z": whole},
    ).write(str(tmp_path / "rgba.exr"))
    channels, header = read_exr(tmp_path / "rgba.exr")
    assert channels.keys() == {"R", "G", "B", "A", "left eye.Z"}
    assert {pixels.dtype for pixels in channels.values()} == {np.dtype(np.float32)}
    np.testing.assert_array_equal(channels["G"], half)
    np.testing.assert_array_equal(channels["left eye.Z"], whole)
    assert header == {"owner": "me", "whiteLuminance": 2.0}

    parts = [
        OpenEXR.Part(
            {"type": OpenEXR.scanlineimage, "name": name}, {"Z": np.full((2, 2), value, np.float32)}
        )
        for name, value in (("first", 1), ("second", 2))
    ]
    OpenEXR.File(parts).write(str(tmp_path / "parts.exr"))
    channels, header = read_exr(tmp_path / "parts.exr")
    np.testing.assert_array_equal(channels["Z"], np.ones((2, 2)))
    assert header == {"name": "first"}


@pytest.mark.parametrize(
    "content, reason",
    [
        (None, "No such file"),
        (b"", "not an OpenEXR"),
        (b"\x89PNG....", "not an"),
        (b"\x76\x2f\x31\x01", "damaged"),
    ],
    ids=["missing", "empty", "png", "magic"],
)
def test_unreadable_images(tmp_path, content, reason):
    path = tmp_path / "image.exr"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=reason):
        read_exr(path)


@pytest.mark.slow
@given(st.data())
@settings(max_examples=150, deadline=None)
def test_damaged_images(folder, data):
    """A file cut short or with bytes changed gives an image or an InputError, never another
    exception or a crash.
    """
    whole = _sample(folder)
    damaged = bytearray(
        whole[: data.draw(st.one_of(st.just(len(whole)), st.integers(4, len(whole))))]
    )
    for _ in range(data.draw(st.integers(0, 4))):
        damaged[data.draw(st.integers(4, len(damaged) - 1)) if len(damaged) > 4 else 0] = data.draw(
            st.integers(0, 255)
        )
    _read_or_refuse(folder, bytes(damaged))


@pytest.mark.slow
@given(st.binary(max_size=300), st.booleans())
@settings(max_examples=150, deadline=None)
def test_random_bytes(folder, content, as_exr):
    """The same for bytes that never were an image, with and without OpenEXR's magic number and
    version.
    """
    _read_or_refuse(folder, (b"\x76\x2f\x31\x01\x02\0\0\0" if as_exr else b"") + content)


def _sample(folder):
    path = folder / "sample.exr"
    if not path.exists():
        write_exr(
            path,
            {"Y": np.random.default_rng(0).random((13, 14)), "range.Y": np.ones((13, 14))},
            {"band": "MWIR"},
        )
    return path.read_bytes()


def _read_or_refuse(folder, content):
    path = folder / "damaged.exr"
    path.write_bytes(content)
    try:
        channels, _ = read_exr(path)
    except InputError:
        return
    assert all(pixels.dtype == np.float32 for pixels in channels.values())


def test_damage_is_told_once(tmp_path, capfd):
    """The library's own complaints, which it prints from Python and from C, do not reach the
    terminal.
    """
    whole = _sample(tmp_path)
    path = tmp_path / "cut.exr"
    path.write_bytes(whole[:-100])
    with pytest.raises(InputError, match="damaged"):
        read_exr(path)
    os.write(2, b"stderr works again")
    assert capfd.readouterr() == ("", "stderr works again")
