import zlib
from xml.etree import ElementTree

import pytest

from mi_lcair.drawing import new_figure, write_figure
from mi_lcair.errors import InputError


def picture():
    figure = new_figure((3, 2))
    axes = figure.subplots()
    axes.plot([0, 1], [0, 1])
    axes.set_title("radiance of the µ-target")
    return figure


def test_svg_has_texts(tmp_path):
    write_figure(picture(), tmp_path / "a.svg")
    root = ElementTree.parse(tmp_path / "a.svg").getroot()
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    texts = {"".join(text.itertext()) for text in root.iter("{http://www.w3.org/2000/svg}text")}
    assert "radiance of the µ-target" in texts


def test_pdf(tmp_path):
    write_figure(picture(), tmp_path / "a.pdf")
    data = (tmp_path / "a.pdf").read_bytes()
    assert data.startswith(b"%PDF-") and data.rstrip().endswith(b"%%EOF")
    assert b"CreationDate" not in data
    # Text operators, and TrueType outlines that are embedded
    pages = [
        zlib.decompress(part.split(b"endstream")[0].strip(b"\r\n"))
        for part in data.split(b"stream\n")[1:]
        if part[:1] == b"x"
    ]
    assert (
        any(b" Tf" in page and (b"Tj" in page or b"TJ" in page) for page in pages)
        and b"/FontFile2" in data
    )


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_equal_pictures_are_equal_files(tmp_path, suffix, monkeypatch):
    write_figure(picture(), tmp_path / f"a{suffix}")
    monkeypatch.setattr("time.time", lambda: 2e9)
    write_figure(picture(), tmp_path / f"b{suffix}")
    assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


def test_another_suffix(tmp_path):
    with pytest.raises(InputError, match="does not end in .png, .svg or .pdf"):
        write_figure(picture(), tmp_path / "a.jpg")
    assert not list(tmp_path.iterdir())


def test_a_notebook_shows_a_figure_without_pyplot():
    from IPython.core.formatters import DisplayFormatter  # of Jupyter, which comes with [docs]

    shown, _ = DisplayFormatter().format(picture())
    assert shown["image/png"].startswith(b"\x89PNG")
