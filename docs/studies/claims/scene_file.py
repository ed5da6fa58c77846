"""Text of a scene file: shapes that are placed, scaled and turned together."""

import re
from dataclasses import dataclass, field, replace
from pathlib import Path

import mitsuba as mi
import numpy as np

from docs.studies.claims.planck import BANDS_UM

PIXELS = 8  # along each side of the film
HEAD = """<scene version="3.0.0">
    <default name="band" value="{band}"/>
    <integrator type="bounce_path">
        <integer name="max_bounces" value="{bounces}"/>
        <string name="emitter_sampling" value="{sampling}"/> <string name="closure" value="none"/>
    </integrator>
"""
SENSOR = """    <sensor type="{kind}">
        <transform name="to_world"> <matrix value="{matrix}"/> </transform>
        <float name="near_clip" value="{near!r}"/> <float name="far_clip" value="{far!r}"/>
        {lens}
        <film type="hdrfilm">
            <integer name="width" value="{pixels}"/> <integer name="height" value="{pixels}"/>
            <string name="pixel_format" value="luminance"/> <rfilter type="box"/>
        </film>
    </sensor>
"""
PLY = """ply
format binary_little_endian 1.0
element vertex {vertices}
property float x
property float y
property float z
element face {faces}
property list uchar int vertex_indices
{attribute}end_header
"""
NAMED = re.compile(r'<bsdf type="\w+" id="(\w+)">.*?</bsdf>')
UP = np.array([0.0, 0.0, 1.0])
SUN_UM, SUN_SPECTRAL = np.arange(0.5, 15.01, 0.1), 30.0  # of the sun's table; W m^-2 um^-1
WIDEST = 5.0  # largest half of a window of a camera with a lens, in distances
APERTURE = 0.05  # radius of a lens, in distances
FARTHEST = 5e8  # radius of a room; the loader refuses shapes beyond 1e9 m


@dataclass(frozen=True)
class Place:
    """Where the whole scene stands: points p become scale * rotation @ p + shift [m].

    rotation: may be a reflection. halves: whether rectangles without a texture are written as two.
    """

    scale: float = 1.0
    rotation: np.ndarray = field(default_factory=lambda: np.eye(3))
    shift: np.ndarray = field(default_factory=lambda: np.zeros(3))
    halves: bool = False

    @property
    def side(self) -> float:
        """-1 for a reflection, which turns front sides to the back, else 1."""
        return float(np.sign(np.linalg.det(self.rotation)))

    def points(self, points) -> np.ndarray:
        return self.scale * self.vectors(points) + self.shift

    def vectors(self, vectors) -> np.ndarray:
        return np.asarray(vectors, float) @ self.rotation.T


def matrix_text(columns, origin) -> str:
    """The 16 numbers of the transform with these columns, (3, 3), and this origin, (3,)."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = np.transpose(columns), origin
    return " ".join(repr(float(value)) for value in matrix.ravel())


def diffuse(reflectance: float, name: str = "") -> str:
    """BSDF `diffuse`; a name makes the reflectance a parameter."""
    label = f' id="{name}"' if name else ""
    return (
        f'<bsdf type="diffuse"{label}> <spectrum name="reflectance" value="{reflectance!r}"/> '
        "</bsdf>"
    )


BLACK = diffuse(0.0)


def mirror(reflectance: float) -> str:
    return (
        '<bsdf type="conductor"> <string name="material" value="none"/> '
        f'<spectrum name="specular_reflectance" value="{reflectance!r}"/> </bsdf>'
    )


def plume(transmittance: float) -> str:
    return f'<bsdf type="plume"> <float name="transmittance" value="{transmittance!r}"/> </bsdf>'


def thermal(group: str, temperature: float, facet_type: str = "model") -> str:
    return (
        '<emitter type="thermal"> <string name="band" value="$band"/> '
        f'<float name="temperature" value="{temperature!r}"/> <string name="group" '
        f'value="{group}"/> <string name="facet_type" value="{facet_type}"/> </emitter>'
    )


def of_texture(group: str, texture: str) -> str:
    """Emitter whose temperature is a texture."""
    return (
        f'<emitter type="thermal"> <string name="band" value="$band"/> {texture} '
        f'<string name="group" value="{group}"/> </emitter>'
    )


class SceneFile:
    """Shapes, lights and the sensor of a scene file, in coordinates before `place`."""

    def __init__(self, place: Place):
        self.place, self.parts = place, []
        self.meshes, self.texts, self.bitmaps = {}, {}, {}  # files by name
        self.sensors = 1

    def shape(self, kind: str, inside: str, transform: str = "") -> None:
        to_world = f'<transform name="to_world"> {transform} </transform>' if transform else ""
        self.parts.append(f'    <shape type="{kind}"> {to_world} {inside} </shape>\n')

    def rectangle(self, centre, u, v, inside: str, kind: str = "rectangle") -> None:
        """The rectangle centre +- u +- v, or the disc in it; its front side is that of u x v."""
        if self.place.halves and kind == "rectangle" and "<texture" not in inside:
            self.place, whole = replace(self.place, halves=False), self.place
            for sign in (-1, 1):
                self.rectangle(centre + sign * np.asarray(u) / 2, np.asarray(u) / 2, v, inside)
                inside = NAMED.sub(r'<ref id="\1"/>', inside)  # a name is given once
            self.place = whole
            return
        u, v = (self.place.scale * self.place.vectors(half) for half in (u, v))
        u = self.place.side * u
        normal = np.cross(u, v)
        normal *= np.sqrt(np.linalg.norm(u) * np.linalg.norm(v)) / np.linalg.norm(normal)
        transform = f'<matrix value="{matrix_text((u, v, normal), self.place.points(centre))}"/>'
        self.shape(kind, inside, transform)

    def sphere(self, centre, radius: float, inside: str, inward: bool = False) -> None:
        x, y, z = map(float, self.place.points(centre))
        self.shape(
            "sphere",
            f'<point name="center" x="{x!r}" y="{y!r}" z="{z!r}"/> '
            f'<float name="radius" value="{float(radius * self.place.scale)!r}"/> '
            f'<boolean name="flip_normals" value="{str(inward).lower()}"/> {inside}',
        )

    def mesh(self, polygons, inside: str, temperatures=None) -> None:
        """Polygons, (n, V, 3), each anticlockwise from its front side, as fans of triangles.

        temperatures: those of the polygons, for a `mesh_attribute` face_temperature [K].
        """
        polygons = np.asarray(polygons, float)[:, :: int(self.place.side)]
        count, corners, _ = polygons.shape
        name = f"mesh{len(self.meshes)}.ply"
        first = np.arange(count) * corners
        fan = np.array([[0, k, k + 1] for k in range(1, corners - 1)])
        faces = (first[:, None, None] + fan).reshape(-1, 3)
        points = self.place.points(polygons.reshape(-1, 3)).astype("<f4")
        kinds = [("corners", "u1"), ("vertices", "<i4", 3), ("temperature", "<f4")]
        table = np.zeros(len(faces), kinds if temperatures is not None else kinds[:2])
        table["corners"], table["vertices"] = 3, faces
        if temperatures is not None:
            table["temperature"] = np.repeat(temperatures, len(fan))
        head = PLY.format(
            vertices=count * corners,
            faces=len(faces),
            attribute="" if temperatures is None else "property float temperature_0\n",
        )
        self.meshes[name] = head.encode() + points.tobytes() + table.tobytes()
        self.shape(
            "ply",
            f'<string name="filename" value="{name}"/> '
            f'<boolean name="face_normals" value="true"/> {inside}',
        )

    def room(self, centre, radius: float, group: str, temperature: float) -> None:
        """A black sphere around everything, which is sky."""
        radius = min(radius, FARTHEST / self.place.scale)
        self.sphere(centre, radius, BLACK + thermal(group, temperature, "sky"), inward=True)

    def sun(self, direction, band: str) -> float:
        """The sun in a direction. Returns its irradiance in the band [W m^-2]."""
        name = "sun.csv"
        self.texts[name] = "wavelength_um,irradiance_W_m2_um\n" + "".join(
            f"{um:.1f},{SUN_SPECTRAL}\n" for um in SUN_UM
        )
        x, y, z = self.place.vectors(direction)
        azimuth, elevation = np.degrees([np.arctan2(y, x), np.arcsin(np.clip(z, -1, 1))])
        self.parts.append(
            f'    <emitter type="sun"> <float name="azimuth_deg" value="{float(azimuth)!r}"/> '
            f'<float name="elevation_deg" value="{float(elevation)!r}"/> '
            f'<string name="band" value="$band"/> <string name="air" value="{name}"/> </emitter>\n'
        )
        lower, upper = BANDS_UM[band]
        return SUN_SPECTRAL * (upper - lower)

    def camera(self, eye, direction, up, half_window: float, far: float, lens: str = "") -> None:
        """An orthographic camera whose window is 2 x half_window wide and high.

        lens: kind of a second sensor at the same place that images the same square of the plane
        z = 0; "" for none. The camera then looks down.
        """
        direction = np.asarray(direction, float) / np.linalg.norm(direction)
        left = np.cross(up, direction)
        left /= np.linalg.norm(left)
        axes = [self.place.vectors(axis) for axis in (left, np.cross(direction, left), direction)]
        axes[0] = self.place.side * axes[0]
        half = self.place.scale * half_window
        clips = {
            "near": float(1e-5 * far * self.place.scale),
            "far": float(far * self.place.scale),
            "pixels": PIXELS,
        }

        def sensor(kind: str, *columns, lines: str = "") -> str:
            matrix = matrix_text(columns, self.place.points(eye))
            return SENSOR.format(kind=kind, matrix=matrix, lens=lines, **clips)

        self.parts.append(sensor("orthographic", half * axes[0], half * axes[1], axes[2]))
        if lens and half_window < WIDEST * eye[2]:
            distance = eye[2] * self.place.scale
            angle = 2 * float(np.degrees(np.arctan(half / distance)))
            lines = f'<float name="fov" value="{angle!r}"/>'
            if lens == "thinlens":
                lines += (
                    f' <float name="focus_distance" value="{float(distance)!r}"/> '
                    f'<float name="aperture_radius" value="{float(APERTURE * distance)!r}"/>'
                )
            self.parts.append(sensor(lens, *axes, lines=lines))
            self.sensors += 1

    def write(self, folder: Path, band: str, bounces: int, sampling: str) -> Path:
        """Write the scene and its files into the folder; returns the scene's path."""
        for name, content in self.meshes.items():
            (folder / name).write_bytes(content)
        for name, text in self.texts.items():
            (folder / name).write_text(text, encoding="utf-8")
        for name, image in self.bitmaps.items():
            mi.Bitmap(image.astype(np.float32)).write(str(folder / name))
        path = folder / "adverse.xml"
        head = HEAD.format(band=band, bounces=bounces, sampling=sampling)
        path.write_text(head + "".join(self.parts) + "</scene>\n", encoding="utf-8")
        return path
