"""The fingerprint: it changes with whatever the picture depends on, and with nothing else."""

import shutil

import pytest

import mi_lcair
from tests.rendering.loading.scene_text import (
    FACETS,
    HALVES,
    SENSOR,
    SQUARE,
    mesh,
    shape,
    write,
    write_ply,
)

PAINT = """<bsdf type="material"> <string name="material" value="paint"/>
    <string name="materials" value="own.toml"/> <string name="band" value="$band"/>
    <string name="emissivity" value="measured.csv"/> </bsdf>"""
METAL = """<bsdf type="roughconductor"> <float name="alpha" value="0.2"/>
    <string name="distribution" value="beckmann"/> </bsdf>"""
SKY = """<emitter type="thermal"> <string name="band" value="$band"/>
    <string name="spectrum" value="sky.csv"/> </emitter>"""
INTEGRATOR = """<integrator type="bounce_path"> <string name="closure" value="ambient"/>
    <float name="ambient_temperature" value="290"/> </integrator>"""
TOML = '[paint.LWIR]\nepsilon = 0.5\nrho_d = 0.1\nb = 0.2\ne = 0.3\nsource = "test"\n'
FILES = {
    "own.toml": TOML.replace("LWIR", '"8-12"'),
    "measured.csv": "theta_deg,emissivity\n0,0.7\n89,0.6\n",
    "response.csv": "wavelength_um,response\n8,1\n10,0.5\n12,1\n",
    "sky.csv": "wavelength_um,radiance_W_m2_sr_um\n"
    + "".join(f"{7 + k / 20},1\n" for k in range(121)),
    "shared.xml": f'<scene version="3.0.0"> {shape(PAINT)} </scene>',
}


@pytest.fixture
def scene(tmp_path):
    for name, content in FILES.items():
        (tmp_path / name).write_text(content)
    write_ply(tmp_path / "plate.ply", SQUARE, HALVES, temperature=[300, 310], other=[300, 310])
    moved = '<transform name="to_world"> <translate z="1"/> </transform>'
    return write(
        tmp_path,
        '<default name="band" value="response.csv"/>',
        INTEGRATOR,
        SENSOR,
        mesh(PAINT + FACETS.replace("LWIR", "$band")),
        shape(moved + METAL + SKY),
        '<include filename="shared.xml"/>',
    )


CHANGES = {
    "an emissivity": ("measured.csv", "0.7", "0.71"),
    "a response": ("response.csv", "0.5", "0.6"),
    "a material": ("own.toml", "0.5", "0.51"),
    "a spectrum": ("sky.csv", "9,1", "9,1.5"),
    "what is included": ("shared.xml", 'type="rectangle"', 'type="disk"'),
    "ambient_temperature": ("scene.xml", "290", "291"),
    "flip_normals": (
        "scene.xml",
        '<boolean name="face_normals"',
        '<boolean name="flip_normals" value="true"/> <boolean name="face_normals"',
    ),
    "distribution": ("scene.xml", "beckmann", "ggx"),
    "an attribute's name": ("scene.xml", "face_temperature", "face_other"),
    "a transform's last digit": ("scene.xml", 'z="1"', 'z="1.000001"'),
    "a sensor": ("scene.xml", 'name="width" value="4"', 'name="width" value="5"'),
}


@pytest.mark.slow
@pytest.mark.parametrize("change", CHANGES)
def test_changes(scene, change):
    """Each of these changes the picture, and most left the fingerprint as it was."""
    before = mi_lcair.load(scene).fingerprint
    file, old, new = CHANGES[change]
    path = scene.with_name(file)
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))
    assert mi_lcair.load(scene).fingerprint != before


@pytest.mark.slow
def test_a_mesh(scene):
    before = mi_lcair.load(scene).fingerprint
    write_ply(
        scene.with_name("plate.ply"), SQUARE, HALVES, temperature=[300, 310.001], other=[300, 310]
    )
    assert mi_lcair.load(scene).fingerprint != before


@pytest.mark.slow
def test_a_parameter(scene):
    (scene.with_name("own.toml")).write_text(TOML + FILES["own.toml"])
    texts = [{}, {"band": "LWIR"}]
    assert len({mi_lcair.load(scene, **given).fingerprint for given in texts}) == 2


def test_values_changed_since(scene):
    """Also a parameter that Python has changed, and the fidelity rung of a material."""
    import mitsuba as mi

    loaded = mi_lcair.load(scene)
    seen = [loaded.fingerprint]
    loaded.set_lobe("diffuse")
    seen.append(loaded.fingerprint)
    parameters = mi.traverse(loaded.mi)
    key = next(key for key in parameters.keys() if key.endswith("epsilon"))  # noqa: SIM118
    parameters[key] = 0.4
    parameters.update()
    seen.append(loaded.fingerprint)
    assert len(set(seen)) == 3


@pytest.mark.slow
def test_the_same_elsewhere(scene, tmp_path, monkeypatch):
    """Not where the files lie, nor the working folder, nor when it was loaded."""
    before = mi_lcair.load(scene).fingerprint
    assert mi_lcair.load(scene).fingerprint == before
    moved = tmp_path / "moved"
    moved.mkdir()
    for file in [*FILES, "plate.ply", "scene.xml"]:
        shutil.copy(tmp_path / file, moved / file)
    monkeypatch.chdir(moved)
    assert mi_lcair.load("./scene.xml").fingerprint == before
