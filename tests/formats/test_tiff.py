import struct

import numpy as np
import pytest
from PIL import Image

from mi_lcair.errors import InputError
from mi_lcair.formats import tiff


def tags(data: bytes) -> dict:
    """Values of the first page's tags, by number, from the bytes of a little-endian TIFF file."""
    assert data[:4] == b"II*\0"
    (place,) = struct.unpack_from("<I", data, 4)
    (count,) = struct.unpack_from("<H", data, place)
    found = {}
    for k in range(count):
        tag, kind, number = struct.unpack_from("<HHI", data, place + 2 + 12 * k)
        letter = {2: "s", 3: "H", 4: "I", 5: "II"}[kind]
        form = f"<{number}{letter}" if kind != 5 else f"<{2 * number}I"
        at = place + 10 + 12 * k
        if struct.calcsize(form) > 4:
            (at,) = struct.unpack_from("<I", data, at)
        found[tag] = struct.unpack_from(form, data, at)
    return found


def test_kelvin_in_32_bits(tmp_path):
    """Read by the format's specification, not by the library that wrote it."""
    kelvin = np.linspace(250, 400, 35).reshape(5, 7)
    kelvin[0, 0] = np.nan
    tiff.write(tmp_path / "a.tif", kelvin, "temperature.Y, K")
    data = (tmp_path / "a.tif").read_bytes()
    found = tags(data)
    assert found[256] == (7,) and found[257] == (5,)
    assert found[258] == (32,) and found[339] == (3,)  # bits of a sample; floating point
    assert found[259] == (1,)  # not compressed
    assert found[270][0].rstrip(b"\0") == b"temperature.Y, K"
    assert 306 not in found  # no date
    strips = b"".join(data[at : at + n] for at, n in zip(found[273], found[279]))
    np.testing.assert_array_equal(
        np.frombuffer(strips, "<f4").reshape(5, 7), kelvin.astype(np.float32)
    )


def test_pages_of_counts(tmp_path):
    counts = np.arange(24, dtype=np.uint16).reshape(2, 3, 4) * 2000
    tiff.write(tmp_path / "a.tif", counts)
    with Image.open(tmp_path / "a.tif") as file:
        assert file.n_frames == 2
        for page in range(2):
            file.seek(page)
            np.testing.assert_array_equal(np.array(file), counts[page])


def test_unwritable(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        tiff.write(tmp_path / "no" / "a.tif", np.zeros((2, 2)))
