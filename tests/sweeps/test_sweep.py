"""Tests of sweeps: closed forms, agreement with contrasts, what is traced, files and errors."""

import shutil

import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.formats import netcdf
from mi_lcair.physics.air.atmosphere import VACUUM
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.sweeps.conditions import Conditions
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
    ({"conditions": {"temperature.self": [1e9]}}, "at most 100000 K"),
    ({"conditions": {"range_m": [1]}}, "inside the target"),
    ({"conditions": {"air": ["fog"]}}, "fog"),
    ({"conditions": {"target.parameters.colour": ["red"]}}, "colour"),
    ({"weather": {}}, "weather"),
    ({"sampling": {"spp": 4, "tolerance": 0.1}}, "do not go with it"),
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
    conditions = {"azimuth_deg": {"from": 0, "to": 350, "step": 1}, "range_m": RANGES}
    for name, count in {"one": None, "two": 2}.items():
        with mi_lcair.workers(count):
            made = sweep(tmp_path, conditions, areas=tmp_path / "areas")
        made.save(tmp_path / f"{name}.nc")
        shutil.rmtree(tmp_path / "areas")
    one, two = (netcdf.read(tmp_path / f"{name}.nc") for name in ("one", "two"))
    for name in one.variables:  # to say which of them differs
        np.testing.assert_array_equal(one[name].values, two[name].values, err_msg=name)
    assert (tmp_path / "one.nc").read_bytes() == (tmp_path / "two.nc").read_bytes()
    assert set(netcdf.read(tmp_path / "one.nc").sizes) == {"azimuth_deg", "range_m"}
