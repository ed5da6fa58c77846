"""A solution's file serves other commands; numbers, trends and goals."""

import json

import mitsuba as mi
import numpy as np
import pytest
from click.testing import CliRunner

import mi_lcair
from mi_lcair.api.scenes import parameters
from mi_lcair.cli import main
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import band
from mi_lcair.physics.materials import material
from mi_lcair.rendering.parameters.values import apply_solution
from tests.knowing.inversion.plate import datum, write_scene

mi.set_variant("llvm_ad_mono")

CYLINDER = {"finish": "gloss_black", "resolution": 16, "max_bounces": 1}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plate")
    write_scene(folder)
    return folder


def run(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


@pytest.mark.slow
def test_command_and_render_with_the_solution(folder, tmp_path):
    """The problem is a file; a render with the solution is the predicted image."""
    entry = datum(folder, "cli", 1)
    (folder / "problem.toml").write_text(
        f"""# a plate
        [[data]]
        name = "cli"
        scene = "plate.xml"
        parameters = {{T = 305, R = 0.3}}
        image = "{entry["name"]}.npy"
        quantity = "radiance"
        netd_mK = 50
        [unknowns]
        "plate.temperature" = {{}}
        """
    )
    solution, picture = tmp_path / "solution.json", tmp_path / "residual.png"
    result = run("invert", folder / "problem.toml", "-o", solution, "-o", picture)
    assert result.exit_code == 0, result.output
    assert "plate.temperature" in result.stdout and "determined" in result.stdout
    assert picture.stat().st_size > 10_000
    kelvin = json.loads(solution.read_text())["unknowns"][0]["value"]
    assert kelvin == pytest.approx(310, abs=0.05)
    scene, image = folder / "plate.xml", tmp_path / "image.exr"
    result = run("render", scene, "-D", "R=0.3", "--solution", solution, "--json", "-o", image)
    assert result.exit_code == 0, result.output
    direct = mi_lcair.render(mi_lcair.load(scene, R=0.3, T=kelvin)).mean
    assert json.loads(result.stdout)["mean_radiance_W_m2_sr"] == pytest.approx(direct, rel=1e-6)
    result = run("render", scene, "--solution", f"{solution}:hot", "-o", image)
    assert result.exit_code == 2 and "unknown state" in result.stderr
    result = run("render", "furnace", "--solution", solution, "-o", image)
    assert result.exit_code == 2 and "has no parameter of furnace" in result.stderr
    (tmp_path / "other.json").write_text("{}")
    result = run("render", scene, "--solution", tmp_path / "other.json", "-o", image)
    assert result.exit_code == 2 and "no file that mi-lcair invert wrote" in result.stderr


def test_states_must_be_named(folder, tmp_path):
    data = [datum(folder, "c", 1, "cold"), datum(folder, "h", 2, "hot", T=330.0)]
    found = mi_lcair.invert({"data": data, "unknowns": {"plate.temperature": {}}}, advise=False)
    found.save(tmp_path / "s.json")
    scene = mi_lcair.load(folder / "plate.xml")
    with pytest.raises(InputError, match="differs between 'c' and 'h'; name a state, cold or hot"):
        apply_solution(scene, tmp_path / "s.json")
    apply_solution(scene, tmp_path / "s.json", "hot")
    set_to = parameters(scene)["plate.temperature"].value
    assert set_to == pytest.approx(found["plate.temperature [hot]"].value, abs=1e-4)


@pytest.mark.slow
def test_material_of_a_solution(tmp_path):
    """The emissivity of the cylinder's paint; its file serves as a material."""
    scene = mi_lcair.load("cylinder_ir_range", **CYLINDER)
    image = mi_lcair.render(scene, spp=1024, seed=3).channels["Y"]
    np.save(tmp_path / "i.npy", image)
    entry = {
        "scene": "cylinder_ir_range",
        "parameters": CYLINDER,
        "image": str(tmp_path / "i.npy"),
        "quantity": "radiance",
        "netd_mK": 50,
        "camera_sigma": "0",
        "model_sigma": "0",
    }
    unknown = {"gloss_black.epsilon": {"start": 0.8}}
    found = mi_lcair.invert({"data": [entry], "unknowns": unknown}, advise=False)
    answer = found["gloss_black.epsilon"]
    assert abs(answer.value - 0.88) < 4 * answer.standard_error < 0.02
    found.save(tmp_path / "s.json")
    LWIR = band("LWIR")
    for entry in (
        material(str(tmp_path / "s.json"), LWIR),
        material("gloss_black", LWIR, file=tmp_path / "s.json"),
    ):
        assert entry.parameters["epsilon"] == pytest.approx(answer.value, rel=1e-6)
        assert entry.parameters["b"] == pytest.approx(0.16)
    # Its covariance serves a budget, here of the intensity with the estimated epsilon alone
    entry = found.materials["gloss_black"]["LWIR"]
    assert entry["standard_error"] == {
        "epsilon": answer.standard_error,
        "rho_d": 0.0,
        "b": 0.0,
        "e": 0.0,
    }
    assert entry["correlation"] == np.eye(4).tolist()
    apply_solution(scene, tmp_path / "s.json")
    (tmp_path / "u.toml").write_text('[fits]\ngloss_black = "s.json"\n')
    of_fit = mi_lcair.budget(scene, tmp_path / "u.toml", spp=16)
    sigma = {"gloss_black.epsilon": answer.standard_error}
    stated = mi_lcair.budget(scene, {"sigma": sigma}, spp=16)
    assert of_fit.sigma_of_quantities == pytest.approx(stated.sigma_of_quantities, rel=1e-6)
    with pytest.raises(InputError, match="unknown material of .* 'gloss_blak'; known: gloss_black"):
        mi_lcair.budget(scene, {"fits": {"gloss_blak": str(tmp_path / "s.json")}})
    command = ["budget", "cylinder_ir_range", "--solution", tmp_path / "s.json", "--spp", "16"]
    command += [part for key, value in CYLINDER.items() for part in ("-D", f"{key}={value}")]
    result = run(*command, "-u", tmp_path / "u.toml", "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["estimate"]["value"] == pytest.approx(of_fit.value, rel=1e-6)
    with pytest.raises(InputError, match="not measured for band MWIR"):
        material(str(tmp_path / "s.json"), band("MWIR"))


@pytest.mark.slow
def test_a_trend_as_data(tmp_path):
    """Intensities from three aspects determine the temperature of the hottest stripe."""
    scene = mi_lcair.load("cylinder_ir_range", **CYLINDER)
    trend = mi_lcair.trend(scene, [100, 140, 180], resolution=64, spp=16)
    trend.save(tmp_path / "t.csv")
    assert len(trend.table["azimuth_deg"]) == 3
    entry = {
        "scene": "cylinder_ir_range",
        "parameters": CYLINDER,
        "trend": str(tmp_path / "t.csv"),
        "sigma": 0.002,
    }
    unknown = {"self@304.2.temperature": {"start": 295.0}}
    found = mi_lcair.invert({"data": [entry], "unknowns": unknown}, advise=False)
    answer = found["self@304.2.temperature"]
    assert found.data[0].points == 3 and len(found.data[0].aspects) == 3
    assert abs(answer.value - 304.2) < 4 * answer.standard_error < 4


@pytest.mark.slow
def test_a_goal(folder):
    """A plate hides from a background of the sky's temperature if it reflects everything."""
    goal = {
        "quantity": "contrast",
        "scene": str(folder / "plate.xml"),
        "parameters": {"R": 0.6},
        "background_K": 290.0,
        "elevation_deg": 90.0,
    }
    found = mi_lcair.invert({"goal": goal, "unknowns": {"paint.reflectance": {}}})
    answer = found["paint.reflectance"]
    assert answer.value == pytest.approx(1, abs=2e-3)
    assert found.p_value is None and not found.advice
    assert "rms contrast over 1 aspects" in found.remarks[0]
    assert abs(found.data[0].predicted[0]) < 0.1
    # A warmer background is met exactly, by a reflectance between
    goal |= {"background_K": 300.0}
    found = mi_lcair.invert({"goal": goal, "unknowns": {"paint.reflectance": {}}})
    from mi_lcair.physics.blackbody import in_band_radiance

    B = lambda T: float(in_band_radiance(band("LWIR"), T))
    expected = (B(310) - B(300)) / (B(310) - B(290))
    assert found["paint.reflectance"].value == pytest.approx(expected, abs=2e-3)
    assert found["paint.reflectance"].verdict == "chosen"
