"""Tables that users write: separators, decimal marks, damaged rows, and what is no table at all."""

import csv
import os

import numpy as np
import pytest

import mi_lcair
from mi_lcair import files
from mi_lcair.detection.scenario import Scenario
from mi_lcair.errors import InputError
from mi_lcair.fitting.scatterometer.reading import read as scatterometer
from mi_lcair.models3d import read as read_model
from mi_lcair.physics.atmosphere import atmosphere
from mi_lcair.physics.bands import band
from mi_lcair.physics.materials import names
from mi_lcair.physics.sky import spectrum
from mi_lcair.physics.spectral_table import over_the_hemisphere, read_directional_table
from mi_lcair.rendering.images.files import read_exr
from mi_lcair.table import read_table, safe_cell


@pytest.fixture
def file(tmp_path):
    def write(content):
        path = tmp_path / "table.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


@pytest.mark.parametrize(
    "text",
    [
        "a,b\n1,0.5\n2,0.25\n",
        "# made: by hand\n# made: again\nb;a\r\n0,5;1\r\n0,25;2\r\n",
        '\ufeff"a"\t b\n1\t.5\n\n2\t2.5e-1\n',
        "a,b,name\n1,0.5,=1\n,,\n2,0.25,\n",
    ],
)
def test_separators_and_decimal_marks(file, text):
    table = read_table(file(text), ("a", "b")).numbers(("a", "b"))
    assert table["a"].tolist() == [1, 2] and table["b"].tolist() == [0.5, 0.25]


def test_cells_that_may_be_missing(file):
    table = read_table(file("facet,a\n0,\n1,nan\n2,3\n"), ("facet",))
    np.testing.assert_array_equal(table.numbers(["a"], may_lack=True)["a"], [np.nan, np.nan, 3])
    with pytest.raises(InputError, match="line 2: '' in column 'a' is not a number"):
        table.numbers(["a"])


READERS = {
    "emissivity": ("theta_deg,emissivity\n", "30,{}\n60,0.5\n", read_directional_table),
    "response": ("wavelength_um,response\n", "3,{}\n5,0.5\n", band),
    "spectrum": ("wavelength_um,radiance_W_m2_sr_um\n", "3,{}\n5,0.5\n", spectrum),
    "atmosphere": (
        "range_km,wavelength_um,path_radiance_W_m2_sr_um,transmittance\n",
        "1,3,0,{}\n1,5,0,0.5\n",
        atmosphere,
    ),
}


@pytest.mark.parametrize("kind", READERS)
@pytest.mark.parametrize(
    "cell, message",
    [
        ("0,85", "line 2: . cells where the header names .; a decimal comma needs semicolons"),
        ("0.85,0.2", "line 2: . cells where the header names "),
        ("0.8x", "line 2: '0.8x' in column '.*' is not a number"),
        ("\u0663", "is not a number"),
        ("1e31", "is not a number"),
        ("0.5\x1b[31m", "not a text file"),
    ],
)
def test_no_cell_is_guessed(file, kind, cell, message):
    """A decimal comma between commas is no 0, and a third cell does not take the second's place."""
    header, rows, read = READERS[kind]
    read(file(header + rows.format("0.85")))
    with pytest.raises(InputError, match=message):
        read(file(header + rows.format(cell)))


@pytest.mark.parametrize("kind", READERS)
def test_a_decimal_comma_between_semicolons_is_understood(file, kind):
    header, rows, read = READERS[kind]
    read(file((header + rows.format("0.85")).replace(",", ";").replace(".", ",")))


@pytest.mark.parametrize("kind", READERS)
def test_a_file_that_is_no_table_is_not_quoted(file, kind):
    """A scene or an option may name any file; what is in it is nobody's business."""
    with pytest.raises(InputError) as error:
        READERS[kind][2](file("root:hunter2,x\nroot,2\n"))
    assert "hunter2" not in str(error.value) and "the header must name" in str(error.value)


@pytest.mark.parametrize("kind", READERS)
def test_what_has_no_end_is_refused(kind, tmp_path):
    """Not read: a pipe that nobody writes to would never answer."""
    os.mkfifo(tmp_path / "pipe.csv")
    for path in (tmp_path / "pipe.csv", "/dev/zero"):
        with pytest.raises(InputError, match="is no regular file"):
            READERS[kind][2](path)


def test_no_command_waits_for_a_pipe(tmp_path):
    for name in ("pipe.exr", "pipe.toml", "pipe.csv", "pipe.obj", "pipe.xml"):
        os.mkfifo(tmp_path / name)
    for read in (
        lambda: read_exr(tmp_path / "pipe.exr"),
        lambda: Scenario.read(tmp_path / "pipe.toml"),
        lambda: names(tmp_path / "pipe.toml"),
        lambda: read_model(tmp_path / "pipe.obj"),
        lambda: scatterometer(tmp_path / "pipe.csv"),
        lambda: mi_lcair.load(tmp_path / "pipe.xml"),
    ):
        with pytest.raises(InputError, match="no regular file|no such file"):
            read()


def test_a_file_that_is_too_large_is_refused(file, monkeypatch):
    monkeypatch.setattr(files, "LARGEST", 2**20)
    with pytest.raises(InputError, match="has 1 MiB; at most 1 are read"):
        read_table(file("a,b\n" + "1,2\n" * 2**18), ("a", "b"))


def test_a_table_that_ends_early_is_extended_and_that_is_said(file):
    nodes = np.radians([0, 40, 90])
    theta, value, _ = read_directional_table(file("theta_deg,emissivity\n10,0.9\n80,0.5\n"))
    assert over_the_hemisphere("t.csv", theta, value, nodes)[[0, 2]].tolist() == [0.9, 0.5]
    theta, value, _ = read_directional_table(file("theta_deg,emissivity\n5,0.9\n"))
    with pytest.warns(UserWarning, match="t.csv: measured at 5 degrees alone; the nearest value"):
        assert over_the_hemisphere("t.csv", theta, value, nodes).tolist() == [0.9] * 3


def test_a_cell_that_a_spreadsheet_would_run_is_text():
    for cell in ("=cmd|' /C calc'!A0", "+1", "-x", "@sum(a)"):
        assert safe_cell(cell) == f"'{cell}"
    assert [safe_cell(cell) for cell in ("paint", "a-b", "\n=1")] == ["paint", "a-b", r"\n=1"]
    assert next(csv.reader([safe_cell("a\x1b")])) == [r"a\x1b"]
