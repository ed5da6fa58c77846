"""The OBJ reader: the statements that it understands, and the lines that it refuses."""

import pytest

from mi_lcair.errors import InputError
from mi_lcair.models3d.modellers import obj
from mi_lcair.models3d.modellers.obj import read_obj

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


@pytest.fixture
def read(tmp_path):
    def read(content):
        path = tmp_path / "model.obj"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_obj(path)

    return read


def faces(model):
    return [model.corners[a:b].tolist() for a, b in zip(model.first, model.first[1:])]


@pytest.mark.parametrize(
    "face",
    [
        "f 1 2 3 4",
        "f 1/1 2/2 3/3 4/4",
        "f 1//1 2//1 3//1 4//1",
        "f 1/9/9 2/9/9 3/9/9 4/9/9",
        "f -4 -3 -2 -1",
        "f -4/-1/-1 2 3// 4/",
        " \t f\t1  2\t3 4 \t",
        "f 1 2 \\\n3 4",
        "f 1 2 \\\r\n  3 \\\n 4",
        "f 1 2 3 4 # a square",
        "f +1 2 3 4\r",
        "# f 9\n\nf 1 2 3 4\n\n",
    ],
)
def test_ways_to_write_a_face(read, face):
    assert faces(read(SQUARE + face)) == [[0, 1, 2, 3]]


def test_vertices(read):
    model = read(
        "v 1 2 3\nv\t-1.5e-3 .5 +5. 1.0\n  v 1 2 3 0.1 0.2 0.3\nvn 0 0 1\nvt 0 0\nvp 1\nf 1 2 3\n"
    )
    assert model.vertices.tolist() == [[1, 2, 3], [-0.0015, 0.5, 5], [1, 2, 3]]


def test_negative_indices_count_from_where_they_stand(read):
    assert faces(read(SQUARE + "f -4 -3 -2\nv 9 9 9\nf -4 -3 -2\nf -5 -4 1\n")) == [
        [0, 1, 2],
        [1, 2, 3],
        [0, 1, 0],
    ]


def test_a_face_may_come_before_its_vertices(read):
    assert faces(read("f 1 2 3\n" + SQUARE)) == [[0, 1, 2]]


@pytest.mark.parametrize(
    "wrapped",
    [
        SQUARE.replace("\n", "\r\n") + "f 1 2 3\r\n",
        SQUARE.replace("\n", "\r") + "f 1 2 3\r",
        "\ufeff" + SQUARE + "f 1 2 3",
        (SQUARE + "f 1 2 3\no Fl\u00fcgel\n").encode("latin-1"),
        "mtllib a.mtl\nusemtl b\ns off\nl 1 2\nunknown\n" + SQUARE + "f 1 2 3\nend\n",
    ],
)
def test_files_of_other_programs(read, wrapped):
    model = read(wrapped)
    assert faces(model) == [[0, 1, 2]] and len(model.vertices) == 4


def test_labels_of_groups_and_objects(read):
    face = "f 1 2 3\n"
    model = read(
        SQUARE
        + face
        + "o f*a*300*\n"
        + face
        + "g plain\n"
        + face
        + "g off s*b*280* x\n"
        + face
        + "g\n"
        + face
        + "g t*c*290*\n"
        + face
        + "o plain\n"
        + face
        + "o f*d*300*Cube.001 2\n"
        + face
    )
    assert [model.names[i][2] if i >= 0 else None for i in model.name] == [
        None,
        "f*a*300*",
        "f*a*300*",
        "s*b*280* x",
        "f*a*300*",
        "t*c*290*",
        None,
        "f*d*300*Cube.001 2",
    ]
    assert model.names[1] == (10, "group", "s*b*280* x")


def test_lines_of_faces(read):
    assert read("# a\n" + SQUARE + "\nf 1 2 \\\n 3\nf 1 2 3\n\n\nf 2 3 4").lines.tolist() == [
        7,
        9,
        12,
    ]


def test_long_runs_are_read_in_pieces(read, monkeypatch):
    monkeypatch.setattr(obj, "AT_ONCE", 3)
    text = SQUARE * 2 + "f 1 2 3\nf 5 6 7 8\n" * 4
    assert faces(read(text)) == [[0, 1, 2], [4, 5, 6, 7]] * 4
    with pytest.raises(InputError, match="line 12: a face must be"):
        read(text.replace("f 5 6 7 8", "f 5 6 7 x", 2).replace("f 5 6 7 x", "f 5 6 7 8", 1))


@pytest.mark.parametrize(
    "text, reason",
    [
        ("", "no faces; a Wavefront OBJ has lines such as f 1 2 3"),
        (SQUARE, "no faces"),
        ("v 1 2 3\nfoo 1 2 3\n", "no faces"),
        (b"\x00\xff\xfe" * 100, "no faces"),
        ((SQUARE + "f 1 2 3").encode("utf-16"), "no faces"),
        ("v 0 0\n", "line 1: a vertex must be three numbers, not '0 0'"),
        ("v", "line 1: a vertex must be three numbers, not ''"),
        ("v 0 0 0\nv 1 x 0\n", "line 2: a vertex must be three numbers, not '1 x 0'"),
        ("v 0 0 1,5\n", "not '0 0 1,5'"),
        ("v 0 0 nan\n", "line 1: a vertex"),
        ("v 0 0 1e999\n", "line 1: a vertex"),
        ("v 0 0 1_0\n", "line 1: a vertex"),
        ("v 0 0 \\\n x\n", "line 1: a vertex must be three numbers, not '0 0 x'"),
        ("v 0 0 # 0\n", "line 1: a vertex"),
        ("v " + "1 " * 50 + "x", "...'"),
        (SQUARE + "f 1 2\n", "line 5: a face must be indices of three vertices or more"),
        (SQUARE + "f\n", "line 5: a face must be"),
        (SQUARE + "f 1 2 3\nf 1 2 -\nf 1 2 3", "line 6: a face must be"),
        ("v 0 0 -", "line 1: a vertex"),
        ("v 0 0 -\nv 1 1 1\n", "line 1: a vertex"),
        (SQUARE + "f 1 2 3.5\n", "not '1 2 3.5'"),
        (SQUARE + "f 1 2 /3\n", "line 5: a face"),
        (SQUARE + "f 1 2 3 /4\n", "line 5: a face"),
        (SQUARE + "f 1 2 3\n" * 9 + "f 1 2 a/1\n" + "f 1 2 3\n" * 9, "line 14: a face must be"),
        (SQUARE + "f 1,2,3", "line 5: a face"),
        (
            SQUARE + "f 1 2 3\nf 1 2 5\n",
            "line 6: face index 5 is out of range; there are 4 vertices in the file",
        ),
        (SQUARE + "f 1 2 3\nf 7 1 2\n", "line 6: face index 7 is out of range"),
        (
            SQUARE + "f 1 2 0\n",
            "line 5: face index 0 is out of range; indices count from 1, or back from -1",
        ),
        ("v 0 0 0\nf -1 -1 -1\nf -1 -2 -1\n" + SQUARE, "line 3: face index -2 is out of range"),
        ("v 0 0 0\nf -1 -1 -1\nf -1 -2 -1\n" + SQUARE, "there is 1 vertex before this line"),
        (SQUARE + "f 1 2 99999999999999999999\n", "line 5: face index"),
        (SQUARE + "f 1 2 -99999999999999999999\n", "line 5: face index"),
        (SQUARE + "f 1 2 3\n\n# f\nf 1 2 \\\n3\nf 1 2 7\n", "line 10: face index 7"),
    ],
)
def test_refused(read, text, reason):
    with pytest.raises(InputError) as error:
        read(text)
    assert (
        "model.obj" in str(error.value)
        and reason in str(error.value)
        and "\n" not in str(error.value)
    )


def test_no_file(tmp_path):
    for path in (tmp_path / "none.obj", tmp_path):
        with pytest.raises(InputError, match="cannot be read: (No such file|Is a directory)"):
            read_obj(path)


FACES = "o f*bareAl*300*\n" + "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n" * 4


@pytest.mark.parametrize(
    "statement, message",
    [
        ("f 1/1/12/2/1 3/3/1 4/4/1", "line 18: a face must be indices"),  # a blank is lost
        ("f 1/12/2 3/3 4/4", "line 18: a face must be indices"),
        ("f 1/1 2/x 3/3 4/4", "line 18: a face must be indices"),
        ("f 1/1 2/2\x013/3 4/4 1/1", "line 18: a face must be indices"),
        ("f 1 2 3/1-4", "line 18: a face must be indices"),
        ("ff 1 2 3", "line 18: statement 'ff' is not one of v, f, o, g, vt"),
        ("F 1 2 3", "line 18: statement 'F' is not one of"),
        ("f1 2 3 4", "line 18: statement 'f1' is not one of"),
        ("oo s*blackbody*250*", "line 18: statement 'oo' is not one of"),
        (
            "a_keyword_longer_than_any other",
            "line 18: statement 'a_keyword_longer_tha' is not one of",
        ),
        ("curv2 1 2", "line 18: statement 'curv2'"),
    ],
)
def test_damaged_statements(tmp_path, statement, message):
    """Each would have dropped a corner, a facet or a label."""
    path = tmp_path / "model.obj"
    path.write_text(FACES + statement + "\nf 1 2 3\n")
    with pytest.raises(InputError, match=message):
        read_obj(path)


def test_statements_that_are_passed_over(tmp_path):
    path = tmp_path / "model.obj"
    path.write_text(
        "mtllib a.mtl\n\n  \nvt 0 0\nvn 0 0 1\ns off\n"
        + FACES
        + "usemtl x\nf 1/1/1 2/1/1 3/1/1\nl 1 2\n"
    )
    assert len(read_obj(path).lines) == 1
