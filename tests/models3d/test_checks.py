"""The report: models with known volumes, areas and flaws."""

import json
from math import pi

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.models3d import read, report
from tests.models3d.shapes import cube, obj


@pytest.fixture
def load(tmp_path):
    def load(text, **options):
        (tmp_path / "model.obj").write_text(text)
        return read(tmp_path / "model.obj", **options)

    return load


@pytest.fixture
def found(load):
    return lambda text, **options: report(load(text, **options))


FLAWLESS = {"open_edges": 0, "inward": 0, "degenerate": 0, "duplicate": 0, "non_planar": 0}


@pytest.mark.parametrize(
    "text, expected",
    [
        (
            cube(),
            {"facets": 6, "triangles": 12, "volume": 1, "area_by_material": {"bare_aluminum": 6}},
        ),
        (cube(flip=[2]), {"inward": 1}),
        (cube(flip=[0, 5]), {"inward": 2}),
        (cube(flip=[0, 1, 2, 3]), {"inward": 4}),
        (cube(flip=range(6)), {"inward": 6, "volume": -1}),
        (cube(without=[3]), {"facets": 5, "open_edges": 4, "volume": 1}),
        (cube(without=[0, 1]), {"open_edges": 8, "volume": 1}),  # closed by lids
        (
            cube(at=(7, 7, 7)) + obj([(0, 0, 0), (9, 0, 0), (9, 9, 0), (0, 9, 0)], [(0, 1, 2, 3)]),
            {"open_edges": 4, "volume": 1},
        ),  # a plate has none
        (cube(without=[2], flip=[0]), {"open_edges": 4, "inward": 1}),
        (
            cube(without=[2], flip=[0, 1, 3, 4, 5]),
            {"open_edges": 4},
        ),  # open: no inside to face, and all agree
        (
            cube(again=[1]),
            {"facets": 7, "duplicate": 1, "volume": 1, "area_by_material": {"bare_aluminum": 7}},
        ),
        (
            cube(flip=range(6), again=[1]),
            {"facets": 7, "duplicate": 1, "inward": 6, "volume": -1, "open_edges": 0},
        ),
        (
            cube() + cube(at=(1, 0, 0)),
            {"facets": 12, "volume": 2, "duplicate": 1},
        ),  # they share a wall
        (cube() + cube(at=(1, 1, 0)), {"facets": 12, "volume": 2}),  # an edge
        (cube() + cube(at=(1, 1, 0), flip=range(6)), {"facets": 12, "volume": 0, "inward": 6}),
        (
            cube(flip=range(6), label="s*blackbody*280*"),
            {"volume": -1, "area_by_material": {"blackbody": 6}},
        ),  # a sky faces inward
        (
            cube(size=3, flip=range(6), label="t*ir_range_wall*260*")
            + cube(at=(1, 1, 1), flip=[4]),
            {
                "facets": 12,
                "inward": 1,
                "area_by_material": {"bare_aluminum": 6, "ir_range_wall": 54},
            },
        ),
        (
            cube() + obj([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)]),
            {"facets": 7, "degenerate": 1},
        ),
        (
            cube() + obj([(5, 0, 0), (6, 0, 0)], [(0, 1, 1), (0, 0, 0)]),
            {"facets": 8, "degenerate": 2, "open_edges": 0},
        ),
        (
            obj([(0, 0, 0), (1, 0, 0), (1, 1, 0)], [(0, 1, 2), (2, 1, 0)]),
            {"facets": 2, "duplicate": 1, "open_edges": 0},
        ),  # back to back
    ],
)
def test_boxes(found, text, expected):
    result = found(text)
    for key, value in (FLAWLESS | {"volume": None, "open_edges": None} | expected).items():
        if value is not None:
            assert result[key] == pytest.approx(value, abs=1e-12), key


def test_boxes_of_three_materials(found):
    result = found(
        cube()
        + cube(at=(3, 0, 0), size=2, label="f*glossBlack*310*")
        + cube(at=(9, 0, 0), size=3, label="t*diffuse*290*")
    )
    assert result["area_by_material"] == pytest.approx(
        {"bare_aluminum": 6, "gloss_black": 24, "diffuse": 54}
    )
    assert result["volume_by_type"] == pytest.approx({"model": 9, "terrain": 27}) and result[
        "volume"
    ] == pytest.approx(36)
    assert (result["temperature_min"], result["temperature_max"]) == (290, 310)
    assert np.array(result["bounding_box"]).tolist() == [[0, 0, 0], [12, 3, 3]]
    assert {key: result[key] for key in FLAWLESS} == FLAWLESS


def test_volume_does_not_depend_on_the_place(found):
    assert found(cube(at=(723.7, -598.4, 234.6)))["volume"] == pytest.approx(1, rel=1e-9)


def test_a_concave_prism(found):
    """An L of area 3 and height 2: volume 6, area 2 x 3 + 2 x 8."""
    outline = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
    points = [(x, y, z) for z in (0, 2) for x, y in outline]
    sides = [(i, (i + 1) % 6, (i + 1) % 6 + 6, i + 6) for i in range(6)]
    result = found(obj(points, [(5, 4, 3, 2, 1, 0), (6, 7, 8, 9, 10, 11), *sides]))
    assert result["volume"] == pytest.approx(6) and result["area_by_material"][
        "bare_aluminum"
    ] == pytest.approx(22)
    assert {key: result[key] for key in FLAWLESS} == FLAWLESS


def test_a_sphere_of_quadrilaterals(found):
    """Volume and area tend to the sphere's as 1/n^2."""
    rows, columns = 40, 80
    theta, phi = np.pi * np.arange(1, rows) / rows, 2 * np.pi * np.arange(columns) / columns
    rings = [(np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)) for t in theta for p in phi]
    at = lambda row, column: (row - 1) * columns + column % columns
    faces = [
        (at(r, c), at(r + 1, c), at(r + 1, c + 1), at(r, c + 1))
        for r in range(1, rows - 1)
        for c in range(columns)
    ]
    caps = [tuple(range(columns)), tuple(at(rows - 1, c) for c in reversed(range(columns)))]
    result = found(obj(rings, faces + caps))
    assert (
        result["volume"] == pytest.approx(4 / 3 * pi, rel=5e-3)
        and {key: result[key] for key in FLAWLESS} == FLAWLESS
    )
    assert result["area_by_material"]["bare_aluminum"] == pytest.approx(4 * pi, rel=5e-3)
    assert result["non_planar_mm"] < 1e-5


@pytest.mark.parametrize("lift, count", [(1e-7, 0), (2e-5, 0), (1e-3, 1)])
def test_a_quadrilateral_that_is_not_planar_is_split_and_counted(found, lift, count):
    result = found(obj([(0, 0, 0), (1, 0, 0), (1, 1, lift), (0, 1, 0)], [(0, 1, 2, 3)]))
    assert (result["non_planar"], result["triangles"]) == (count, 2)
    assert result["non_planar_mm"] == pytest.approx(1000 * lift / 4, rel=1e-3)
    assert result["area_by_material"]["bare_aluminum"] == pytest.approx(1, rel=1e-5)


def test_vertices_are_welded_by_position_over_the_whole_model(found):
    """Six separate squares make a cube, even if their corners differ by rounding; a true gap stays
    one.
    """
    sides = [
        obj(
            np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])[list(side)]
            + wobble * (number % 2),
            [(0, 1, 2, 3)],
            label,
        )
        for wobble in (3e-7, 1e-4)
        for number, (side, label) in enumerate(
            zip(
                [
                    (0, 1, 3, 2),
                    (4, 6, 7, 5),
                    (0, 4, 5, 1),
                    (2, 3, 7, 6),
                    (0, 2, 6, 4),
                    (1, 5, 7, 3),
                ],
                ["f*bareAl*300*", "f*diffuse*310*"] * 3,
            )
        )
    ]
    assert found("".join(sides[:6]))["open_edges"] == 0
    assert (
        found("".join(sides[6:]))["open_edges"] == 12
    )  # three of the sides are apart from the other three


def test_a_long_edge_beside_two_short_ones_is_open(found):
    points = [
        (0, 0, 0),
        (2, 0, 0),
        (2, 1, 0),
        (0, 1, 0),
        (1, 0, 0),
        (0, -1, 0),
        (1, -1, 0),
        (2, -1, 0),
    ]
    assert (
        found(obj(points, [(0, 1, 2, 3), (0, 5, 6, 4), (4, 6, 7, 1)]))["open_edges"]
        == 3 + 1 + 2 + 2 + 2
    )


@pytest.mark.parametrize("turns", [0, 1])
def test_a_moebius_strip_has_no_inside(found, turns):
    """A band of 12 quadrilaterals, closed with a half turn or without."""
    n = 12
    angle = 2 * np.pi * np.arange(n) / n
    tilt = turns * angle / 2
    edge = lambda sign: np.stack(
        [
            (2 + sign * np.sin(tilt)) * np.cos(angle),
            (2 + sign * np.sin(tilt)) * np.sin(angle),
            sign * np.cos(tilt),
        ],
        1,
    )
    points = np.concatenate([edge(1), edge(-1)])
    faces = [(i, i + 1, i + 1 + n, i + n) for i in range(n - 1)] + [
        (n - 1, n, 0, 2 * n - 1) if turns else (n - 1, 0, n, 2 * n - 1)
    ]
    result = found(
        obj(points, [face[::-1] if number == 3 else face for number, face in enumerate(faces)])
    )
    assert result["open_edges"] == 24 and result["inward"] == (0 if turns else 1)


def test_scale(found):
    result = found(cube(size=1000), scale=0.001)
    assert result["volume"] == pytest.approx(1) and result["area_by_material"][
        "bare_aluminum"
    ] == pytest.approx(6)


def test_numbers_are_strict_json(found):
    text = json.dumps(found(cube()), allow_nan=False, default=lambda value: value.tolist())
    assert json.loads(text)["facets"] == 6
    assert {
        "facets",
        "volume",
        "open_edges",
        "area_by_material",
        "inward",
        "degenerate",
        "duplicate",
        "non_planar",
    } <= set(json.loads(text))


# --------------------------------------------------------------- labels, temperatures, materials


def test_every_facet_has_its_label(load):
    model = load(
        cube()
        + cube(at=(2, 0, 0), label="f*glossBlack*310*")
        + cube(at=(4, 0, 0), label="s*blackbody*250*elevation_deg=3")
    )
    assert [model.labels[i].material for i in model.label] == ["bare_aluminum"] * 6 + [
        "gloss_black"
    ] * 6 + ["blackbody"] * 6
    assert model.temperature.tolist() == [300] * 6 + [310] * 6 + [250] * 6
    assert (
        model.facets_of("f").tolist() == [True] * 12 + [False] * 6
        and not model.facets_of("t").any()
    )


@pytest.fixture
def table(tmp_path):
    def table(text):
        (tmp_path / "t.csv").write_text(text)
        return tmp_path / "t.csv"

    return table


def test_temperatures_of_a_solver(load, table):
    text = "# solver\n\nfacet, kelvin\n" + "\n".join(
        f"{facet}, {300.5 + facet}" for facet in (5, 1, 2, 3, 4, 0)
    )
    for label in ("f*bareAl*300*", "f*bareAl*20*", "f*bareAl**group=hot"):
        assert load(cube(label=label), temperatures=table(text)).temperature.tolist() == [
            300.5 + facet for facet in range(6)
        ]


def test_without_labels(load, table):
    rows = table("facet,kelvin\n" + "".join(f"{facet},300\n" for facet in range(6)))
    model = load(cube(label=None), temperatures=rows, material="glossBlack")
    assert model.facets_of("f").all() and model.labels[0].material == "gloss_black"
    for options, missing in (
        ({}, "or give material and temperature"),
        ({"temperatures": rows}, "or give material"),
        ({"material": "diffuse"}, "or give temperature"),
        ({"temperature": 300}, "or give material"),
    ):
        with pytest.raises(InputError, match=f"line 10: the face has no label; .*{missing}$"):
            load(cube(label=None), **options)


def test_material_of_all_model_facets(found):
    text = (
        cube()
        + cube(at=(2, 0, 0), label="f*nothing*300*")
        + cube(at=(4, 0, 0), label="t*diffuse*300*")
    )
    assert found(text, material="glossBlack")["area_by_material"] == pytest.approx(
        {"gloss_black": 12, "diffuse": 6}
    )


def test_own_materials(found, tmp_path):
    own = tmp_path / "own.toml"
    own.write_text("[rust.any]\nepsilon = 0.8\nrho_d = 0.1\nb = 0.2\ne = 0.3\n")
    assert found(cube(label="f*Rust*300*"), materials=own)["area_by_material"] == pytest.approx(
        {"rust": 6}
    )


@pytest.mark.parametrize(
    "rows, reason",
    [
        (
            "facet,kelvin\n0,300\n1,300\n",
            ": 2 temperatures for 6 facets; the first that is missing is facet 2",
        ),
        (
            "facet,kelvin\n" + "".join(f"{facet},300\n" for facet in range(7)),
            ", line 8: facet '6' does not exist; facets are numbered 0..5",
        ),
        ("facet,kelvin\n0,300\n0,300\n", ", line 3: facet 0 is given twice"),
        ("facet,kelvin\n-1,300\n", "facet '-1' does not exist"),
        ("facet,kelvin\n1.0,300\n", "facet '1.0' does not exist"),
        ("facet,kelvin\n" + "9" * 5000 + ",300\n", "does not exist"),
        (
            "facet,kelvin\n0,27\n",
            ", line 2: temperature '27' looks like degrees Celsius; give kelvin: 300.15",
        ),
        ("facet,kelvin\n0,x\n", "temperature 'x' is not a number"),
        ("facet,kelvin\n0\n", "1 cells where the header names 2"),
        ("facet,kelvin\n0,300,1\n", "3 cells"),
        ("0,300\n", ", line 1: no header line; name the columns, such as facet,kelvin"),
        ("", "must name facet and kelvin"),
        ("facet,celsius\n0,300\n", "must name facet and kelvin"),
    ],
)
def test_temperatures_that_do_not_fit(load, table, rows, reason):
    with pytest.raises(InputError) as error:
        load(cube(), temperatures=table(rows))
    assert f"t.csv{reason}" in str(error.value) or reason in str(error.value)
    assert "t.csv" in str(error.value) and "\n" not in str(error.value)


def test_temperature_files_that_cannot_be_read(load, tmp_path):
    (tmp_path / "t.csv").write_bytes("facet,kelvin\n".encode("utf-16"))
    with pytest.raises(InputError, match="t.csv: not a text file"):
        load(cube(), temperatures=tmp_path / "t.csv")
    with pytest.raises(InputError, match="none.csv: cannot be read: No such file"):
        load(cube(), temperatures=tmp_path / "none.csv")


@pytest.mark.parametrize(
    "text, options, reason",
    [
        (
            cube(label="f*bareAl*27*"),
            {},
            "line 1: object 'f*bareAl*27*': temperature '27' looks like degrees Celsius",
        ),
        (
            "g x*bareAl*300*\n" + cube(label=None).replace("o Cube\n", ""),
            {},
            "line 1: group 'x*bareAl*300*': facet type 'x'",
        ),
        (cube(label="f*gold*300*"), {}, "unknown material 'gold'; known: "),
        (cube(), {"material": "gold"}, "unknown material 'gold'"),
        (cube(), {"materials": "none.toml"}, "none.toml"),
        (cube(), {"scale": 0}, "scale = 0 m; must be positive and finite"),
        (cube(), {"scale": -1}, "scale = -1 m"),
        (cube(), {"scale": float("nan")}, "scale = nan m"),
        (cube(), {"scale": float("inf")}, "scale = inf m"),
        (
            cube(),
            {"scale": 1e10},
            "a corner lies 1e+10 m from the origin, more than 1e+09 m; see scale",
        ),
        (obj([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)]), {}, "no face has an area"),
        (obj([(0, 0, 0)], [(0, 0, 0)]), {}, "no face has an area"),
        (
            cube() + obj([(0, 0, 0), (1, 1, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2, 3)] * 3),
            {},
            "line 21: the face crosses itself or folds back on itself (2 more do); "
            "split it into simple polygons",
        ),
    ],
)
def test_refused(load, text, options, reason):
    with pytest.raises(InputError) as error:
        load(text, **options)
    assert reason in str(error.value) and "\n" not in str(error.value)
