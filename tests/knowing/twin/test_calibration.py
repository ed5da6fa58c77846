"""Calibration of a heat balance: truths that made the readings, what is alike, and bad input."""

import tomllib

import numpy as np
import pytest

import mi_lcair
from mi_lcair import models3d, scenes
from mi_lcair.errors import InputError
from mi_lcair.estimate import relative
from mi_lcair.heating.temperatures.description import HeatDescription, materials
from mi_lcair.heating.temperatures.solve import network_of
from mi_lcair.knowing.twin.unknowns import of_balance
from mi_lcair.toml_table import text_of

EXAMPLES = scenes.FOLDER / "examples"
TRUTH = {"conductivity": 1.9, "h_factor": 0.8, "absorptance": 0.7}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Readings of the terrain from a balance with the truths, and a problem with other guesses."""
    path = tmp_path_factory.mktemp("calibration")
    models3d.export(models3d.read(EXAMPLES / "box.obj"), path / "box")
    tree = tomllib.loads((EXAMPLES / "heat.toml").read_text())
    del tree["signature"], tree["sigma"]
    tree["target"]["scene"] = str(path / "box" / "scene.xml")
    tree["weather"]["file"] = str(EXAMPLES / "day.csv")
    tree["run"] = {"steps": 24, "rays": 1024}
    terrain = tree["groups"]["terrain"] | {"absorptance": 0.8}
    guesses = tree | {"groups": tree["groups"] | {"terrain": terrain}}
    truths = tree | {"groups": tree["groups"] | {"terrain": terrain | TRUTH}}
    heat = mi_lcair.heat(truths | {"sigma": {}})
    kelvin = heat.by_group()["terrain"].value + np.random.default_rng(1).normal(0, 0.2, 24)
    rows = "".join(f"{hour},{T}\n" for hour, T in zip(heat.hours, kelvin))
    (path / "measured.csv").write_text(f"hour,terrain\n{rows}")
    tables = {k: v for k, v in guesses.items() if k != "groups"}
    tables |= {f"groups.{name}": table for name, table in guesses["groups"].items()}
    tables["sigma"] = {"model_K": 0}
    (path / "heat.toml").write_text(text_of(tables))
    return path


def problem(path, *unknowns, **heat):
    """A problem of some unknowns of the terrain."""
    tables = {"file": str(path / "heat.toml"), "measured": str(path / "measured.csv")}
    tables |= {"sigma_K": 0.2} | heat
    return {"heat": tables, "unknowns": {f"terrain.{key}": {} for key in unknowns}}


def test_truths_are_found_and_written(folder, tmp_path):
    """Within 3 standard errors; a balance with the written file fits as well as was said."""
    found = mi_lcair.invert(problem(folder, "conductivity", "h", "absorptance"))
    assert found.rms_before_K > 1 and found.rms_K < 0.3 and found.p_value > 0.01
    for value, error, truth in zip(found.value, found.standard_error, TRUTH.values()):
        assert abs(value - truth) < 3 * error
    assert found.verdicts[0] == "determined"
    left, right = found.plot().axes
    np.testing.assert_allclose(left.lines[0].get_ydata(), found.predicted)
    np.testing.assert_allclose(left.lines[1].get_ydata(), found.measured)
    np.testing.assert_allclose(right.lines[0].get_ydata(), found.measured - found.predicted)
    found.save(tmp_path / "calibrated.toml")
    heat = mi_lcair.heat(tmp_path / "calibrated.toml")
    apart = heat.by_group()["terrain"].value - found.predicted
    assert abs(apart).max() < 0.2  # other inputs moved within their uncertainties
    stated = {row.quantity: row.sigma for row in heat.inputs}["terrain.conductivity and others"]
    relative = found.standard_error[0] / found.value[0]
    assert float(stated.removesuffix("%")) == pytest.approx(100 * relative, rel=5e-3)
    half = 1.96 * relative  # of a factor, in logarithms
    for ratio in (found.upper[0] / found.value[0], found.value[0] / found.lower[0]):
        assert np.log(ratio) == pytest.approx(half, rel=0.3)
    found.save(tmp_path / "found.json")
    assert "terrain.conductivity" in (tmp_path / "found.json").read_text()


def test_a_first_guess_is_no_prior(folder):
    """Another start gives the same value, and the prior draws it."""
    found = []
    for start in (0.5, 1.0, 3.0):
        stated = problem(folder, "conductivity")
        stated["unknowns"]["terrain.conductivity"] = {"start": start, "prior": [1.5, 0.05]}
        found.append(mi_lcair.invert(stated).value[0])
    assert found == pytest.approx([found[1]] * 3, rel=5e-3)


def test_errors_do_not_depend_on_the_first_guess(folder, tmp_path):
    """What other inputs contribute is that at the values which were found."""
    file = tmp_path / "heat.toml"
    tables = tomllib.loads((folder / "heat.toml").read_text())
    tables["sigma"] |= {"terrain": {"heat_capacity": "20 %"}}
    groups = {f"groups.{name}": table for name, table in tables.pop("groups").items()}
    file.write_text(text_of(tables | groups))
    errors = []
    for start in (0.3, 1.9):
        stated = problem(folder, "conductivity", file=str(file))
        stated["unknowns"]["terrain.conductivity"] = {"start": start, "prior": [1.9, 2.0]}
        errors.append(mi_lcair.invert(stated).standard_error[0])
    assert errors[0] == pytest.approx(errors[1], rel=0.01) and errors[1] > 0.15 * 1.9


def test_a_series_that_does_not_fit_is_told(folder, tmp_path):
    """Absorptance alone cannot explain it; nor is the error that all groups share counted twice."""
    tables = tomllib.loads((folder / "heat.toml").read_text())
    tables["sigma"] |= {"air_K": 0.1}  # all else is right
    groups = {f"groups.{name}": table for name, table in tables.pop("groups").items()}
    (tmp_path / "heat.toml").write_text(text_of(tables | groups))
    found = mi_lcair.invert(problem(folder, "absorptance", file=str(tmp_path / "heat.toml")))
    assert any("the balance does not fit this series" in line for line in found.remarks)
    assert "the model misses something" in found.verdicts[0]
    remarks = mi_lcair.invert(problem(folder, "conductivity", "h")).remarks
    assert not any("does not fit" in line for line in remarks)


def test_thick_ground_gives_only_its_inertia(folder):
    found = mi_lcair.invert(problem(folder, "conductivity", "density"))
    assert found.correlation[0, 1] < -0.8
    assert found.alike == [
        "more terrain.conductivity is compensated by less terrain.density "
        "(terrain.conductivity +10 %, terrain.density -10 %)"
    ]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"unknowns": {}}, r"no \[unknowns\]"),
        ({"unknowns": {"terrain.colour": {}}}, "unknown input 'colour'"),
        ({"unknowns": {"roof.h": {}}}, "unknown group 'roof'"),
        ({"unknowns": {"terrain.wetness": {}}}, "wetness is missing; give a first guess"),
        ({"unknowns": {"terrain.h": {"start": -1.0}}}, "h = -1; must lie in 0..1000"),
        ({"data": []}, "unknown table 'data'"),
        ({"heat": {"file": "heat.toml"}}, "measured is missing"),
    ],
)
def test_bad_problems_are_refused(folder, change, message):
    with pytest.raises(InputError, match=message):
        mi_lcair.invert(problem(folder, "h") | change)


LAYERS = [
    {"material": "brick", "thickness_mm": 60.0},
    {"thickness_mm": 40.0, "conductivity": 0.04, "density": 30.0, "heat_capacity": 1400.0},
]


@pytest.fixture(scope="module")
def layered(folder, tmp_path_factory):
    """A problem of a lid of two layers, the first of which conducts more than brick."""
    path = tmp_path_factory.mktemp("layers")
    tables = tomllib.loads((folder / "heat.toml").read_text())
    tables["run"] = {"steps": 24, "rays": 256}
    truth = {"layers": [LAYERS[0] | {"conductivity": 2.5}, LAYERS[1]]}
    for name, lid in (("truth", truth), ("guess", {"layers": LAYERS})):
        groups = tables["groups"] | {"lid": lid, "self": {"temperature": 290.0}}
        tables["groups"] = {}
        named = {f"groups.{group}": table for group, table in groups.items()}
        (path / f"{name}.toml").write_text(text_of({**tables, **named}))
        tables["groups"] = groups
    heat = mi_lcair.heat(path / "truth.toml")
    kelvin = heat.by_group()["lid"].value + np.random.default_rng(2).normal(0, 0.05, 24)
    rows = "".join(f"{hour},{T}\n" for hour, T in zip(heat.hours, kelvin))
    (path / "lid.csv").write_text(f"hour,lid\n{rows}")
    tables = {"file": str(path / "guess.toml"), "measured": str(path / "lid.csv"), "sigma_K": 0.05}
    return {"heat": tables}


def test_a_layer_is_found(layered):
    """Although another conductivity means other cells."""
    wide = {"lid.conductivity[0]": {"prior": [0.77, 1.0]}}
    found = mi_lcair.invert(layered | {"unknowns": wide}, advise=False)
    assert found.verdicts == ["determined"] and found.p_value > 0.01
    assert found.lower[0] < 2.5 < found.upper[0]


def test_the_material_of_a_layer_is_its_prior(layered):
    description = HeatDescription.read(layered["heat"]["file"])
    network, _ = network_of(mi_lcair.load(description.target.scene), description)
    sigmas = [of_balance("lid", f"conductivity[{k}]", network)[2] for k in range(2)]
    assert sigmas == [relative(materials()["brick"]["conductivity"].partition("+-")[2].strip()), 1]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("lid.conductivity", r"no conductivity; the last one is conductivity\[1\]"),
        ("lid.conductivity[2]", r"the last one is conductivity\[1\]"),
        ("lid.h[0]", "unknown input with a number 'h'"),
        ("terrain.internal_by_hour[3]", "the heat.toml gives no internal_by_hour"),
        ("terrain.internal_by_hour", "the heat.toml gives no internal_by_hour"),
        ("terrain.density[0]", "the heat.toml gives no layers"),
        ("self.h", "group self has a fixed temperature, which h does not change"),
    ],
)
def test_unknowns_without_a_value_are_refused(layered, name, message):
    with pytest.raises(InputError, match=message):
        mi_lcair.invert(layered | {"unknowns": {name: {}}})


def test_hours_of_a_series_are_those_of_its_weather(folder, tmp_path):
    """From one step before the first time to the last; a day that is repeated has 24 hours."""
    text = (folder / "heat.toml").read_text()
    assert "[run]\nsteps = 24" in text
    (tmp_path / "heat.toml").write_text(text.replace("[run]\n", "[run]\nstart_K = 290.0\n"))

    def inverted(hours, folder=tmp_path):
        rows = "".join(f"{hour},290\n" for hour in hours)
        (tmp_path / "measured.csv").write_text(f"hour,terrain\n{rows}")
        file, measured = (str(path) for path in (folder / "heat.toml", tmp_path / "measured.csv"))
        return mi_lcair.invert(problem(folder, "h", file=file, measured=measured))

    found = inverted([0, 12, 23])  # which no h explains, so that it ends at its bound
    assert len(found.predicted) == 3 and 1 < found.value[0] <= 1000
    for hours in ([-0.5, 12], [12, 23.5]):
        with pytest.raises(InputError, match="leave those of the weather, 0 to 23"):
            inverted(hours)
    with pytest.raises(InputError, match="12 to 25 are not those of one day"):
        inverted([12, 25], folder)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("hour,roof\n1,280\n", "unknown group of measured"),
        ("hour,terrain\n1,20\n2,-3\n", "terrain = -3"),
        ("hour\n1\n", "no column of temperatures"),
        ("hour,facet_99\n1,280\n", "there is no facet_99"),
    ],
)
def test_bad_readings_are_refused(folder, tmp_path, text, message):
    (tmp_path / "bad.csv").write_text(text)
    with pytest.raises(InputError, match=message):
        mi_lcair.invert(problem(folder, "h", measured=str(tmp_path / "bad.csv")))
