"""`heat` on the box of the examples: results, files, and what is refused."""

import shutil
import tomllib

import numpy as np
import pytest

import mi_lcair
from mi_lcair import models3d, scenes
from mi_lcair.cli import main
from mi_lcair.errors import InputError
from mi_lcair.heating.temperatures.description import (
    HeatDescription,
    default_sigmas,
    doubts,
    group_of,
    materials,
)
from mi_lcair.heating.temperatures.solve import temperatures
from mi_lcair.rendering.parameters.modes import set_facets
from tests.heating.scenes import grey, scene_of, square

EXAMPLES = scenes.FOLDER / "examples"
GLASS = {"thickness_mm": 4.0, "conductivity": 1.0, "density": 2500.0, "heat_capacity": 840.0}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The box and its heat.toml with few steps and paths."""
    path = tmp_path_factory.mktemp("heat")
    models3d.export(models3d.read(EXAMPLES / "box.obj"), path / "box")
    shutil.copy(EXAMPLES / "day.csv", path)
    text = (EXAMPLES / "heat.toml").read_text()
    (path / "heat.toml").write_text(f"{text}\n[run]\nsteps = 12\nrays = 64\n")
    return path


@pytest.fixture(scope="module")
def day(folder):
    return mi_lcair.heat(folder / "heat.toml")


def test_day(day):
    assert day.kelvin.shape == (12, 7)
    lid = day.of_groups(day.kelvin)[:, day.facets.groups.index("lid")]
    assert lid.argmax() in (5, 6, 7)
    assert np.ptp(lid) > 30
    of_model = {f"{group}.model_K": 0.8 for group in day.facets.groups}
    assert {row.quantity: row.sigma for row in day.inputs} == of_model | (
        HeatDescription.read(EXAMPLES / "heat.toml").sigma
    )
    assert (day.estimate["sky_K"].contribution > 0).all()
    (remark,) = [text for text in day.remarks if "the surfaces also emit" in text]
    facets = day.facets
    share = (0.02 * facets.area).sum() / facets.emitting_area.sum()
    assert remark.startswith("[sigma] emissivity") and f"emit {share:.1%} more" in remark
    assert any("its effect assumes that surfaces reflect diffusely" in text for text in day.remarks)
    assert day.residual_W < 1e-3
    # The mean of a group changes by the mean of its facets' changes
    k = day.facets.groups.index("self")
    of_walls = day.facets.group == k
    area = day.facets.area[of_walls] / day.facets.area[of_walls].sum()
    parts = [row.contribution[:, of_walls] @ area for row in day.estimate.contributions]
    np.testing.assert_allclose(
        day.means.standard_error[:, k], np.sqrt(np.square(parts).sum(axis=0))
    )
    assert "kelvin" not in day.summary()


def test_intensity_is_that_of_a_render_with_its_temperatures(day, folder):
    scene = mi_lcair.load(folder / "box" / "scene.xml")
    set_facets(scene, dict(zip(day.facets.number.tolist(), day.kelvin[6].tolist())))
    rendered = mi_lcair.signature(scene, spp=256)
    error = np.hypot(
        rendered.target.standard_error, day.intensity["noise of the rendering"].contribution[6]
    )
    assert abs(rendered.target.intensity - day.intensity.value[6]) < 4 * error
    assert any(text.startswith("intensity: ") and "see nothing" in text for text in day.remarks)


def test_intensity_has_what_the_model_reflects(folder, tmp_path):
    """A bright sky of the scene, other than that from which its temperatures come."""
    shutil.copytree(folder / "box", tmp_path / "box")
    file = tmp_path / "box" / "scene.xml"
    sky = '<emitter type="constant"><spectrum name="radiance" value="200"/></emitter>\n</scene>'
    file.write_text(file.read_text().replace("</scene>", sky))
    weather = {"air_K": 285.0, "sky_K": 260.0, "ground_K": 285.0, "h_W_m2_K": 5.0}
    run = {"signature": {"spp": 64}, "run": {"rays": 64}, "sigma": {}}
    heat = mi_lcair.heat({"target": {"scene": str(file)}, "weather": weather} | run)
    assert heat.is_steady and heat.days == 0
    assert not any("see nothing" in text for text in heat.remarks)
    scene = mi_lcair.load(file)
    set_facets(scene, dict(zip(heat.facets.number.tolist(), heat.kelvin[0].tolist())))
    rendered = mi_lcair.signature(scene, spp=64).target
    noise = heat.intensity["noise of the rendering"].contribution[0]
    apart = abs(rendered.intensity - heat.intensity.value[0])
    assert apart < 4 * np.hypot(rendered.standard_error, noise) < 0.05 * rendered.intensity


def test_an_hour_outside_the_day_is_refused(day, tmp_path):
    assert day.row(0) == 0 and day.row(1.1) == 0 and day.row(24) == 11
    for hour in (-0.1, 30):
        with pytest.raises(InputError, match=f"hour = {hour}; must lie in 0..24"):
            day.save(tmp_path / "t.csv", hour=hour)


def test_files(day, tmp_path, folder):
    import meshio
    import xarray

    day.save(tmp_path / "t.csv", hour=14)
    model = models3d.read(EXAMPLES / "box.obj", temperatures=tmp_path / "t.csv")
    np.testing.assert_allclose(model.temperature, day.kelvin[6], rtol=1e-8)
    assert (tmp_path / "t.csv").read_text().startswith("facet,kelvin,error_K,by_h_K")
    day.save(tmp_path / "t.nc")
    with xarray.open_dataset(tmp_path / "t.nc") as data:
        np.testing.assert_allclose(data.temperature_K, day.kelvin)
        assert data["by_h_K"].dims == ("time", "facet")
    day.save(tmp_path / "t.vtu", hour=14)
    cells = meshio.read(tmp_path / "t.vtu").cell_data["temperature_K"]
    np.testing.assert_allclose(np.concatenate(cells), day.kelvin[6])
    day.save(tmp_path / "t.vtp.series")
    assert len(list(tmp_path.glob("t_*.vtp"))) == 12
    day.save(tmp_path / "t.png")
    day.save(tmp_path / "t.json")
    day.save(tmp_path / "t.html")
    assert "How it was made" in (tmp_path / "t.html").read_text()
    scene = mi_lcair.load(folder / "box" / "scene.xml", modes=tmp_path / "t.csv")
    assert mi_lcair.parameters(scene)["heat.terrain.conductivity"].value == 0


def test_steady_state_of_a_sunlit_room_of_one_temperature(folder):
    """Everything at 300 K stays there: surroundings, air and no sun."""
    weather = {"air_K": 300.0, "sky_K": 300.0, "ground_K": 300.0, "h_W_m2_K": 5.0}
    target = {"scene": str(folder / "box" / "scene.xml")}
    tables = {"target": target, "weather": weather, "run": {"rays": 64}, "sigma": {"back_K": 1.0}}
    room = mi_lcair.heat(tables)
    assert "[sigma] back_K changes no temperature" in room.remarks
    np.testing.assert_allclose(room.kelvin, 300, atol=1e-6)
    assert "steady state" in room.summary()
    assert room.residual_W < 1e-9


def test_materials_give_what_is_left_out_and_its_uncertainty(folder):
    """Without [sigma] the defaults of materials and weather are used, and printed as such."""
    weather = {"air_K": 285.0, "cloud": 0.5, "relative_humidity": 60.0, "ground_K": 285.0}
    weather |= {"h_W_m2_K": 5.0, "sun_W_m2": 700.0, "sun_elevation_deg": 40.0}
    weather |= {"sun_azimuth_deg": 0.0}
    target = {"scene": str(folder / "box" / "scene.xml")}
    groups = {"terrain": {"material": "soil_wet", "emissivity": 0.9, "albedo": [0.5]}}
    groups["lid"] = {"temperature": 300.0}
    tables = {"target": target, "weather": weather, "groups": groups, "run": {"rays": 64}}
    heat = mi_lcair.heat(tables)
    rows = {row.quantity: row.sigma for row in heat.inputs}
    assert rows["terrain.wetness"] == "0.2 (default)"
    assert rows["terrain.h"] == "20 % (default)" and rows["self.h"] == "30 % (default)"
    assert rows["down_longwave_W_m2"] == "15.0 (default)"
    assert "lid.model_K" not in rows and "terrain.emissivity" in rows
    assert "without the law of wind over rough ground" in " ".join(heat.remarks)
    k = heat.facets.groups.index("terrain")
    assert heat.facets.emissivity[heat.facets.group == k] == pytest.approx(0.9, abs=1e-6)
    assert (heat.estimate["terrain.model_K"].contribution[0, heat.facets.group == k] == 0.8).all()
    # Half of the beam of an albedo of 0.5
    dark = mi_lcair.heat(
        tables | {"groups": groups | {"terrain": groups["terrain"] | {"albedo": [0]}}}
    )
    assert (dark.means.value - heat.means.value)[0, k] > 5
    exact = mi_lcair.heat(tables | {"sigma": {"model_K": 0, "air_K": 1.0}})
    assert "without model error: model_K of [sigma] is 0" in exact.remarks
    assert [row.quantity for row in exact.inputs] == ["air_K"]


def test_given_numbers_and_layers_have_the_uncertainty_of_materials():
    """A given number that of its material; one without a material a general one."""
    layers = [{"material": "brick", "thickness_mm": 100}, GLASS | {"contact_m2_K_W": 0.1}]
    groups = {
        "soil": group_of({"material": "soil", "conductivity": 1.3, "absorptance": 0.7}, ""),
        "own": group_of(GLASS, ""),
        "wall": group_of({"layers": layers, "wetness": 0.5}, ""),
        "held": group_of({"temperature": 300.0}, ""),
    }
    found = default_sigmas("sky_K", groups)
    assert not [name for name in found if name.startswith("held") or "thickness" in name]
    assert (found["soil.conductivity"], found["soil.absorptance"]) == ("50 %", 0.06)
    assert (found["own.conductivity"], found["own.heat_capacity"]) == ("50 %", "10 %")
    assert found["wall.conductivity[0]"] == "20 %" and found["wall.density[0]"] == "6 %"
    assert found["wall.conductivity[1]"] == "50 %" and found["wall.wetness"] == 0.2
    assert found["wall.contact_m2_K_W[1]"] == "50 %" and "wall.h[0]" not in found


def test_layers_change_temperatures_one_by_one(folder):
    """The change by one layer's conductivity is the difference of two balances."""
    weather = {"air_K": 285.0, "sky_K": 260.0, "ground_K": 285.0, "h_W_m2_K": 5.0}
    tables = {"target": {"scene": str(folder / "box" / "scene.xml")}, "weather": weather}
    tables["run"] = {"rays": 64}

    def heat(second, **more):
        layers = [GLASS | {"conductivity": 0.1}, GLASS | {"conductivity": second}]
        return mi_lcair.heat(
            tables | {"groups": {"self": {"layers": layers, "back_K": 310.0}}} | more
        )

    sigmas = {"self.conductivity": "1 %", "self.conductivity[1]": "1 %"}
    both = heat(0.05, sigma=sigmas)
    of_all, of_one = (both.estimate[name].contribution for name in sigmas)
    less, more = (heat(k, sigma={}).kelvin for k in (0.04995, 0.05005))
    np.testing.assert_allclose(of_one, 5 * (more - less), atol=1e-6)
    assert abs(of_one).max() < 0.9 * abs(of_all).max()
    for name in ("self.conductivity[2]", "conductivity[0]", "self.h[0]"):
        with pytest.raises(InputError, match="there is no such layer"):
            heat(0.05, sigma={name: "1 %"})


def test_numbers_that_no_solid_has_are_doubted():
    """With their size in the unit that is often meant."""
    layers = [GLASS | {"density": 2.5}]
    (of_layer,) = doubts(group_of({"layers": layers}, ""), "[groups.a]")
    assert of_layer.startswith("[groups.a] layers[0]: density = 2.5 kg/m^3 is outside 10 to 25000")
    assert of_layer.endswith("2.5 g/cm^3 would be 2500")
    odd = GLASS | {"conductivity": 1200.0, "heat_capacity": 4.2}
    of_k, of_c = doubts(group_of(odd, ""), "a")
    assert of_k == "a: conductivity = 1200 W/(m K) is outside 0.001 to 500 of solids"
    assert "4.2 kJ/(kg K) would be 4200" in of_c
    for name in materials():
        assert not doubts(group_of({"material": name, "thickness_mm": 50.0}, ""), "")


def test_parameters_of_the_target_are_those_of_load(folder):
    """A model that has turned by half a circle is in the sun as if the sun had turned."""
    sunny = {"air_K": 290.0, "sky_K": 260.0, "h_W_m2_K": 5.0, "sun_W_m2": 800.0}
    sunny["sun_elevation_deg"] = 20.0
    kelvin = []
    for azimuth, yaw in ((40.0, 180.0), (220.0, 0.0)):
        target = {"scene": str(folder / "box" / "scene.xml"), "parameters": {"model.yaw_deg": yaw}}
        weather = sunny | {"sun_azimuth_deg": azimuth}
        run = {"rays": 256}
        heat = mi_lcair.heat({"target": target, "weather": weather, "run": run})
        of_box = heat.facets.group != heat.facets.groups.index("terrain")
        kelvin.append(heat.kelvin[0, of_box])
    assert np.ptp(kelvin[0]) > 10
    np.testing.assert_allclose(*kelvin, atol=1.0)


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"groups": {"wing": {}}}, "unknown group 'wing'"),
        ({"sigma": {"wind": 1.0}}, r"unknown input of \[sigma\] 'wind'"),
        ({"run": {"start_K": 300.0}}, "start_K begins a series; give its rows"),
        ({"sigma": {"lid.sky_K": 1.0}}, "sky_K is of the weather"),
        ({"weather": {"h_W_m2_K": 5.0, "sky_K": 250.0}}, "air_K is missing"),
        ({"groups": {"lid": {"material": "cheese"}}}, "unknown material 'cheese'"),
        ({"groups": {"lid": {"material": "steel"}}}, "thickness_mm is missing"),
        ({"sigma": {"model_K": -1}}, "model_K = -1 K; must lie in 0..1000"),
        ({"run": {"method": "harmonics"}}, 'harmonics" needs a file of .weather'),
        ({"groups": {"lid": {"roughness_mm": 9, "wetness": 0.5}}}, "needs wind_m_s"),
    ],
)
def test_refused(folder, tables, message):
    text = (folder / "heat.toml").read_text()
    tree = tomllib.loads(text) | {"weather": {"air_K": 290.0, "h_W_m2_K": 5.0, "sky_K": 250.0}}
    tree["target"]["scene"] = str(folder / "box" / "scene.xml")
    with pytest.raises(InputError, match=message):
        mi_lcair.heat(tree | tables)


def test_what_cannot_be_is_refused_before_the_paths(folder, monkeypatch):
    text = (folder / "heat.toml").read_text()
    tree = tomllib.loads(text)
    tree["target"]["scene"] = str(folder / "box" / "scene.xml")
    tree["weather"]["file"] = str(folder / "day.csv")
    with pytest.raises(InputError, match="sensor"):
        mi_lcair.heat(tree | {"signature": {"sensor": 7}})
    monkeypatch.setattr("mi_lcair.rendering.measurands.available_memory", lambda: 10_000)
    monkeypatch.setattr("mi_lcair.heating.surfaces.BYTES", 0)
    with pytest.raises(InputError, match="sunlight on 7 facets at . times needs 0.0 GiB"):
        mi_lcair.heat(tree)


def test_a_signature_needs_temperatures_that_can_be_replaced():
    film = {"type": "hdrfilm", "width": 4, "height": 4, "pixel_format": "luminance"}
    scene = scene_of(
        sensor={"type": "orthographic", "film": film},
        lamp=square(grey(0.5), emitter={"type": "thermal", "band": "LWIR", "radiance": 20.0}),
    )
    tables = {"target": {"scene": "lamp"}, "weather": {"air_K": 290.0, "sky_K": 250.0}}
    tables["weather"]["h_W_m2_K"] = 5.0
    assert temperatures(scene, HeatDescription.read(tables)).kelvin < 290
    with pytest.raises(InputError, match="shape 'lamp' has no temperature for each facet"):
        temperatures(scene, HeatDescription.read(tables | {"signature": {}}))


def test_command_refuses_in_one_line(folder, capsys):
    (folder / "bad.toml").write_text(
        '[target]\nscene = "box/scene.xml"\n[groups.lid]\ndensity = -1\n'
    )
    with pytest.raises(SystemExit) as status:
        main(["heat", str(folder / "bad.toml")])
    assert status.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1
