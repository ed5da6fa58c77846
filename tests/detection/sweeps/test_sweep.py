"""Tests of sweeps: closed forms, agreement with contrasts, what is traced, files and errors."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pandas
import pytest

import mi_lcair
from mi_lcair import formats
from mi_lcair.detection.scenario import Scenario
from mi_lcair.detection.setting import Sightline, line_of
from mi_lcair.detection.sweeps.subject import Conditions, Line
from mi_lcair.detection.sweeps.sweep import rows_of
from mi_lcair.errors import InputError
from mi_lcair.physics.air.atmosphere import VACUUM
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import brightness_temperature, in_band_radiance
from mi_lcair.plugins.emission.source import Source
from mi_lcair.rendering.views import View, seen_from
from mi_lcair.signatures.trend import Trend, settings_file
from mi_lcair.signatures.view_areas import ViewAreas
from tests.detection.disc_scenario import AREA, write_disc

FAST = {"spp": 16, "resolution": 16}
AZIMUTHS, ELEVATIONS, RANGES = [0, 30, 60], [0, -20], [500, 1000, 3000]


def sweep(folder, conditions, base=None, sampling=FAST, **options):
    if not (folder / "disc.toml").exists():
        write_disc(folder)
    return mi_lcair.sweep(
        {
            "base": {"scenario": str(folder / "disc.toml"), **(base or {})},
            "conditions": conditions,
            "sampling": sampling,
        },
        **options,
    )


def grid(**values):
    return {
        "azimuth_deg": AZIMUTHS,
        "elevation_deg": ELEVATIONS,
        "range_m": RANGES,
        "band": ["MWIR", "LWIR"],
        "temperature.self": [400, 500],
        **values,
    }


def test_grid_has_the_closed_form(tmp_path):
    """A blackbody disc in vacuum: all quantities follow from its area and the two radiances."""
    made = sweep(tmp_path, grid(nei=[1e-5]), base={"detection_range": True})
    data = made.to_xarray()
    assert data["snr"].dims == (*grid(), "nei") and data["snr"].shape == (3, 2, 3, 2, 2, 1)
    assert made.views == made.traced == 12 and made.missed == 0
    for azimuth in AZIMUTHS:
        for elevation in ELEVATIONS:
            for name in ("MWIR", "LWIR"):
                for kelvin in (400, 500):
                    row = data.sel(
                        azimuth_deg=azimuth, elevation_deg=elevation, band=name, range_m=1000,
                        nei=1e-5, **{"temperature.self": kelvin},
                    )  # fmt: skip
                    check_row(row, azimuth, elevation, name, kelvin)
    near = data.sel(range_m=500)
    for term in ("contrast_W_m2", "background_W_m2", "snr", "contrast_half_width_W_m2"):
        assert near[term].values == pytest.approx(36 * data.sel(range_m=3000)[term].values)
    assert data["temperature.self"].attrs["units"] == "K"
    assert data["range_m"].attrs["units"] == "m"


def check_row(row, azimuth, elevation, name, kelvin):
    size = AREA * np.cos(np.radians(azimuth)) * np.cos(np.radians(elevation))
    radiance, behind = in_band_radiance(band(name), np.array([kelvin, 294.0]))
    exact = {
        "projected_area_m2": size,
        "intensity_W_sr": size * radiance,
        "target_W_m2": size * radiance / 1e6,
        "background_W_m2": size * behind / 1e6,
        "contrast_W_m2": size * (radiance - behind) / 1e6,
        "snr": size * (radiance - behind) / 1e6 / 1e-5,
        "nei_ratio": size * (radiance - behind) / 1e6 / 1e-4,
        "nei_max_W_m2": size * (radiance - behind) / 1e7,
        "detection_range_m": np.sqrt(size * (radiance - behind) / 1e-4),
    }
    for quantity, value in exact.items():
        assert float(row[quantity]) == pytest.approx(value, rel=0.04)
    for quantity in ("intensity", "target", "contrast"):
        end = "W_sr" if quantity == "intensity" else "W_m2"
        error = abs(float(row[f"{quantity}_{end}"]) - exact[f"{quantity}_{end}"])
        assert error < 2.5 * float(row[f"{quantity}_half_width_{end}"])
    assert float(row.path_W_m2) == 0 and float(row.reached) == 1
    # All of the target has one temperature, whatever its area is
    assert float(row.apparent_temperature_K) == pytest.approx(kelvin, abs=0.01)
    assert float(row.apparent_temperature_standard_error_K) < 0.05


def test_rows_are_contrasts(tmp_path):
    """Clear air, ground behind, a sun that the air scatters: `contrast` gives the same numbers."""
    write_disc(tmp_path)
    changes = {
        "background.daytime_sky": "midlat_summer",
        "background.ground_temperature": 290,
        "background.sun_azimuth_deg": 40,
        "sensor.nei": 1e-7,
        "sensor.optics_transmittance": 0.8,
        "target.height_m": 50,
    }
    made = sweep(
        tmp_path,
        {
            **{name: [value] for name, value in changes.items()},
            "azimuth_deg": [40],
            "elevation_deg": [-3, 10],
            "air": [VACUUM, "midlat_summer", "us_standard"],
            "range_m": [700],
        },
        base={"detection_range": True},
    )
    columns = made.columns()
    assert made.views == 2
    for k in range(made.conditions.count):
        entry = {
            "observer.azimuth_deg": float(columns["azimuth_deg"][k]),
            "observer.elevation_deg": float(columns["elevation_deg"][k]),
            "atmosphere.table": str(columns["air"][k]),
            "observer.range_m": 700,
            "render.spp": 2,
            **changes,
        }
        result = mi_lcair.contrast(str(tmp_path / "disc.toml"), parameters=entry)
        row, (detection,) = result.rows[-1], result.detection_ranges()
        for name, value in {
            "intensity_W_sr": row.intensity,
            "target_W_m2": row.target,
            "path_W_m2": row.path,
            "background_W_m2": row.background,
            "contrast_W_m2": row.total,
            "nei_max_W_m2": row.nei_max,
        }.items():
            assert columns[name][k] == pytest.approx(value.value, rel=0.02)
        assert columns["snr"][k] == pytest.approx(10 * row.nei_max.value / 1e-7, rel=0.02)
        if detection.at_least:
            assert columns["detection_range_m"][k] == detection.largest_m
        else:
            assert columns["detection_range_m"][k] == pytest.approx(detection.largest_m, rel=0.02)


def test_only_new_geometry_is_traced(tmp_path):
    """Ranges, airs, temperatures and noise need no paths; a new aspect or band does."""
    folder = tmp_path / "areas"
    first = sweep(tmp_path, {"azimuth_deg": AZIMUTHS}, areas=folder)
    again = sweep(tmp_path, {"azimuth_deg": AZIMUTHS}, areas=folder)
    assert first.traced == 3 and again.traced == 0
    assert all(np.array_equal(first.table[name], again.table[name]) for name in first.table)
    others = {"azimuth_deg": AZIMUTHS, "range_m": RANGES, "air": [VACUUM, "us_standard"]}
    other = sweep(tmp_path, others | {"temperature.self": [300, 350], "nei": [1e-6]}, areas=folder)
    assert other.traced == 0 and other.conditions.count == 36
    assert sweep(tmp_path, {"azimuth_deg": [1, *AZIMUTHS]}, areas=folder).traced == 4
    assert sweep(tmp_path, {"azimuth_deg": AZIMUTHS, "band": ["LWIR"]}, areas=folder).traced == 3
    paths = list(folder.iterdir())
    contents = [path.read_bytes() for path in paths]
    for path, content in zip(paths, contents[1:] + contents[:1]):  # the file of another batch
        path.write_bytes(content)
    with pytest.warns(UserWarning, match="does not match its checksum"):
        repaired = sweep(tmp_path, {"azimuth_deg": AZIMUTHS}, areas=folder)
    assert repaired.traced == 3
    assert all(np.array_equal(first.table[name], repaired.table[name]) for name in first.table)


def test_a_file_that_changes_is_read_again(tmp_path):
    """The fingerprint of a scene covers its files: nothing of the old scene is used."""
    folder, scene = tmp_path / "areas", tmp_path / "disc.xml"
    cold = sweep(tmp_path, {"azimuth_deg": [0]}, areas=folder)
    scene.write_text(scene.read_text().replace('value="400"', 'value="500"'))
    hot = sweep(tmp_path, {"azimuth_deg": [0]}, areas=folder)
    ratio = in_band_radiance(band("MWIR"), 500) / in_band_radiance(band("MWIR"), 400)
    assert hot.traced == 1
    expected = ratio * cold.table["intensity_W_sr"]
    assert hot.table["intensity_W_sr"] == pytest.approx(expected, rel=0.02)


def test_subjects_share_their_random_numbers(tmp_path):
    """What differs between conditions is no noise: the same disc with and without reflections."""
    made = sweep(tmp_path, {"render.max_bounces": [0, 1], "azimuth_deg": [0, 30]})
    first, second = made.to_xarray()["intensity_W_sr"].values
    assert made.traced == 4 and first == pytest.approx(second, rel=1e-6)
    other = sweep(tmp_path, {"azimuth_deg": [0, 30]}, sampling=FAST | {"seed": 1})
    assert np.any(np.abs(other.table["intensity_W_sr"] / first - 1) > 1e-5)


def test_points_of_a_table(tmp_path):
    """Without product the conditions go together; a CSV gives the points."""
    (tmp_path / "points.csv").write_text("azimuth,range\n0,500\n60,1000\n0,1000\n")
    write_disc(tmp_path)
    (tmp_path / "sweep.toml").write_text(
        '[base]\nscenario = "disc.toml"\nproduct = false\n[conditions]\n'
        'azimuth_deg = {csv = "points.csv", column = "azimuth"}\n'
        'observer.range_m = {csv = "points.csv", column = "range"}\n'
        "[sampling]\nspp = 16\nresolution = 16\n"
    )
    made = mi_lcair.sweep(tmp_path / "sweep.toml")
    target = made.table["target_W_m2"]
    assert made.views == 2 and made.to_xarray().sizes == {"case": 3}
    assert target / target[2] == pytest.approx([4, 0.5, 1], rel=0.02)
    assert made.table["intensity_W_sr"][0] == made.table["intensity_W_sr"][2]


def test_scene_without_a_sensor(tmp_path):
    """A scene: intensities over aspects, $-parameters and temperatures of groups."""
    write_disc(tmp_path)
    made = mi_lcair.sweep(
        {
            "base": {"scene": str(tmp_path / "disc.xml")},
            "conditions": {
                "azimuth_deg": {"from": 0, "to": 60, "step": 30},
                "temperature": [400, 450],
                "temperature.self": [400, 450],
            },
            "sampling": FAST,
        }
    )
    data = made.to_xarray()
    assert made.views == 6 and "contrast_W_m2" not in data
    radiance = in_band_radiance(band("MWIR"), np.array([400, 450]))
    exact = AREA * np.outer(np.cos(np.radians([0, 30, 60])), radiance)
    for temperature in (400, 450):  # the group's temperature replaces that of the parameter
        values = data["intensity_W_sr"].sel(temperature=temperature).values
        assert values == pytest.approx(exact, rel=0.03)


def test_runs_and_lists():
    read = Conditions.read(
        {
            "base": {"scene": "cavity"},
            "conditions": {"azimuth_deg": {"from": 10, "to": 0, "step": -2.5}, "lobe": "mirror"},
        }
    )
    assert read.values == {"azimuth_deg": [10, 7.5, 5, 2.5, 0], "lobe": ["mirror"]}
    assert read.shape == (5, 1) and read.sampling.tolerance == "1%"


BAD = [
    ({"base": {}}, "scene and scenario are missing; give one of them"),
    ({"base": {"scene": "cavity", "scenario": "x"}}, "has scene and scenario; give one"),
    ({"conditions": {}}, "is missing"),
    ({"conditions": {"azimuth_deg": []}}, "no values"),
    ({"conditions": {"azimuth_deg": [1, 1]}}, "twice"),
    ({"conditions": {"azimuth_deg": [[1]]}}, "texts or numbers"),
    ({"conditions": {"azimuth_deg": ["left"]}}, "must be a finite number"),
    ({"conditions": {"azimuth_deg": [1], "observer.azimuth_deg": [2]}}, "given twice"),
    ({"conditions": {"range_m": {"from": 0, "to": 1, "step": -1}}}, "step must lead"),
    ({"conditions": {"range_m": {"from": 0, "to": 1}}}, "give a list"),
    ({"conditions": {"range_m": {"from": 0, "to": 1e9, "step": 1}}}, "at most"),
    ({"conditions": {"range_m": {"from": -1e308, "to": 1e308, "step": 1}}}, "has inf values"),
    ({"conditions": {"range_m": list(range(5000)), "nei": list(range(5000))}}, "GB"),
    ({"conditions": {"camera.f_number": [2]}}, "belongs to the camera"),
    ({"conditions": {"temperature.wing": [300]}}, "blackbody group"),
    ({"conditions": {"temperature.self": ["hot"]}}, "must be a number"),
    ({"conditions": {"temperature.self": [1e9]}}, "at most 100000"),
    ({"conditions": {"range_m": [1]}}, "inside the target"),
    ({"conditions": {"air": ["fog"]}}, "fog"),
    ({"conditions": {"target.parameters.colour": ["red"]}}, "colour"),
    ({"weather": {}}, "weather"),
    ({"sampling": {"spp": 4, "tolerance": 0.1}}, "cannot be combined with it"),
    ({"sampling": {"seeds": 4}}, "seeds"),
]


@pytest.mark.parametrize(("change", "message"), BAD)
def test_bad_input(tmp_path, change, message):
    """One line, before anything is traced or written."""
    write_disc(tmp_path)
    tables = {
        "base": {"scenario": str(tmp_path / "disc.toml")},
        "conditions": {"azimuth_deg": [0]},
        "sampling": FAST,
    }
    with pytest.raises(InputError, match=message) as caught:
        mi_lcair.sweep(tables | change, areas=tmp_path / "areas")
    assert "\n" not in str(caught.value) and not (tmp_path / "areas").exists()


@pytest.mark.slow
def test_processes_give_the_same_bytes(tmp_path):
    write_disc(tmp_path)
    conditions = {"azimuth_deg": {"from": 0, "to": 350, "step": 5}, "range_m": RANGES}
    for name, count in {"one": None, "two": 2}.items():
        with mi_lcair.workers(count):
            made = sweep(tmp_path, conditions, areas=tmp_path / "areas")
        made.save(tmp_path / f"{name}.nc")
        shutil.rmtree(tmp_path / "areas")
    one, two = (formats.read(tmp_path / f"{name}.nc") for name in ("one", "two"))
    for name in one.variables:  # to say which of them differs
        np.testing.assert_array_equal(one[name].values, two[name].values, err_msg=name)
    assert (tmp_path / "one.nc").read_bytes() == (tmp_path / "two.nc").read_bytes()
    assert set(formats.read(tmp_path / "one.nc").sizes) == {"azimuth_deg", "range_m"}


# Tests of trends: rows against signatures, files, and what is traced again
# -------------------------------------------------------------------------

TREND_AZIMUTHS = np.arange(0, 360, 45.0)


@pytest.fixture(scope="module")
def cylinder():
    return mi_lcair.load("cylinder_ir_range", finish="gloss_black", max_bounces=2)


def trend(scene, **changes):
    return mi_lcair.trend(
        scene, **{"azimuths_deg": TREND_AZIMUTHS, "resolution": 16, "spp": 4, **changes}
    )


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:in 8 of 16 views terrain")  # the floor, from below
def test_rows_are_signatures(cylinder):
    """Each row agrees with a signature of its view, by group and by bounce."""
    columns = trend(cylinder, elevations_deg=(-10, 20), tolerance=0.01, spp=None).table
    assert len(columns["azimuth_deg"]) == 16 and columns["reached"].all()
    for k in (3, 12):
        view = View(columns["azimuth_deg"][k], columns["elevation_deg"][k])
        alone = mi_lcair.signature(seen_from(cylinder, view, 64), spp=16, seed=7, by_spectrum=True)
        error = np.hypot(columns["standard_error_W_sr"][k], alone.target.standard_error)
        assert abs(columns["intensity_W_sr"][k] - alone.target.intensity) < 4 * error
        assert columns["projected_area_m2"][k] == pytest.approx(
            alone.effective_areas.projected_area, rel=0.03
        )
        for label, value in alone.target.by_group.items():
            assert columns[f"group.{label}_W_sr"][k] == pytest.approx(value, rel=0.05)
        assert columns["bounce.0_W_sr"][k] == pytest.approx(alone.target.by_bounce[0], rel=0.05)
    for kind in ("group", "bounce"):
        parts = sum(values for name, values in columns.items() if name.startswith(kind))
        assert parts == pytest.approx(columns["intensity_W_sr"], rel=1e-5)


def test_both_sides_are_alike(cylinder):
    """The model and its room are symmetric, and so is the trend."""
    columns = trend(cylinder, azimuths_deg=[60, 300, 120, 240], resolution=64).table
    left, right = columns["intensity_W_sr"][::2], columns["intensity_W_sr"][1::2]
    assert np.abs(left - right).max() < 5 * columns["standard_error_W_sr"].max()


def test_views_that_are_equal(cylinder):
    """A full turn more is the same view. It has a row of its own."""
    columns = trend(cylinder, azimuths_deg=[30, 390, 120], resolution=64).table
    intensity, error = columns["intensity_W_sr"], columns["standard_error_W_sr"]
    (alone,) = trend(cylinder, azimuths_deg=[30], resolution=64).table["intensity_W_sr"]
    assert np.abs(intensity[:2] - alone).max() < 5 * error.max()


class Stopped(Exception):
    pass


def test_what_was_interrupted_goes_on(cylinder, tmp_path, monkeypatch):
    """Batches that a folder holds are not traced again, and the rows are the same to the bit."""
    monkeypatch.setattr("mi_lcair.detection.sweeps.subject.VIEWS_AT_ONCE", 3)
    # Angles without a finite decimal form are found again
    views = {"azimuths_deg": [0, 0.1 + 0.2, 100, 200 + 1 / 3], "elevations_deg": [0, -1 / 7]}
    whole, done = trend(cylinder, **views), []

    def stop(views, of):
        done.append((views, of))
        if len(done) == 2:
            raise Stopped

    with pytest.raises(Stopped):
        trend(cylinder, areas=tmp_path / "areas", progress=stop, **views)
    resumed = trend(cylinder, areas=tmp_path / "areas", progress=lambda *n: done.append(n), **views)
    assert [of for _, of in done] == [8] * 3 and done[2][0] == 8
    assert list(resumed.table) == list(whole.table)
    for name, values in whole.table.items():
        np.testing.assert_array_equal(resumed.table[name], values, err_msg=name)
    for changes in ({"seed": 1}, {"spp": 8}, {"resolution": 8}, {"max_bounces": 1}):
        calls = []
        trend(
            cylinder,
            areas=tmp_path / "areas",
            progress=lambda *n, calls=calls: calls.append(n),
            **(views | changes),
        )
        assert calls


def test_reflections_are_chosen_for_the_views():
    plates = mi_lcair.load("two_plates", resolution=8)
    views = {"azimuths_deg": [45, 90], "elevations_deg": [60], "resolution": 8, "spp": 4}
    automatic = mi_lcair.trend(plates, **views, max_bounces="auto")
    by_hand = mi_lcair.trend(plates, **views, max_bounces=1)
    np.testing.assert_allclose(automatic.table["intensity_W_sr"], by_hand.table["intensity_W_sr"])
    more = mi_lcair.trend(plates, **views, max_bounces=2)
    assert automatic.made["fingerprint"] != more.made["fingerprint"]


def test_pandas_reads_it_without_options_or_a_path_of_this_machine(cylinder, tmp_path):
    """Plain columns, and no path of a folder in either file; `read` gives the same back."""
    path = tmp_path / "trend.csv"
    result = trend(cylinder)
    result.save(path)
    frame = pandas.read_csv(path)
    assert list(frame) == list(result.columns())
    for name, values in result.columns().items():
        np.testing.assert_allclose(frame[name], values, rtol=1e-8)
    both = path.read_text() + settings_file(path).read_text()
    assert str(tmp_path) not in both and "/" not in both.replace("W/sr", "")
    made = json.loads(settings_file(path).read_text())["made"]
    assert (made["scene"], made["samples"]) == ("cylinder_ir_range", "spp 4 over each view")
    again = Trend.read(path)
    assert (again.scene_name, again.band) == (result.scene_name, result.band)


@pytest.mark.parametrize("made", ["", "[1]", '{"made": 1}', "[" * 100_000, "\x89PNG\x00"])
def test_a_file_beside_it_of_another_kind(tmp_path, made):
    path = tmp_path / "trend.csv"
    path.write_text("azimuth_deg,elevation_deg,intensity_W_sr\n0,0,1\n")
    settings_file(path).write_bytes(made.encode("latin-1"))
    with pytest.raises(
        InputError, match="trend.csv.json: (does not say how|Expecting|nested|not a)"
    ):
        Trend.read(path)


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"azimuths_deg": []}, "needs views"),
        ({"azimuths_deg": [10, 10]}, "twice"),
        ({"resolution": 10**5}, "resolution = 100000; must lie in"),
        ({"max_spp": 4}, "cannot be combined with it"),
        ({"elevations_deg": [100]}, "-90..90"),
        ({"tolerance": 0.1}, "cannot be combined with it"),
    ],
)
def test_bad_input_of_trend(cylinder, changes, message):
    with pytest.raises(InputError, match=message):
        trend(cylinder, **changes)


def test_plot(cylinder, figures, tmp_path):
    result = trend(cylinder, elevations_deg=(0, 30))
    result.plot(tmp_path / "trend.png")
    by_elevation, by_group, by_bounce = figures[0].axes
    azimuth, values = by_elevation.lines[1].get_data()
    # The curve of all azimuths is closed.
    assert np.degrees(azimuth) == pytest.approx(np.arange(0, 361, 45)) and values[0] == values[-1]
    assert values[:-1] == pytest.approx(result.at_elevation(30).table["intensity_W_sr"])
    assert [line.get_label() for line in by_group.lines] == ["self", "walls"] and len(
        by_bounce.lines
    ) >= 2


# Tests of a sweep's quantities and their errors, from effective areas that were made up
# --------------------------------------------------------------------------------------

MWIR = band("MWIR")
SOURCES = [
    Source(group, f"{T} K", float(in_band_radiance(MWIR, T)), float(T))
    for group, T in (("skin", 300), ("plume", 500), ("wing", 310))
]
AMOUNTS = np.array([[80.0, 1.0, 20.0, 130.0]])  # m^2; the last one is the projected area
DEVIATIONS = np.random.default_rng(3).normal(0, 1, (1, 8, 4)) * [0.4, 0.01, 0.2, 0.5]
NONE = np.zeros(1)


def areas_of(amounts=AMOUNTS, deviations=DEVIATIONS, relative=NONE, missed=NONE):
    count = len(amounts)
    return ViewAreas(
        scene_name="made up",
        band=MWIR,
        sources=SOURCES,
        nodes_um=np.empty(0),
        views=(View(0.0),) * count,
        amounts=amounts,
        deviations=np.broadcast_to(deviations, (count, 8, 4)),
        relative=np.broadcast_to(relative, count),
        missed=np.broadcast_to(missed, count),
        paths=np.ones(count),
        reached=np.ones(count),
    )


def line(folder, air="us_standard"):
    write_disc(folder)
    changes = {"atmosphere.table": air, "sensor.nei": 1e-6, "sensor.optics_transmittance": 0.5}
    scenario = Scenario.read(folder / "disc.toml", **changes)
    detector = scenario.sensor.detector()
    sight, path, behind = line_of(scenario, detector, None)
    return Line(
        np.arange(1), (), None, None, {}, Sightline(detector, sight, path, behind, 2.0, None, "")
    )


@pytest.mark.parametrize("air", ["vacuum", "us_standard"])
def test_errors_are_those_of_many_draws(tmp_path, air):
    """Amounts drawn with the covariance of the deviations scatter by the stated errors."""
    sight, count = line(tmp_path, air), 20_000
    stated = rows_of(sight, areas_of())
    draws = np.random.default_rng(0).standard_normal((count, 8)) @ DEVIATIONS[0]
    drawn = rows_of(sight, areas_of(AMOUNTS + draws))
    assert stated["projected_area_m2"] == pytest.approx(130)
    for name in ("intensity", "target", "contrast", "nei_max", "snr", "apparent_temperature"):
        end = next(key.removeprefix(name) for key in stated if key.startswith(name))
        error = stated[f"{name}_standard_error{end}"][0]
        assert np.std(drawn[f"{name}{end}"]) == pytest.approx(error, rel=0.03)
        if f"{name}_half_width{end}" in stated:  # Student's factor for 7 degrees of freedom
            half_width = stated[f"{name}_half_width{end}"][0]
            assert half_width == pytest.approx(2.3646 * error, rel=1e-4)


def test_values(tmp_path):
    """In vacuum all follows from the radiances of the sources."""
    rows = {
        name: values[0] for name, values in rows_of(line(tmp_path, "vacuum"), areas_of()).items()
    }
    radiances = np.array([source.in_band for source in SOURCES])
    intensity = AMOUNTS[0, :3] @ radiances
    contrast = (intensity - 130 * in_band_radiance(MWIR, 294)) / 1e6
    assert rows["intensity_W_sr"] == pytest.approx(intensity, rel=1e-6)
    assert rows["contrast_W_m2"] == pytest.approx(contrast, rel=1e-6)
    assert rows["snr"] == pytest.approx(0.5 * contrast / 1e-6, rel=1e-6)
    assert rows["nei_max_W_m2"] == pytest.approx(0.5 * contrast / 10, rel=1e-6)
    assert rows["nei_ratio"] == pytest.approx(0.5 * contrast / 10 / 1e-6, rel=1e-6)
    apparent = brightness_temperature(MWIR, intensity / 130)
    assert rows["apparent_temperature_K"] == pytest.approx(apparent, rel=1e-6)


def test_what_deviations_do_not_show(tmp_path):
    """A relative error is one of the target's radiation; what was missed widens the intervals."""
    sight, still = line(tmp_path, "vacuum"), np.zeros((1, 8, 4))
    rows = rows_of(sight, areas_of(deviations=still, relative=np.array([0.01])))
    for name, target in (("intensity", "W_sr"), ("target", "W_m2")):
        value, error = rows[f"{name}_{target}"], rows[f"{name}_standard_error_{target}"]
        assert error == pytest.approx(0.01 * value)
        assert rows[f"{name}_half_width_{target}"] == pytest.approx(1.96 * error, rel=1e-4)
    assert rows["contrast_standard_error_W_m2"] == pytest.approx(0.01 * rows["target_W_m2"])
    brighter = rows_of(sight, areas_of(AMOUNTS * [1.01, 1.01, 1.01, 1]))["apparent_temperature_K"]
    rise = brighter - rows["apparent_temperature_K"]
    assert rows["apparent_temperature_standard_error_K"] == pytest.approx(rise, rel=0.01)
    rows = rows_of(sight, areas_of(deviations=still, missed=np.array([5.0])))
    assert rows["intensity_half_width_W_sr"] == pytest.approx(5)
    assert rows["contrast_half_width_W_m2"] == pytest.approx(5e-6)
    assert rows["target_half_width_W_m2"] == pytest.approx(5e-6)
    assert rows["snr_half_width"] == pytest.approx(2.5)


def test_a_view_without_a_target_has_no_temperature(tmp_path):
    amounts = np.array([[0, 0, 0, 0], [0, 0, 0, 1e-3], [0, 0, 1e-3, 1e-3]])
    rows = rows_of(line(tmp_path, "vacuum"), areas_of(amounts, DEVIATIONS * 0))
    assert np.isnan(rows["apparent_temperature_K"][0]) and rows["contrast_W_m2"][0] == 0
    assert rows["apparent_temperature_K"][1:] == pytest.approx([0, 310])


def test_other_temperatures_are_other_sources(tmp_path):
    """A sweep's temperature gives the rows of areas whose source has it."""
    sight = line(tmp_path)
    hot = replace(SOURCES[1], temperature=600.0, in_band=float(in_band_radiance(MWIR, 600)))
    changed = replace(areas_of(), sources=[SOURCES[0], hot, SOURCES[2]])
    expected = rows_of(sight, changed)
    rows = rows_of(replace(sight, temperatures={"plume": 600.0}), areas_of())
    for name, values in expected.items():
        assert rows[name] == pytest.approx(values, rel=1e-9)


def test_what_was_missed_follows_the_brightest_source():
    areas = areas_of(deviations=np.zeros((1, 8, 4)), missed=np.array([5.0]))
    ratio = in_band_radiance(MWIR, 600) / in_band_radiance(MWIR, 500)
    hot = areas.at_temperatures({"plume": 600.0}).intensity()
    assert hot.half_width == pytest.approx(5 * ratio)
    assert areas.intensity({"plume": 600.0}).half_width == pytest.approx(5 * ratio)
    assert areas.intensity({"skin": 305.0}).half_width == pytest.approx(5)
