"""The width of a narrow lobe from one image of what it reflects."""

import mitsuba as mi
import numpy as np
import pytest

import mi_lcair
from mi_lcair.inversion.data.images import noise_of_netd
from tests.sensitivity.dark_scenes import EMITTER, plate

mi.set_variant("llvm_ad_mono")
NETD_MK = 50
BALL = """<shape type="sphere"> <float name="radius" value="0.3"/>
    <point name="center" x="-0.6" y="0" z="0.6"/>
    <bsdf type="diffuse" id="ball"> <spectrum name="reflectance" value="0.1"/> </bsdf>
    {emitter} </shape> </scene>"""


@pytest.mark.slow
@pytest.mark.parametrize("e", [0.004, 0.03])
@pytest.mark.parametrize("start", [0.6, 1.5])
def test_width_of_gloss_black(tmp_path, e, start):
    """A ball of 450 K is reflected. Two draws of the camera's noise."""
    values = (0.88, 0.00075, 0.16, e)
    text = plate("sandford_robertson", values, 3, 320.0, 260.0).text
    ball = BALL.format(emitter=EMITTER.format(T=450, group="ball", kind="model"))
    path = tmp_path / "plate.xml"
    path.write_text(text.replace('value="8"', 'value="32"').replace("</scene>", ball))
    scene = mi_lcair.load(path)
    clean = mi_lcair.render(scene, spp=4096, seed=99, split=None).channels["Y"].astype(float)
    sigma = noise_of_netd(scene.band, clean, NETD_MK)
    for draw in range(2):
        noise = sigma * np.random.default_rng(draw).standard_normal(clean.shape)
        np.save(tmp_path / "image.npy", clean + noise)
        datum = {
            "name": "one",
            "scene": str(path),
            "image": str(tmp_path / "image.npy"),
            "quantity": "radiance",
            "netd_mK": NETD_MK,
        }
        problem = {
            "data": [datum],
            "unknowns": {"paint.e": {"start": start * e}},
            "render": {"spp": 1024, "seed": draw},
        }
        (answer,) = mi_lcair.invert(problem, advise=False).answers
        assert answer.verdict == "determined"
        assert abs(answer.value - e) < 3 * answer.standard_error
        assert answer.standard_error < 0.03 * e
