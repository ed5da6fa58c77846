"""Six grey strips in a corner, which reflect each other, and synthetic measurements of them."""

import numpy as np

import mi_lcair
from mi_lcair.knowing.inversion.data.readings import noise_of_netd

KELVIN = (290.0, 300.0, 310.0, 320.0, 330.0, 340.0)
NAMES = tuple(f"s{number}.temperature" for number in range(len(KELVIN)))
NETD_MK = 50
EXACT = {"camera_sigma": "0", "model_sigma": "0"}  # of a camera and a scene without faults
# Rotations that take the floor z = 0 to the walls x = 0 and y = 0
TURNS = (
    "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1",
    "0 0 1 0 1 0 0 0 0 1 0 0 0 0 0 1",
    ("0 1 0 0 0 0 1 0 1 0 0 0 0 0 0 1"),
)
STRIP = """<shape type="rectangle">
    <transform name="to_world"> <scale x="0.5" y="0.25"/> <translate x="0.5" y="{y}"/>
    <matrix value="{turn}"/> </transform>
    <bsdf type="diffuse" id="paint{number}"> <spectrum name="reflectance" value="$R{number}"/>
    </bsdf>
    <emitter type="thermal"> <string name="band" value="$band"/>
    <float name="temperature" value="{kelvin}"/> <string name="group" value="s{number}"/> </emitter>
</shape>"""
XML = """<scene version="3.0.0">
{defaults} <default name="band" value="LWIR"/>
<default name="size" value="16"/> <default name="spp" value="16"/>
<default name="half" value="0.4"/>
<integrator type="bounce_path"> <integer name="max_bounces" value="6"/> </integrator>
<sensor type="orthographic">
    <transform name="to_world"> <scale x="$half" y="$half"/>
    <lookat origin="2, 2, 2" target="0, 0, 0" up="0, 0, 1"/> </transform>
    <film type="hdrfilm"> <integer name="width" value="$size"/>
    <integer name="height" value="$size"/> <string name="pixel_format" value="luminance"/>
    <string name="component_format" value="float32"/> <rfilter type="box"/> </film>
    <sampler type="lattice"> <integer name="sample_count" value="$spp"/> </sampler>
</sensor>
{strips}
</scene>"""


def write_scene(folder) -> str:
    """Write the scene; return its path."""
    strips = [
        STRIP.format(number=number, y=0.25 + 0.5 * (number % 2), turn=TURNS[number // 2], kelvin=T)
        for number, T in enumerate(KELVIN)
    ]
    defaults = "".join(f'<default name="R{k}" value="0.3"/>' for k in range(len(KELVIN)))
    path = folder / "corner.xml"
    path.write_text(XML.replace("{strips}", "\n".join(strips)).replace("{defaults}", defaults))
    return str(path)


def clean(path, spp: int = 2**13, **parameters) -> np.ndarray:
    """The radiance of the scene without a camera's noise."""
    scene = mi_lcair.load(path, **parameters)
    return mi_lcair.render(scene, spp=spp, seed=99).channels["Y"].astype(float)


def reflectances(values) -> dict:
    """Parameters of the scene for other reflectances of the strips."""
    return {f"R{number}": float(R) for number, R in enumerate(values)}


def problem(folder, path, image, start, draw: int, **render) -> dict:
    """The problem of the six temperatures, each from the same first guess, in one draw."""
    scene = mi_lcair.load(path)
    sigma = noise_of_netd(scene.band, image, NETD_MK)
    noise = np.random.default_rng((draw, 3)).standard_normal(image.shape)
    np.save(folder / f"corner{draw}.npy", image + sigma * noise)
    return {
        "data": [
            {
                "scene": path,
                "image": str(folder / f"corner{draw}.npy"),
                "quantity": "radiance",
                "netd_mK": NETD_MK,
                **EXACT,
            }
        ],
        "unknowns": {name: {"start": start} for name in NAMES},
        "render": {"seed": 100 + draw} | render,
    }


SCENARIO = """[target]
scene = "corner.xml"
[observer]
range_m = 300
azimuth_deg = 45
elevation_deg = 35
[atmosphere]
table = "{air}"
[background]
temperature = 285
[sensor]
band = "LWIR"
[render]
max_bounces = [4]
[camera]
focal_length_mm = 60
f_number = 2
pitch_um = 15
width = 24
height = 24
integration_time_ms = 0.2
well_Me = 20
quantum_efficiency = 0.6
read_noise_e = 300
defocus_um = 20
"""


def write_scenario(folder, air: str = "vacuum") -> str:
    """Write the corner's scene, and the scenario in which a camera sees it; return its path."""
    write_scene(folder)
    path = folder / "corner.toml"
    path.write_text(SCENARIO.format(air=air))
    return str(path)
