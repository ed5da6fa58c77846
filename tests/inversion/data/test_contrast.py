"""The contrast of a scenario as a datum."""

import json

import mitsuba as mi
import numpy as np
import pytest
from click.testing import CliRunner

import mi_lcair
from mi_lcair.cli import main
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from tests.detection.disc_scenario import AREA, disc, triangles, write_disc

mi.set_variant("llvm_ad_mono")

SAMPLING = {"render.resolution": 32, "render.spp": 256}


def entry(folder, contrast, sigma, **entries):
    return {
        "name": "disc",
        "scene": str(folder / "disc.toml"),
        "parameters": SAMPLING | {"target.parameters.temperature": 380} | entries,
        "contrast": contrast,
        "sigma": sigma,
    }


@pytest.mark.slow
@pytest.mark.parametrize("table", ["vacuum", "midlat_summer"])
def test_temperature_from_a_contrast(tmp_path, table):
    """The contrast of a disc of 400 K, measured 800 m away, gives its temperature back.

    The air weighs the spectrum. The standard error is that of the difference of two contrasts.
    """
    write_disc(tmp_path)
    changes = {"atmosphere__table": table, "observer__range_m": 800}
    of = lambda T: (
        mi_lcair.contrast(
            disc(
                tmp_path,
                target__parameters__temperature=T,
                render__resolution=32,
                render__spp=1024,
                **changes,
            )
        )
        .rows[-1]
        .total.value
    )
    measured, slope = of(400), (of(401) - of(399)) / 2
    sigma = 0.2 * slope
    own = {key.replace("__", "."): value for key, value in changes.items()}
    problem = {
        "data": [entry(tmp_path, measured, sigma, **own)],
        "unknowns": {"self.temperature": {}},
    }
    found = mi_lcair.invert(problem, advise=False)
    answer = found["self.temperature"]
    assert answer.value == pytest.approx(400, abs=0.15)
    assert answer.standard_error == pytest.approx(0.2, rel=0.15)
    assert answer.verdict == "determined" and found.data[0].quantity == "contrast (W m^-2)"
    if table == "vacuum":
        B = lambda T: float(in_band_radiance(band("MWIR"), T))
        assert found.data[0].predicted[0] == pytest.approx(
            AREA * (B(answer.value) - B(294)) / 800**2, rel=2e-3
        )
        # The command takes the temperature from the solution's file
        found.save(tmp_path / "s.json")
        command = ["contrast", tmp_path / "disc.toml", "-D", "observer.range_m=800", "--spp", "16"]
        command += ["-D", "target.parameters.temperature=380", "--solution", tmp_path / "s.json"]
        result = CliRunner().invoke(main, [*map(str, command), "--json"])
        assert result.exit_code == 0, result.output
        row = json.loads(result.stdout)["rows"][0]
        assert row["total_W_m2"]["value"] == pytest.approx(measured, rel=5e-3)


@pytest.mark.slow
def test_ground_below_and_behind_a_target(tmp_path):
    """Temperature of the ground from the contrast of a grey disc before it, in vacuum.

    The disc is upright: it reflects sky and ground by halves, and hides the ground.
    """
    write_disc(tmp_path)
    text = (tmp_path / "disc.xml").read_text().replace('"blackbody"', '"0.4"')
    (tmp_path / "disc.xml").write_text(text)
    B = lambda T: float(in_band_radiance(band("MWIR"), T))
    view = np.cos(np.radians(20)) * AREA / 1000**2
    of = lambda T: float(view * (0.4 * B(320) + 0.3 * (B(260) + B(T)) - B(T)))
    there = {
        "observer.elevation_deg": 20,
        "target.parameters.temperature": 320,
        "surroundings.sky": 260,
        "surroundings.ground": 290,
    }
    problem = {
        "data": [entry(tmp_path, of(300.0), 0.01 * abs(of(300.0)), **there)],
        "unknowns": {"ground.temperature": {}},
    }
    answer = mi_lcair.invert(problem, advise=False)["ground.temperature"]
    slope = (of(300.5) - of(299.5)) / of(300.0)
    assert answer.value == pytest.approx(300, abs=0.3)
    assert answer.standard_error == pytest.approx(0.01 / abs(slope), rel=0.1)


@pytest.mark.slow
def test_weather_from_a_contrast(tmp_path):
    """Humidity from the contrast of a disc that reflects most of the sky, 5 km away.

    The standard error is that of the difference of two contrasts.
    """
    write_disc(tmp_path)
    text = (tmp_path / "disc.xml").read_text().replace('"blackbody"', '"0.4"')
    (tmp_path / "disc.xml").write_text(text)
    there = {
        "observer.range_m": 5000,
        "observer.elevation_deg": 20,
        "target.height_m": 1800,
        "target.parameters.temperature": 320,
        "atmosphere.table": "us_standard",
        "surroundings.sky": "clear",
        "surroundings.ground": 290,
    }
    changes = {name.replace(".", "__"): value for name, value in (SAMPLING | there).items()}
    of = lambda humidity: (
        mi_lcair.contrast(disc(tmp_path, **changes, atmosphere__humidity=humidity))
        .rows[-1]
        .total.value
    )
    measured, slope = of(0.7), (of(0.72) - of(0.68)) / 0.04
    sigma = 0.02 * abs(slope)
    problem = {
        "data": [entry(tmp_path, measured, sigma, **there)],
        "unknowns": {"scenario.air_humidity": {}},
    }
    found = mi_lcair.invert(problem, advise=False)
    answer = found["scenario.air_humidity"]
    assert answer.value == pytest.approx(0.7, abs=0.01)
    assert answer.standard_error == pytest.approx(0.02, rel=0.1)
    assert answer.verdict == "determined" and answer.unit == "1"
    assert found.data[0].predicted[0] == pytest.approx(measured, rel=2e-3)
    with pytest.raises(InputError, match="unknown parameter of the data's scenes"):
        dry = there | {"atmosphere.table": "vacuum"}
        mi_lcair.invert(problem | {"data": [entry(tmp_path, measured, sigma, **dry)]})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"sensor": 1}, "a scenario has its observer"),
        ({"intensity": 1.0}, "has intensity and contrast; give one of"),
        ({"parameters": {"observer.range": 5}}, r"unknown key of \[observer\]"),
        ({"sigma": -1.0}, "must be positive"),
    ],
)
def test_bad_entries(tmp_path, changes, message):
    write_disc(tmp_path)
    problem = {
        "data": [entry(tmp_path, 1.0, 0.1) | changes],
        "unknowns": {"self.temperature": {}},
    }
    with pytest.raises(InputError, match=message):
        mi_lcair.invert(problem)


def test_facets_need_images(tmp_path):
    write_disc(tmp_path, [400.0] * len(triangles()))
    one = entry(tmp_path, 1.0, 0.1)
    one["parameters"].pop("target.parameters.temperature")
    with pytest.raises(InputError, match="facets of self are unknown, which needs images"):
        mi_lcair.invert({"data": [one], "unknowns": {"self.facets": {}}})
