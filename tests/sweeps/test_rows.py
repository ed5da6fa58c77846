"""Tests of a sweep's quantities and their errors, from effective areas that were made up."""

from dataclasses import replace

import numpy as np
import pytest

from mi_lcair.detection.scenario import Scenario
from mi_lcair.detection.setting import line_of
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import brightness_temperature, in_band_radiance
from mi_lcair.plugins.emission.source import Source
from mi_lcair.rendering.views import View
from mi_lcair.signatures.view_areas import ViewAreas
from mi_lcair.sweeps.lines import Line, Sightline
from mi_lcair.sweeps.rows import rows_of
from tests.detection.disc_scenario import write_disc

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
        np.arange(1), (), None, None, {}, Sightline(detector, sight.air, path, behind, 2.0, "")
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
