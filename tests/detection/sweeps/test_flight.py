"""Tests of flights: a plate that passes, the thesis's positions, histories and bad input."""

from dataclasses import replace

import numpy as np
import pytest

import mi_lcair
from mi_lcair.detection.scenario import Scenario
from mi_lcair.detection.sweeps import flight as flights
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from tests.detection.disc_scenario import AREA, write_disc

COLUMNS = "time_s,x_m,y_m,z_m,yaw_deg,pitch_deg,roll_deg"
PATH = "0,-3000,0,90,0,0,0\n60,-300,0,90,0,0,0\n"


def flyby(folder, path=PATH, columns=COLUMNS, **entries) -> Scenario:
    """The disc, which faces +x, on a path past an observer at (0, 400, 10)."""
    text = write_disc(folder).read_text()
    start, end = text.index("[observer]"), text.index("[atmosphere]")
    (folder / "path.csv").write_text(f"{columns}\n{path}")
    table = '[flight]\npath = "path.csv"\nrate_hz = 2\nobserver_m = [0, 400, 10]\n'
    (folder / "flyby.toml").write_text(text[:start] + table + text[end:])
    changes = {"render.spp": 16, "render.resolution": 16, "sensor.nei": 1e-6, **entries}
    return Scenario.read(folder / "flyby.toml", **changes)


def exact_contrast(table, kelvin=np.array(400.0)):
    """Contrast of the disc in vacuum before 294 K, W/m^2, from its positions."""
    along = np.column_stack([-table["x_m"], 400 - table["y_m"], 10 - table["z_m"]])
    range_m = np.linalg.norm(along, axis=1)
    radiance, behind = in_band_radiance(band("MWIR"), [kelvin, np.full_like(kelvin, 294.0)])
    return AREA * along[:, 0] / range_m**3 * (radiance - behind)


def test_disc_that_passes_has_the_closed_form(tmp_path):
    """Contrast of all moments, within the stated errors and the tolerance."""
    made = mi_lcair.flight(flyby(tmp_path, **{"flight.tolerance": 0.002, "render.spp": 256}))
    table, exact = made.table, exact_contrast(made.table)
    assert len(table["time_s"]) == 121 and 3 <= made.views < 40
    assert table["contrast_W_m2"] == pytest.approx(exact, rel=0.003)
    off = np.abs(table["contrast_W_m2"] - exact)
    # The intervals of 95 % may miss a moment of the 121
    assert np.mean(off <= table["contrast_half_width_W_m2"] + 2e-5 * exact) > 0.95
    assert table["snr"] == pytest.approx(table["contrast_W_m2"] / 1e-6)
    assert made.plot().axes[1].get_ylabel() == "signal-to-noise ratio"
    assert made.picture().title.endswith(", MWIR 3-5 um")
    is_traced = table["traced"] > 0
    assert np.all(table["interpolation_error_W_m2"][is_traced] == 0)
    assert is_traced.sum() == made.views
    # The first moment at which the exact contrast is ten times the noise
    first, earliest, latest = made.detections_s
    detected = table["time_s"][np.flatnonzero(exact >= made.scenario.sensor.snr * 1e-6)[0]]
    assert earliest <= detected <= latest and abs(first - detected) <= 0.5


def test_coarse_interpolation_states_its_error(tmp_path, monkeypatch):
    """Between aspects that are far apart the stated interval is wide enough, and not too wide."""
    monkeypatch.setattr(flights, "STEP_DEG", 90.0)
    made = mi_lcair.flight(flyby(tmp_path, **{"flight.tolerance": 1, "render.spp": 256}))
    off = np.abs(made.table["contrast_W_m2"] - exact_contrast(made.table))
    assert made.views == 3 and made.interpolation_error > 0.01
    assert np.all(off <= made.table["contrast_half_width_W_m2"] + 2e-8)
    assert made.table["interpolation_error_W_m2"].max() < 8 * off.max()
    dark = {"target_W_m2": np.zeros(3), "interpolation_error_W_m2": np.zeros(3)}
    assert replace(made, table=dark).interpolation_error == 0


def test_history_of_temperature_follows_planck(tmp_path):
    made = mi_lcair.flight(
        flyby(
            tmp_path,
            path="0,-900,0,90,0,0,0,350\n4,-900,0,90,0,0,0,450\n",
            columns=f"{COLUMNS},temperature.self",
        )
    )
    kelvin = 350 + 25 * made.table["time_s"]
    assert made.views == 2  # the ends of the path, of the same aspect
    assert made.table["contrast_W_m2"] == pytest.approx(
        exact_contrast(made.table, kelvin), rel=3e-3
    )


def test_observer_may_move_and_the_path_turn_whole_circles(tmp_path):
    """Where both move alike the contrast stays, and angles turn the short way."""
    columns = f"{COLUMNS},observer_x_m,observer_y_m,observer_z_m"
    scenario = flyby(
        tmp_path,
        path="0,0,0,90,0,0,0,900,0,90\n9,500,50,190,0,0,0,1400,50,190\n",
        columns=columns,
    )
    table = mi_lcair.flight(scenario).table
    assert np.ptp(table["contrast_W_m2"]) < 1e-6 * table["contrast_W_m2"].mean()
    turning = flyby(tmp_path, path="0,0,0,90,350,0,0\n2,100,0,90,10,0,0\n").flight.moments()
    assert turning.attitude_deg[2, 0] == pytest.approx(360)
    assert turning.turned_deg[-1] > 20


@pytest.mark.parametrize("number, time_s", [(3, 0.0), (2, 20.0), (1, 40.0)])
def test_positions_of_the_thesis_lie_on_the_approach(number, time_s):
    """The bundled flight has the scenarios of the three positions as its moments."""
    approach = Scenario.read("a340_landing/approach")
    moments = approach.flight.moments()
    k = int(np.argmin(np.abs(moments.time_s - 90 - time_s)))
    moment = approach.at_moment(moments, k)
    position = Scenario.read(f"a340_landing/position_{number}")
    for name in ("range_m", "azimuth_deg", "elevation_deg"):
        assert getattr(moment.observer, name) == pytest.approx(
            getattr(position.observer, name), rel=1e-6
        )
    assert moment.pose == position.pose
    lower_m = moment.target.height_m + min(0, moment.observer.position_m[2])
    assert lower_m == pytest.approx(50)  # of the air, as in the scenarios of the positions


@pytest.mark.slow
def test_contrast_of_the_approach_is_that_of_a_position(tmp_path):
    (tmp_path / "path.csv").write_text(f"{COLUMNS}\n0,-1100,0,55,0,10,0\n2,-1000,0,50,0,10,0\n")
    changes = {"render.tolerance": 0.03, "render.max_bounces": 4}
    path = {"flight.path": str(tmp_path / "path.csv"), "flight.rate_hz": 0.5}
    with pytest.warns(UserWarning, match="light of sky .* transmittances are multiplied"):
        flight = mi_lcair.flight(Scenario.read("a340_landing/approach", **changes, **path)).table
    row = mi_lcair.contrast("a340_landing/position_1", parameters=changes).rows[0]
    half_width = np.hypot(flight["contrast_half_width_W_m2"][-1], row.half_width)
    assert abs(flight["contrast_W_m2"][-1] - row.total.value) < half_width
    assert flight["background_W_m2"][-1] == pytest.approx(row.background.value, rel=0.01)


@pytest.mark.parametrize(
    "path, columns, entries, message",
    [
        ("0,-900,0,-20,0,0,0\n", COLUMNS, {}, "the target is 20 m below the ground at 0 s"),
        ("0,-900,0,9,0,0,0\n5,-900,0,0.5,0,0,0\n", COLUMNS, {}, "the target is 1.5 m below"),
        (PATH, COLUMNS, {"flight.observer_m": [0, 400, -1]}, "the observer is 1 m below"),
        ("0,-900,0,9,0,0,0\n0,-800,0,9,0,0,0\n", COLUMNS, {}, "line 3: time_s must rise"),
        ("0,1,0,9,0,0,0,3\n", f"{COLUMNS},speed", {}, "unknown column of"),
        ("0,1,0,9,0,0,0,300\n", f"{COLUMNS},temperature.wing", {}, "unknown.*wing"),
        (
            "0,1,0,9,0,0,0,33\n",
            f"{COLUMNS},temperature.self",
            {},
            r"line 2: temperature.self = 33 K; must .* kelvin are Celsius \+ 273.15",
        ),
        (PATH, COLUMNS, {"flight.rate_hz": 1e9}, "moments; at most"),
        (PATH, COLUMNS, {"observer.height_m": 3}, "the path has both"),
        (PATH, COLUMNS, {"target.height_m": 3}, "height_m is that of the path"),
        ("0,0,399,10,0,0,0\n", COLUMNS, {}, "at 0 s: the observer is inside the target"),
        (PATH, COLUMNS, {"render.tolerance_W_m2": 1e-6, "render.spp": None}, "tolerance_W_m2"),
    ],
)
def test_unusable_flights_are_refused(tmp_path, path, columns, entries, message):
    entries = {name: value for name, value in entries.items() if value is not None}
    with pytest.raises(InputError, match=message):
        mi_lcair.flight(flyby(tmp_path, path, columns, **entries))


def test_scenario_without_a_flight_is_refused(tmp_path):
    with pytest.raises(InputError, match="has no table"):
        mi_lcair.flight(Scenario.read(write_disc(tmp_path)))
