"""Derivatives with respect to a narrow lobe of a curved surface, which mirrors edges."""

import mitsuba as mi
import numpy as np

import mi_lcair
from mi_lcair.plugins.columns import tables
from tests.derivatives.dark_scenes import EMITTER, plate

mi.set_variant("llvm_ad_mono")
RANDOMISATIONS = 8
PLATE = 'type="rectangle" id="shape_of_plate"> <transform name="to_world"> <scale value="2"/>'
BALL = 'type="sphere" id="ball"> <transform name="to_world"> <scale value="0.3"/>'
LAMP = """<shape type="rectangle"> <transform name="to_world"> <scale value="0.4"/>
    <lookat origin="2, {y}, 1.5" target="0, 0, 0" up="0, 1, 0"/> </transform>
    <bsdf type="diffuse"> <spectrum name="reflectance" value="0.04"/> </bsdf> {emitter} </shape>"""


def test_mirror_directions_take_noise_away(tmp_path, monkeypatch):
    """A pixel mirrors far more of two lamps than the lobe is wide.

    The sums of the images are the same without the mirror directions, and the noise is larger.
    """
    text = plate("sandford_robertson", (0.88, 0.00075, 0.16, 0.005), 2, 300.0, 260.0).text
    lamps = [
        LAMP.format(y=y, emitter=EMITTER.format(T=340, group="lamps", kind="terrain"))
        for y in (-1.5, 1.5)
    ]
    path = tmp_path / "ball.xml"
    path.write_text(text.replace(PLATE, BALL).replace("</scene>", "\n".join([*lamps, "</scene>"])))
    scene, sums, noise, methods = mi_lcair.load(path), [], [], []
    for narrow in (tables.NARROW, 0.0):
        monkeypatch.setattr(tables, "NARROW", narrow)
        images = mi_lcair.derivative_images(
            scene, ["paint.e"], spp=64 * RANDOMISATIONS, randomisations=RANDOMISATIONS
        )
        derivatives = images.derivatives[:, 0].astype(float)
        methods += images.method
        sums.append(derivatives.sum(axis=(1, 2)))
        noise.append(derivatives.var(axis=0, ddof=1).sum())
    assert methods == ["mirror", "control variate"]
    error = np.hypot(*(of.std(ddof=1) for of in sums)) / np.sqrt(RANDOMISATIONS)
    assert abs(sums[0].mean() - sums[1].mean()) < 4 * error
    assert noise[1] > 1.5 * noise[0]
