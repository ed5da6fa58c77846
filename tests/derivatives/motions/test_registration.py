"""A measured image is registered: shifts, turn and pitch as the unknowns of an inversion."""

import numpy as np
import pytest

import mi_lcair
from mi_lcair.rendering.parameters.values import changed
from tests.derivatives.motions.test_differences import CUBE, convex_hull

TRUTH = {
    "observer.x_px": 0.7,
    "observer.y_px": -0.4,
    "observer.roll_deg": 0.8,
    "model.pitch_deg": 2.3,
}
SCENE = """<scene version="3.0.0">
<integrator type="bounce_path"><integer name="max_bounces" value="0"/></integrator>
<sensor type="orthographic">
  <float name="near_clip" value="1"/>
  <transform name="to_world">
    <scale x="0.72" y="0.72"/> <lookat origin="9.4, 1, 3.4" target="0, 0, 0" up="0, 0, 1"/>
  </transform>
  <film type="hdrfilm">
    <integer name="width" value="40"/> <integer name="height" value="40"/>
    <string name="pixel_format" value="luminance"/>
    <string name="component_format" value="float32"/> <rfilter type="box"/>
  </film>
  <sampler type="lattice"/>
</sensor>
<shape type="ply">
  <string name="filename" value="cube.ply"/> <boolean name="face_normals" value="true"/>
  <bsdf type="diffuse"><float name="reflectance" value="0.3"/></bsdf>
  <emitter type="thermal">
    <string name="band" value="LWIR"/> <float name="temperature" value="300"/>
    <string name="group" value="cube"/>
  </emitter>
</shape>
</scene>"""


NOISE = 1.27  # 2 K at 300 K [W m^-2 sr^-1]


def problem(folder) -> dict:
    """The problem of registering the image in a folder."""
    data = {"scene": str(folder / "cube.xml"), "image": str(folder / "image.npy")}
    return {
        "data": [data | {"quantity": "radiance", "sigma": NOISE}],
        "unknowns": {name: {} for name in TRUTH},
        "render": {"spp": 64},
    }


@pytest.mark.slow
def test_registration(tmp_path):
    convex_hull("cube", CUBE).write_ply(str(tmp_path / "cube.ply"))
    (tmp_path / "cube.xml").write_text(SCENE)
    scene = mi_lcair.load(tmp_path / "cube.xml")
    with changed(scene, TRUTH):
        image = mi_lcair.render(scene, spp=2048, seed=77).channels["Y"].astype(float)
    np.save(tmp_path / "image.npy", image + np.random.default_rng(1).normal(0, NOISE, image.shape))
    table = mi_lcair.invert(problem(tmp_path)).columns()
    error = np.abs(np.array(table["value"]) - [TRUTH[name] for name in table["unknown"]])
    stated = np.array(table["standard_error"])
    assert np.all(error < 4 * stated)
    assert np.all(stated < [0.01, 0.01, 0.05, 0.05])
