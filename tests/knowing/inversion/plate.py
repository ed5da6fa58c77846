"""A grey plate under a warm sky, and synthetic measurements of it."""

import numpy as np

import mi_lcair
from mi_lcair.knowing.inversion.data.readings import noise_of_netd
from tests.knowing.inversion.corner import EXACT

# The plate fills the image. Its radiance is (1 - R) B(T) + R B(S), without noise of the render.
XML = """<scene version="3.0.0">
<default name="T" value="310"/> <default name="R" value="0.3"/> <default name="S" value="290"/>
<default name="band" value="LWIR"/> <default name="size" value="16"/>
<integrator type="bounce_path"> <integer name="max_bounces" value="1"/> </integrator>
<sensor type="orthographic">
    <transform name="to_world"> <scale x="0.5" y="0.5"/>
    <lookat origin="0, 0, 0.9" target="0, 0, 0" up="0, 1, 0"/> </transform>
    <film type="hdrfilm"> <integer name="width" value="$size"/>
    <integer name="height" value="$size"/> <string name="pixel_format" value="luminance"/>
    <string name="component_format" value="float32"/> <rfilter type="box"/> </film>
    <sampler type="lattice"> <integer name="sample_count" value="16"/> </sampler>
</sensor>
<shape type="rectangle">
    <bsdf type="diffuse" id="paint"> <spectrum name="reflectance" value="$R"/> </bsdf>
    <emitter type="thermal"> <string name="band" value="$band"/>
    <float name="temperature" value="$T"/> <string name="group" value="plate"/> </emitter>
</shape>
<shape type="sphere">
    <float name="radius" value="20"/> <boolean name="flip_normals" value="true"/>
    <bsdf type="diffuse" id="black"> <spectrum name="reflectance" value="0"/> </bsdf>
    <emitter type="thermal"> <string name="band" value="$band"/>
    <float name="temperature" value="$S"/> <string name="group" value="sky"/>
    <string name="facet_type" value="sky"/> </emitter>
</shape>
</scene>"""
UNKNOWNS = {"plate.temperature": {}, "paint.reflectance": {}}


def write_scene(folder):
    (folder / "plate.xml").write_text(XML)
    return str(folder / "plate.xml")


def measured(path, seed: int, netd_mK: float = 50, **parameters):
    """The radiance of a scene with a camera's noise, and its standard deviation."""
    scene = mi_lcair.load(path, **parameters)
    radiance = mi_lcair.render(scene, spp=64, seed=11).channels["Y"].astype(float)
    sigma = noise_of_netd(scene.band, radiance, netd_mK)
    return radiance + sigma * np.random.default_rng(seed).standard_normal(radiance.shape), sigma


def datum(folder, name: str, seed: int, state: str = "", start: dict | None = None, **parameters):
    """An entry of [[data]]: an image in a file, and the scene with another first guess."""
    path = str(folder / "plate.xml")
    np.save(folder / f"{name}.npy", measured(path, seed, **parameters)[0])
    return {
        "name": name,
        "scene": path,
        "parameters": parameters | {"T": 305.0, "R": 0.4} | (start or {}),
        "image": str(folder / f"{name}.npy"),
        "quantity": "radiance",
        "netd_mK": 50,
        "state": state,
        **EXACT,
    }
