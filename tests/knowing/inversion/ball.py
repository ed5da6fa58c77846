"""A plate of gloss black that mirrors a hot ball, and synthetic measurements of it."""

import numpy as np

import mi_lcair
from mi_lcair.knowing.inversion.data.readings import noise_of_netd
from tests.derivatives.dark_scenes import EMITTER, plate
from tests.knowing.inversion.corner import EXACT

NETD_MK = 50
BALL = """<shape type="sphere"> <float name="radius" value="0.3"/>
    <point name="center" x="-0.6" y="0" z="0.6"/>
    <bsdf type="diffuse" id="ball"> <spectrum name="reflectance" value="0.1"/> </bsdf>
    {emitter} </shape> </scene>"""


def write_scene(folder, e: float) -> str:
    """Write the scene of a plate with the lobe's width e; return its path."""
    text = plate("sandford_robertson", (0.88, 0.00075, 0.16, e), 3, 320.0, 260.0).text
    ball = BALL.format(emitter=EMITTER.format(T=450, group="ball", kind="model"))
    path = folder / "ball.xml"
    path.write_text(text.replace('value="8"', 'value="32"').replace("</scene>", ball))
    return str(path)


def problem(folder, path: str, image: np.ndarray, start: float, draw: int) -> dict:
    """The problem of the width, from one draw of the camera's noise."""
    sigma = noise_of_netd(mi_lcair.load(path).band, image, NETD_MK)
    np.save(
        folder / "ball.npy", image + sigma * np.random.default_rng(draw).normal(size=image.shape)
    )
    datum = {
        "scene": path,
        "image": str(folder / "ball.npy"),
        "quantity": "radiance",
        "netd_mK": NETD_MK,
        **EXACT,
    }
    return {
        "data": [datum],
        "unknowns": {"paint.e": {"start": start}},
        "render": {"spp": 1024, "seed": draw},
    }
