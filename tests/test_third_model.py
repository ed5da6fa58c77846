"""What a new reflection model costs: one file of physics, one of Mitsuba, one line of registration.

A copy of the project gets the models of tests/data/third_model, one without a lobe and one with a
narrow lobe. Everything that a model takes part in is tried there: scene files, materials, ladder,
emissivity, derivatives, fit and number of reflections.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FILES = ROOT / "tests" / "data" / "third_model"

SURFACES = {
    "minnaert": {"rho": 0.6, "k": 1.5},
    "phong": {"rho": 0.6, "share": 0.7, "n": 300.0},
}

USE_IT = r"""
import json, sys
from pathlib import Path
import mi_lcair
import drjit as dr, mitsuba as mi, numpy as np
from mi_lcair import scenes
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.fitting import fit
from mi_lcair.fitting.scatterometer.reading import Measurements

model, surface = sys.argv[1], json.loads(sys.argv[2])
plugin = {"type": model, **surface}
print("plugin", mi.load_dict(plugin))

# A material of the user's own in a bundled scene: isothermal, so that Kirchhoff's law is seen.
lines = [f"{name} = {value}" for name, value in surface.items()]
lines = ["[moon.MWIR]", f'model = "{model}"', *lines, 'source = "test"']
Path("own.toml").write_text("\n".join(lines) + "\n")
text = (scenes.FOLDER / "furnace.xml").read_text()
for folder in ("meshes", "furnace.toml"):
    text = text.replace(f'value="{folder}', f'value="{scenes.FOLDER / folder}')
material = '<string name="material" value="$material"/>'
text = text.replace(material, material + ' <string name="materials" value="own.toml"/>')
Path("furnace.xml").write_text(text)
scene = mi_lcair.load("furnace.xml", material="moon", resolution=16)
(body,) = [surface for surface in scene.surfaces() if surface.material == "moon"]
assert body.model.name == model
assert body.values == tuple(np.float32(list(surface.values())).tolist())
exact = in_band_radiance(scene.band, 300.0)
assert abs(mi_lcair.render(scene, spp=256).mean / exact - 1) < 2e-3
scene.set_lobe("diffuse", "moon")
assert abs(mi_lcair.render(scene, spp=256).mean / exact - 1) < 2e-3
scene.set_lobe("brdf", "moon")

# The derivative of the emission toward the normal: -1 for rho.
T = mi.ScalarTransform4f
down = T().look_at([0, 0, 2], [0, 0, 0], [0, 1, 0]) @ T().scale([0.1, 0.1, 1])
film = {"type": "hdrfilm", "width": 1, "height": 1, "pixel_format": "luminance"}
plate = mi.load_dict({
    "type": "scene",
    "integrator": {"type": "bounce_path", "max_bounces": 0},
    "shape": {
        "type": "rectangle",
        "bsdf": plugin,
        "emitter": {"type": "thermal", "band": "MWIR", "temperature": 300.0},
    },
    "sensor": {
        "type": "orthographic",
        "to_world": down,
        "film": {**film, "rfilter": {"type": "box"}},
    },
})
params = mi.traverse(plate)
key = next(key for key in params.keys() if key.endswith(".rho"))
dr.enable_grad(params[key])
params.update()
image = mi.render(plate, params, spp=16)
dr.backward(image)
assert abs(dr.grad(params[key])[0] / -exact - 1) < 1e-4

scene = mi_lcair.load("furnace.xml", material="moon", resolution=16)
image = mi_lcair.render(scene, tolerance=0.02, max_bounces="auto")
assert image.reached

# The fit finds its parameters, and tells it from the other models.
theta = np.radians(np.arange(2.0, 80, 6))
theta_i, theta_r = (grid.ravel() for grid in np.meshgrid(theta, np.concatenate([-theta, theta])))
rng = np.random.default_rng(0)
if model == "minnaert":
    brdf = 0.6 * 2.5 / (2 * np.pi) * (np.cos(theta_i) * np.cos(theta_r)) ** 0.5
else:
    brdf = 0.6 * (0.3 / np.pi + 0.7 * 302 / (2 * np.pi) * np.cos(theta_i - theta_r) ** 300)
brdf *= np.exp(0.02 * rng.standard_normal(len(brdf)))
data = Measurements(theta_i=theta_i, theta_r=theta_r, brdf=brdf)
found = fit(data, model="auto")
assert found.model == model, found.candidates
np.testing.assert_allclose(list(found.parameters.values()), list(surface.values()), rtol=0.02)
assert all(words.startswith("determined") for words in found.verdict.values()), found.verdict
print("all of it works")
"""


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """A copy of the project with both models added as CONTRIBUTING.md says."""
    root = tmp_path_factory.mktemp("project")
    for folder in ("mi_lcair", "plugins", "fitting", "scenes", "tests"):
        shutil.copytree(ROOT / folder, root / folder, symlinks=True)  # with what is compiled
    shutil.copy(ROOT / "pyproject.toml", root)
    registry = root / "mi_lcair" / "physics" / "reflection" / "__init__.py"
    for model in SURFACES:
        shutil.copy(FILES / f"{model}.py", root / "mi_lcair" / "physics" / "reflection")
        shutil.copy(FILES / f"{model}_bsdf.py", root / "plugins" / "bsdfs" / f"{model}.py")
        before = registry.read_text()
        first = '    "sandford_robertson",\n'
        after = before.replace(first, f'{first}    "{model}",\n')
        assert len(after.splitlines()) == len(before.splitlines()) + 1
        registry.write_text(after)
    return root


def python(root, *arguments):
    environment = os.environ | {"PYTHONPATH": str(root)}
    return subprocess.run(
        [sys.executable, *arguments], cwd=root, env=environment, capture_output=True, text=True
    )


@pytest.mark.slow
@pytest.mark.parametrize("model", ["phong", pytest.param("minnaert", marks=pytest.mark.study)])
def test_everything_takes_the_new_model(copy, model):
    done = python(copy, "-c", USE_IT, model, json.dumps(SURFACES[model]))
    assert done.returncode == 0 and "all of it works" in done.stdout, done.stderr


@pytest.mark.slow
def test_the_batteries_take_them_without_an_edit(copy):
    """Tests that run over the registry find the new models; all of them pass."""
    files = ["tests/physics/reflection/test_models.py", "tests/plugins/bsdfs/test_battery.py"]
    names = " or ".join(SURFACES)
    done = python(copy, "-m", "pytest", "-v", "-n", "0", "-k", names, *files)
    assert done.returncode == 0, done.stdout
    for model in SURFACES:
        assert sum(model in line and "PASSED" in line for line in done.stdout.splitlines()) >= 20
