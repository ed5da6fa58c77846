"""PLY meshes: their extent, or one line that says what a renderer would misread."""

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.models3d.modellers.ply import check_ply, read_ply
from tests.calls import calls_of
from tests.rendering.loading.scene_text import HALVES, SQUARE, write_ply

TEXT = """ply
format ascii 1.0
comment a square
element vertex 4
property float x
property float y
property double z
property uchar shade
element face 2
property list uchar int vertex_indices
property float temperature_0
end_header
0 0 0 7
2 0 0 7
2 3 0 7
0 3 0 7
3 0 1 2 300
3 0 2 3 310
"""


def check(tmp_path, content):
    path = tmp_path / "mesh.ply"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return check_ply(path)


def test_extent(tmp_path):
    """In text and in binary of either byte order."""
    assert np.array_equal(check(tmp_path, TEXT), [[0, 0, 0], [2, 3, 0]])
    write_ply(tmp_path / "mesh.ply", SQUARE, HALVES, temperature=[300, 310])
    assert np.array_equal(check_ply(tmp_path / "mesh.ply"), [[-1, -1, 0], [1, 1, 0]])
    header = TEXT[: TEXT.index("end_header\n") + 11].replace("ascii", "binary_big_endian")
    body = b"".join(
        np.array(row, ">f4").tobytes() + np.array(0, ">f8").tobytes() + b"\7"
        for row in ((0, 0), (2, 0), (2, 3), (0, 3))
    )
    for face in HALVES:
        body += b"\3" + np.array(face, ">i4").tobytes() + np.array(300, ">f4").tobytes()
    assert np.array_equal(check(tmp_path, header.encode() + body), [[0, 0, 0], [2, 3, 0]])


@pytest.mark.parametrize(
    "old, new, message",
    [
        ("ply\n", "plz\n", "is no PLY file"),
        ("end_header", "end", "is no PLY file"),
        ("ascii", "text", "header's line 'format text 1.0' cannot be understood"),
        ("format ascii 1.0\n", "", "names no format"),
        ("element vertex 4", "element vertex -4", "'element vertex -4' cannot be understood"),
        ("element vertex 4", "element vertex 99999999999999", "cannot be understood"),
        ("element vertex 4", "element vertex 999999", "ends within its 999999 elements 'vertex'"),
        ("element face 2", "element face 9", "ends within its 9 elements 'face'"),
        ("element face 2", "element face 0", "has no faces"),
        ("element face", "element faces", "one element vertex and one element face"),
        ("property double z\n", "property double w\n", "its vertices lack z"),
        ("vertex_indices", "corners", "its faces lack the list vertex_indices"),
        ("property float y", "property float x", "a property twice"),
        ("3 0 2 3 310", "3 0 2 4 310", "face 1 names vertex 4; the mesh has 4"),
        ("3 0 2 3 310", "3 0 2 -1 310", "face 1 names vertex -1"),
        ("3 0 2 3 310", "3 0 2 nan 310", "face 1 names vertex -1"),
        ("3 0 2 3 310", "4 0 2 3 1 310", "its faces have 4 corners; they must be triangles"),
        ("3 0 2 3 310", "2 0 2 310", "face 1 has fewer than three corners"),
        ("3 0 1 2 300\n3 0 2 3 310", "4 0 1 2 3 9\n4 0 1 2 3 9", "have 4 corners; .* triangles"),
        ("2 3 0 7", "2 inf 0 7", "vertex 2 is not finite"),
        ("2 3 0 7", "2 three 0 7", "a word that is not a number"),
        ("list uchar int", "list float int", "cannot be understood"),
        (
            "element face 2\n",
            "element edge 2\nelement face 2\n",
            "element 'edge' has no properties",
        ),
        ("temperature_0", "temp\u00e9rature_0", "cannot be understood"),
        ("element face", "element fac\u00e9", "cannot be understood"),
    ],
)
def test_refused(tmp_path, old, new, message):
    assert old in TEXT
    with pytest.raises(InputError, match=f"mesh.ply: .*{message}"):
        check(tmp_path, TEXT.replace(old, new, 1))


FACES = [[0, 1, 2], [0, 1, 2, 3], [3, 2, 1, 0, 4], [2, 3, 4]]
MIXED = """ply
format {} 1.0
element vertex 5
property float x
property float y
property float z
element face 4
property uchar shade
property list uchar short vertex_index
property list uint double weights
property float temperature_0
end_header
"""


@pytest.mark.parametrize("order", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_faces_of_different_sizes(tmp_path, order):
    """Two lists whose lengths vary, between other properties."""
    points = np.arange(15.0).reshape(5, 3)
    if order == "ascii":
        rows = [" ".join(map(str, row)) for row in points]
        for k, face in enumerate(FACES):
            weights = [0.5] * k
            rows.append(" ".join(map(str, [7, len(face), *face, k, *weights, 300])))
        body = "\n".join(rows).encode()
    else:
        mark = "<" if "little" in order else ">"
        body = points.astype(f"{mark}f4").tobytes()
        for k, face in enumerate(FACES):
            body += bytes([7, len(face)]) + np.array(face, f"{mark}i2").tobytes()
            body += np.array(k, f"{mark}u4").tobytes() + np.full(k, 0.5, f"{mark}f8").tobytes()
            body += np.array(300, f"{mark}f4").tobytes()
    path = tmp_path / "mixed.ply"
    path.write_bytes(MIXED.format(order).encode() + body)
    faces = read_ply(path)
    assert np.array_equal(faces.vertices, points)
    assert faces.sizes.tolist() == [3, 4, 5, 3]
    assert faces.corners.tolist() == sum(FACES, [])
    path.write_bytes(MIXED.format(order).encode() + body[:-4])
    with pytest.raises(InputError, match="ends within its 4 elements 'face'"):
        read_ply(path)


def test_without_elements(tmp_path):
    """An element with no entries is skipped; a mesh without vertices and faces is refused."""
    edges = "element edge 0\nproperty int first\nproperty list uchar int others\nelement face 2"
    assert np.array_equal(
        check(tmp_path, TEXT.replace("element face 2", edges)), check(tmp_path, TEXT)
    )
    empty = TEXT.replace("vertex 4", "vertex 0").replace("face 2", "face 0")
    with pytest.raises(InputError, match="mesh.ply: has no faces"):
        check(tmp_path, empty[: empty.index("end_header\n") + 11])


def test_missing(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        check_ply(tmp_path / "gone.ply")


def test_a_million_triangles(tmp_path):
    """They are checked by arrays, not face by face."""
    chance = np.random.default_rng(0)
    write_ply(
        tmp_path / "mesh.ply", chance.random((500_000, 3)), chance.integers(0, 500_000, (10**6, 3))
    )
    assert calls_of(check_ply, tmp_path / "mesh.ply") < 10_000
