"""Fuzz: whatever is in the file, a model comes out whose figures are finite, or one line that says
what is wrong.
"""

import math
import re
import tempfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mi_lcair.errors import InputError
from mi_lcair.models3d import export, read, report
from tests.models3d.shapes import cube

FUZZ = settings(
    max_examples=120, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)

WORDS = st.sampled_from(
    [
        "v",
        "f",
        "o",
        "g",
        "vn",
        "0",
        "1",
        "-1",
        "2",
        "3",
        "8",
        "9",
        "-8",
        "1/1",
        "1//1",
        "2/2/2",
        "/",
        "1/",
        "nan",
        "inf",
        "1e308",
        "1e-320",
        "-0.0",
        "0.5",
        "99999999999999999999",
        "\\",
        "#",
        "\ufeff",
        "\x00",
        "\x0b",
        "\x85",
        "\u2028",
        "é",
        "½",
        "f*bareAl*300*",
        "s*blackbody*20C*",
        "t**",
        "****",
        "*",
        "f*bareAl*3e2*group=x",
        "f*diffuse*1e4*elevation_deg=1",
    ]
)
LINES = st.lists(WORDS, max_size=6).map(" ".join)
CUBE = cube() + cube(at=(2, 0, 0), label="s*blackbody*250*elevation_deg=4.5")


@st.composite
def mutated(draw):
    """The text of two cubes with some pieces cut out, doubled, swapped or replaced."""
    text = draw(st.sampled_from([CUBE, CUBE.replace("\n", "\r\n"), CUBE.replace("-", "")]))
    for _ in range(draw(st.integers(1, 6))):
        begin = draw(st.integers(0, len(text)))
        end = draw(st.integers(begin, min(begin + 30, len(text))))
        piece = draw(
            st.one_of(WORDS, LINES.map("\n{}\n".format), st.just(text[begin:end] * 2), st.just(""))
        )
        text = text[:begin] + piece + text[end:]
    return text


def check(content: bytes):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.obj"
        path.write_bytes(content)
        try:
            model = read(path)
        except InputError as error:
            assert str(error).startswith(str(path)) and len(str(error).splitlines()) == 1
            return
        result = report(model)
        assert (
            result["facets"] == len(model.label) >= 1
            and len(model.triangle_facet) == result["triangles"] >= 1
        )
        assert all(
            math.isfinite(result[key])
            for key in ("volume", "non_planar_mm", "temperature_min", "temperature_max")
        )
        assert all(
            area >= 0 and math.isfinite(area) for area in result["area_by_material"].values()
        )
        assert all(
            0 <= result[key] <= result["facets"]
            for key in ("inward", "degenerate", "duplicate", "non_planar")
        )
        assert len(export(model, Path(folder) / "out")) >= 3


@pytest.mark.slow
@FUZZ
@given(st.binary(max_size=200))
def test_bytes(content):
    check(content)


@pytest.mark.slow
@FUZZ
@given(st.lists(LINES, max_size=12).map("\n".join))
def test_statements_at_random(text):
    check(text.encode())


@pytest.mark.slow
@FUZZ
@given(mutated())
def test_mutations_of_a_good_file(text):
    check(text.encode())


@pytest.mark.slow
@settings(FUZZ, max_examples=60)
@given(
    st.integers(3, 9).flatmap(
        lambda n: st.lists(st.tuples(*[st.integers(0, 3)] * 3), min_size=n, max_size=n)
    )
)
def test_polygons_on_a_coarse_grid(points):
    """Corners that coincide, lie on lines, fold back and cross, in and out of a plane."""
    vertices = "".join("v {} {} {}\n".format(*point) for point in points)
    flat = re.sub(r"\S+$", "0", vertices, flags=re.M)
    face = "f " + " ".join(str(-i) for i in range(1, len(points) + 1)) + "\n"
    for text in (vertices, flat):
        check(
            ("o f*bareAl*300*\n" + text + face + "v 9 9 9\nv 8 9 9\nv 9 8 9\nf -1 -2 -3\n").encode()
        )
