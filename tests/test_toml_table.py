"""Dataclasses from TOML tables: types of values, defaults, and the message for each mistake."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from mi_lcair.declared import entry, required
from mi_lcair.errors import InputError
from mi_lcair.toml_table import check_tables, converted, filled, located, plain, read


@dataclass
class Table:
    name: str
    size: float
    count: int = 3
    angles: tuple[float, ...] = ()
    shift: float | None = None
    on: bool = False
    extra: dict = field(default_factory=dict)


def test_values_are_converted_to_the_types_of_the_fields():
    table = filled(
        Table, {"name": "a", "size": 2, "angles": 5, "shift": 1e-30, "extra": {"x": 1}}, "[table]"
    )
    assert table == Table("a", 2.0, 3, (5.0,), 1e-30, False, {"x": 1})
    assert type(table.size) is float and type(table.angles[0]) is float
    assert filled(Table, {"name": "", "size": -1e12, "angles": [1, 2.5]}, "").angles == (1.0, 2.5)
    assert required(float | None) is float and required(int) is int
    assert converted(0, float, "x") == 0


def test_values_of_numpy_are_those_of_python():
    tables = {
        "name": Path("a.xml"),
        "size": np.float32(0.5),
        "count": np.int64(2),
        "angles": np.array([1, 2]),
        "on": np.True_,
        "extra": {"x": (np.float64(3), "b")},
    }
    table = read(tables, lambda tree, *_: filled(Table, tree, "[table]"), "table")
    assert table == Table("a.xml", 0.5, 2, (1.0, 2.0), None, True, {"x": [3.0, "b"]})
    assert type(plain(np.float64(3))) is float


@pytest.mark.parametrize(
    "values, message",
    [
        (3, "[table] must be a table"),
        ({"name": "a"}, "[table]: size is missing; give name, size"),
        ({"nam": "a", "size": 1}, "unknown key of [table] 'nam'; known: name"),
        ({"name": 1, "size": 1}, "[table]: name = 1; must be a text"),
        ({"name": "a", "size": "b"}, "[table]: size = 'b'; must be a finite number"),
        ({"name": "a", "size": True}, "size = True; must be a finite number"),
        ({"name": "a", "size": float("nan")}, "size = nan; must be a finite number"),
        ({"name": "a", "size": float("inf")}, "size = inf; must be a finite number"),
        ({"name": "a", "size": 10**13}, "size = 10000000000000; must be a finite number"),
        ({"name": "a", "size": 1.1e12}, "must be 0, or of a size within 1e-30..1e+12"),
        ({"name": "a", "size": -0.9e-30}, "size = -9e-31; must be 0, or of a size within"),
        ({"name": "a", "size": 1, "count": 1.0}, "count = 1.0; must be a whole number"),
        ({"name": "a", "size": 1, "on": 1}, "on = 1; must be true or false"),
        ({"name": "a", "size": 1, "extra": 1}, "extra = 1; must be a table"),
        ({"name": "a", "size": 1, "angles": ["b"]}, "angles = 'b'; must be a finite number"),
        ({"name": "a" * 999, "size": "b" * 999}, "bbb"),
    ],
)
def test_mistakes(values, message):
    with pytest.raises(InputError) as error:
        filled(Table, values, "[table]")
    assert message in str(error.value) and len(str(error.value)) < 200


def test_files_are_relative_to_the_folder_and_names_stay(tmp_path):
    (tmp_path / "lid").write_text("")
    assert located(tmp_path, "a.xml") == str(tmp_path / "a.xml")
    assert located(tmp_path, "lid") == str(tmp_path / "lid")
    assert located(tmp_path, "furnace") == "furnace"
    assert located(tmp_path, "288.5") == "288.5"
    values = {"modes": "lid", "band": "LWIR", "lid.temperature": 0.5}
    assert located(tmp_path, values) == values | {"modes": str(tmp_path / "lid")}


def test_the_declared_files_of_a_table_are_located(tmp_path):
    @dataclass
    class Files:
        scene: str = entry(is_file=True)
        plugins: tuple[str, ...] = entry((), is_file=True)
        title: str = ""

    values = {"scene": "a.xml", "plugins": ["b.py"], "title": "c.txt"}
    found = filled(Files, values, "[files]", tmp_path)
    assert found == Files(str(tmp_path / "a.xml"), (str(tmp_path / "b.py"),), "c.txt")
    assert filled(Files, values, "[files]") == Files("a.xml", ("b.py",), "c.txt")


def test_a_file_of_another_kind_is_named():
    known = ("shape", "wall", "view", "sigma")
    check_tables(known, {"shape": {}, "wall": {}})
    with pytest.raises(InputError, match=r"'pose'; known: .*; \[observer\] is a table of a sc"):
        check_tables(known, {"pose": {}, "observer": {}})
    with pytest.raises(InputError, match="unknown table 'walls'; known: wall, [a-z, ]*$"):
        check_tables(known, {"walls": {}})
