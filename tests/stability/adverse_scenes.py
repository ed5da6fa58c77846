"""Small scenes whose radiance hangs on a source that few paths meet, each with its true mean.

All are seen in MWIR by an orthographic camera. A source of 3000 K is 60,000 times as bright as
surroundings of 300 K.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import mitsuba as mi
import numpy as np

import mi_lcair
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.rendering.scene import Scene

HOT, COLD = 3000.0, 300.0  # K
REFLECTANCE = 0.5  # of the diffuse floors
DARK = 0.1  # reflectance of the floor under a mirror

FILE = """<scene version="3.0.0">
    <integrator type="bounce_path">
        <integer name="max_bounces" value="{bounces}"/>
        <boolean name="emitter_sampling" value="{sampling}"/>
    </integrator>
    <sensor type="orthographic">
        <transform name="to_world">
            <scale x="{half_window}" y="{half_window}"/>
            <lookat origin="{eye}" target="{target}" up="0, 1, 0"/>
        </transform>
        <film type="hdrfilm">
            <integer name="width" value="8"/> <integer name="height" value="8"/>
            <string name="pixel_format" value="luminance"/> <rfilter type="box"/>
        </film>
    </sensor>
    {shapes}
</scene>"""
SHAPE = """<shape type="{kind}"> {properties}
        <transform name="to_world"> {place} </transform> {bsdf} {emitter}
    </shape>"""
DIFFUSE = '<bsdf type="diffuse"> <spectrum name="reflectance" value="{:g}"/> </bsdf>'
BLACK = DIFFUSE.format(0)
MIRROR = '<bsdf type="conductor"> <string name="material" value="none"/> </bsdf>'
GLOSS = """<bsdf type="sandford_robertson">
        <float name="epsilon" value="0.05"/> <float name="rho_d" value="0"/>
        <float name="b" value="0.1"/> <float name="e" value="0.0042"/> </bsdf>"""
THERMAL = """<emitter type="thermal"> <string name="band" value="MWIR"/>
        {temperature} </emitter>"""


@dataclass(frozen=True)
class Adverse:
    """A scene and its answer.

    shapes(folder): the scene file's shapes, whose meshes and textures it writes into the folder.
    mean: true mean radiance of the image [W m^-2 sr^-1]; error: its own uncertainty, one standard
    error or a bound, as a fraction of it.
    """

    shapes: Callable[[Path], str]
    mean: float
    error: float = 1e-4
    half_window: float = 0.25
    eye: str = "0, 0, 0.2"
    target: str = "0, 0, 0"
    bounces: int = 1

    def load(self, folder: Path, emitter_sampling: bool) -> Scene:
        (folder / "adverse.xml").write_text(
            FILE.format(
                bounces=self.bounces,
                sampling=str(emitter_sampling).lower(),
                half_window=self.half_window,
                eye=self.eye,
                target=self.target,
                shapes=self.shapes(folder),
            )
        )
        return mi_lcair.load(folder / "adverse.xml")


def radiance(temperature: float) -> float:
    return float(in_band_radiance(band("MWIR"), temperature))


def at(temperature: float) -> str:
    return THERMAL.format(temperature=f'<float name="temperature" value="{temperature:g}"/>')


def shape(kind, place, bsdf, emitter="", properties=""):
    return SHAPE.format(kind=kind, place=place, bsdf=bsdf, emitter=emitter, properties=properties)


def square(side, x=0.0, y=0.0, z=0.0, down=False):
    """Transform of a horizontal square of that side [m]."""
    turn = '<rotate x="1" angle="180"/>' if down else ""
    return f'<scale value="{side / 2:g}"/> {turn} <translate x="{x:g}" y="{y:g}" z="{z:g}"/>'


FLOOR = shape("rectangle", square(4), DIFFUSE.format(REFLECTANCE), at(COLD))
FLOOR_RADIANCE = (1 - REFLECTANCE) * radiance(COLD)


def lit_floor(patches, half_window):
    """Mean radiance that the floor reflects from small patches (x, y, z, area, radiance) which look
    down.
    """
    x = (np.arange(400) + 0.5) / 200 * half_window - half_window
    x, y = np.meshgrid(x, x)
    total = 0.0
    for px, py, pz, area, source in patches:
        d2 = (x - px) ** 2 + (y - py) ** 2 + pz**2
        total += REFLECTANCE / np.pi * source * area * np.mean(pz**2 / d2**2)
    return total


# ------------------------ In direct sight ------------------------


def speck(folder):
    """6 mm at 3000 K, 1 cm above a blackbody that fills the window."""
    return shape("rectangle", square(2), BLACK, at(COLD)) + shape(
        "rectangle", square(0.006, x=0.1, y=0.2, z=0.01), BLACK, at(HOT)
    )


def slit(folder):
    """A cold cover of two plates with a slit of 0.02 mm x 1 m between them, and 3000 K behind."""
    half = '<scale x="0.499995" y="0.5"/>'
    plates = (
        shape("rectangle", f'{half} <translate x="{x}"/>', BLACK, at(COLD))
        for x in (-0.500005, 0.500005)
    )
    return "".join(plates) + shape("rectangle", square(2, z=-0.01), BLACK, at(HOT))


# -------------------- By reflection in a mirror --------------------


def mirrored_speck(folder):
    """Half of the window shows a mirror, in which a source of 6 mm behind the camera is seen, the
    other half a blackbody.
    """
    mirror = '<scale x="0.25" y="0.5"/> <translate x="-0.25"/>'
    black = '<scale x="0.25" y="0.5"/> <translate x="0.25"/>'
    return (
        shape("rectangle", mirror, MIRROR)
        + shape("rectangle", black, BLACK, at(COLD))
        + shape("rectangle", square(0.006, x=-0.2, y=0.1, z=1, down=True), BLACK, at(HOT))
    )


def caustic(folder):
    """A source of 8 mm on the floor of a hemispherical mirror of 1 m, 10 cm off its centre, looks
    up. All that it sends falls on the dark floor around its image, and of the share DARK that this
    reflects the mirror brings all to the source's side of the floor, outside the window, and back.
    """
    return (
        shape(
            "sphere",
            '<scale value="1"/>',
            MIRROR,
            "",
            '<boolean name="flip_normals" value="true"/>',
        )
        + shape("disk", '<scale value="1"/>', DIFFUSE.format(DARK), at(COLD))
        + shape("rectangle", square(0.008, x=0.1, z=1e-3), BLACK, at(HOT))
    )


def mirror_chain(folder):
    """Two glossy plates at right angles, of lobe width e = 0.0042, and a source of 4 mm that is
    seen in the first by way of the second, beside the camera.
    """
    return (
        shape("rectangle", '<scale value="0.25"/>', GLOSS, at(COLD))
        + shape(
            "rectangle",
            '<scale value="0.25"/> <rotate y="1" angle="-90"/> <translate x="0.25" z="0.25"/>',
            GLOSS,
            at(COLD),
        )
        + shape(
            "rectangle",
            '<scale value="0.002"/> <rotate y="1" angle="135"/> <translate x="-0.6" z="0.9"/>',
            BLACK,
            at(HOT),
        )
    )


# ------------------------ By a diffuse floor ------------------------

HEIGHT = 0.5  # m, of the sources above the floor


def area_source(folder):
    """Mitsuba's own `area` emitter, 4 mm."""
    emitter = (
        f'<emitter type="area"> <spectrum name="radiance" value="{radiance(HOT):.9g}"/> </emitter>'
    )
    return FLOOR + shape("rectangle", square(0.004, z=HEIGHT, down=True), BLACK, emitter)


TEXELS = 32
PLATE = 0.2  # m, side of the plates that have one hot spot


def textured_source(folder):
    """A plate whose temperature is a bitmap: 300 K, with one texel of 3000 K."""
    texture = np.full((TEXELS, TEXELS), COLD, dtype=np.float32)
    texture[5, 20] = HOT
    mi.Bitmap(texture).write(str(folder / "temperature.exr"))
    temperature = """<texture name="temperature" type="bitmap">
        <string name="filename" value="temperature.exr"/>
        <string name="filter_type" value="nearest"/> <boolean name="raw" value="true"/>
        </texture>"""
    emitter = THERMAL.format(temperature=temperature)
    return FLOOR + shape("rectangle", square(PLATE, z=HEIGHT, down=True), BLACK, emitter)


def cells(count, hot=()):
    """The plate as patches, those numbered in `hot` at 3000 K."""
    middles = ((np.arange(count) + 0.5) / count - 0.5) * PLATE
    area = (PLATE / count) ** 2
    for i, x in enumerate(middles):
        for j, y in enumerate(middles):
            yield x, y, HEIGHT, area, radiance(HOT if (i, j) in hot else COLD)


SIDE, HOT_FACET = 200, 23_456  # rows and columns of squares, each two facets


def hot_facet(folder):
    """One of 80,000 facets of a plate at 3000 K, the others at 300 K."""
    vertices, faces = grid(SIDE, PLATE, HEIGHT)
    mesh = mi.Mesh("plate", len(vertices), len(faces))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = vertices.ravel().astype(np.float32)
    parameters["faces"] = faces.ravel().astype(np.uint32)
    parameters.update()
    temperature = np.full(len(faces), COLD)
    temperature[HOT_FACET] = HOT
    mesh.add_attribute("face_temperature", 1, temperature.tolist())
    mesh.write_ply(str(folder / "plate.ply"))
    texture = """<texture name="temperature" type="mesh_attribute">
        <string name="name" value="face_temperature"/> </texture>"""
    file = '<string name="filename" value="plate.ply"/> <boolean name="face_normals" value="true"/>'
    emitter = THERMAL.format(temperature=texture)
    return FLOOR + shape("ply", "", BLACK, emitter, file)


def grid(count, side, height):
    """Vertices and triangles of a horizontal square that looks down."""
    x = (np.arange(count + 1) / count - 0.5) * side
    vertices = np.stack([*np.meshgrid(x, x, indexing="ij"), np.full((len(x),) * 2, height)], -1)
    i, j = (index.ravel() for index in np.meshgrid(range(count), range(count), indexing="ij"))
    a, b, c, d = ((i + k) * (count + 1) + j + m for k, m in ((0, 0), (1, 0), (1, 1), (0, 1)))
    faces = np.concatenate([np.stack([a, c, b], 1), np.stack([a, d, c], 1)])
    return vertices.reshape(-1, 3), faces


def hot_facet_patches():
    vertices, faces = grid(SIDE, PLATE, HEIGHT)
    x, y, z = vertices[faces[HOT_FACET]].mean(axis=0)
    yield x, y, z, 0.5 * (PLATE / SIDE) ** 2, radiance(HOT) - radiance(COLD)
    yield from cells(20)


def keyhole(folder):
    """A source of 20 mm above a black screen with a hole of 4 mm, through which it lights a spot of
    the floor.
    """
    sides = (
        '<scale x="0.499" y="1"/> <rotate x="1" angle="180"/> <translate x="{}" z="0.25"/>',
        '<scale x="0.002" y="0.499"/> <rotate x="1" angle="180"/> <translate y="{}" z="0.25"/>',
    )
    screen = (
        shape("rectangle", side.format(sign * place), BLACK)
        for side, place in zip(sides, (0.501, 0.501))
        for sign in (-1, 1)
    )
    return (
        FLOOR
        + "".join(screen)
        + shape("rectangle", square(0.02, z=HEIGHT, down=True), BLACK, at(HOT))
    )


def window(half):
    return (2 * half) ** 2


HOLE, SOURCE = 0.004, 0.02  # m

ADVERSE = {
    "speck": Adverse(
        speck,
        radiance(COLD) + (radiance(HOT) - radiance(COLD)) * 0.006**2 / window(1),
        half_window=1,
    ),
    "slit": Adverse(
        slit, radiance(COLD) + (radiance(HOT) - radiance(COLD)) * 2e-5, 5e-3, half_window=0.5
    ),
    "mirrored_speck": Adverse(
        mirrored_speck,
        radiance(COLD) / 2 + radiance(HOT) * 0.006**2 / window(0.5),
        half_window=0.5,
    ),
    "caustic": Adverse(
        caustic,
        radiance(COLD) + DARK / (1 - DARK**2) * radiance(HOT) * 0.008**2 / window(0.25),
        2e-3,
        eye="-0.2, 0, 0.2",
        target="-0.2, 0, 0",
        bounces=8,
    ),
    # the mean of 50 renders of 8 million paths; a mirror instead of the lobe would give 6.83
    "mirror_chain": Adverse(mirror_chain, 6.668, 1.6e-3, eye="-0.5, 0, 0.5", bounces=3),
    "area_source": Adverse(
        area_source,
        FLOOR_RADIANCE + lit_floor([(0, 0, HEIGHT, 0.004**2, radiance(HOT))], 0.25),
    ),
    "textured_source": Adverse(
        textured_source,
        FLOOR_RADIANCE + lit_floor(cells(TEXELS, [(20, 5)]), 0.25),
        1e-3,
    ),
    "hot_facet": Adverse(hot_facet, FLOOR_RADIANCE + lit_floor(hot_facet_patches(), 0.25), 1e-3),
    "keyhole": Adverse(
        keyhole,
        FLOOR_RADIANCE
        + REFLECTANCE / np.pi * radiance(HOT) * SOURCE**2 * HOLE**2 / 0.25**2 / window(0.25),
        2e-3,
    ),
}
