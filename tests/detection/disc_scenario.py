"""A scenario whose contrast has a closed form: a blackbody disc that faces +x."""

from pathlib import Path

import mitsuba as mi
import numpy as np

from mi_lcair.detection.scenario import Scenario

RIM, RINGS, RADIUS = 60, 8, 2.0
AREA = RIM / 2 * np.sin(2 * np.pi / RIM) * RADIUS**2  # area of the disc's polygon, m^2
XML = """<scene version="3.0.0">
    <default name="band" value="MWIR"/> <default name="temperature" value="400"/>
    <integrator type="bounce_path"> <integer name="max_bounces" value="1"/> </integrator>
    <sensor type="orthographic">
        <film type="hdrfilm"> <string name="pixel_format" value="luminance"/> </film>
    </sensor>
    <shape type="ply">
        <string name="filename" value="disc.ply"/> <boolean name="face_normals" value="true"/>
        <bsdf type="sandford_robertson">
            <string name="material" value="blackbody"/> <string name="band" value="$band"/>
        </bsdf>
        <emitter type="thermal"> <string name="band" value="$band"/> TEMPERATURE </emitter>
    </shape>
</scene>"""
ONE = '<float name="temperature" value="$temperature"/>'
MANY = """<texture type="mesh_attribute" name="temperature">
            <string name="name" value="face_temperature"/>
        </texture>"""
TOML = """# A disc.
[target]
scene = "disc.xml"
[observer]
range_m = 1000
azimuth_deg = 0
elevation_deg = 0
[atmosphere]
table = "vacuum"
[background]
temperature = 294
[sensor]
band = "MWIR"
"""


def triangles():
    """Corners of the disc's triangles, shape (n, 3, 3), in rings around the centre."""
    angle = 2 * np.pi * np.arange(RIM + 1) / RIM
    edge = np.column_stack([0 * angle, np.cos(angle), np.sin(angle)])
    corners = []
    for inner, outer in zip(np.arange(RINGS), np.arange(1, RINGS + 1)):
        a, b = edge * RADIUS * inner / RINGS, edge * RADIUS * outer / RINGS
        corners += [np.array([a[k], b[k], b[k + 1]]) for k in range(RIM)]
        if inner:
            corners += [np.array([a[k], b[k + 1], a[k + 1]]) for k in range(RIM)]
    return np.array(corners)


def write_disc(folder: Path, temperatures=None) -> Path:
    """Write disc.ply, disc.xml and disc.toml, and return the path of the scenario.

    `temperatures` are those of the triangles, K. Without them the scene has a parameter for one.
    """
    corners = triangles()
    mesh = mi.Mesh("disc", 3 * len(corners), len(corners))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = corners.astype(np.float32).ravel()
    parameters["faces"] = np.arange(3 * len(corners), dtype=np.uint32)
    parameters.update()
    if temperatures is not None:
        mesh.add_attribute("face_temperature", 1, list(map(float, temperatures)))
    mesh.write_ply(str(folder / "disc.ply"))
    (folder / "disc.xml").write_text(
        XML.replace("TEMPERATURE", ONE if temperatures is None else MANY)
    )
    (folder / "disc.toml").write_text(f"{TOML}[render]\nresolution = 64\n")
    return folder / "disc.toml"


def disc(folder: Path, **changes) -> Scenario:
    """The scenario of the disc. Dots in the keys of changes are written as two underscores."""
    return Scenario.read(
        folder / "disc.toml", **{key.replace("__", "."): value for key, value in changes.items()}
    )


SUN = """<emitter type="sun"> <string name="band" value="MWIR"/>
    <float name="azimuth_deg" value="30"/> <float name="elevation_deg" value="45"/>
    <string name="air" value="{air}"/> </emitter></scene>"""


def lit(folder, air="us_standard"):
    """A white diffuse disc at 0 K, but for its temperature of 1 K, in the sun."""
    write_disc(folder)
    text = (folder / "disc.xml").read_text().replace("</scene>", SUN.format(air=air))
    text = text.replace(
        '<string name="material" value="blackbody"/> <string name="band" value="$band"/>',
        '<float name="epsilon" value="0"/> <float name="rho_d" value="1"/>'
        '<float name="b" value="0"/> <float name="e" value="1"/>',
    )
    (folder / "disc.xml").write_text(text)
    return folder
