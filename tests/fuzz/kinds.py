"""The kinds of file that are mutated: one entry each in `KINDS`."""

import math
import re
import tempfile
from pathlib import Path

import numpy as np

import mi_lcair
from mi_lcair import formats
from mi_lcair.models3d import export, read, report
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.plugins.emission.source import Source
from mi_lcair.rendering.views import View
from mi_lcair.signatures.view_areas import ViewAreas
from tests.fuzz.mutants import Kind
from tests.fuzz.result_kinds import RESULT_KINDS
from tests.fuzz.text_kinds import TEXT_KINDS
from tests.models3d.shapes import cube

MOST_PATHS = 100_000  # a mutant that asks for more is loaded but not rendered

# ---------------------------------------------------------------- Labelled OBJ models


def use_obj(path: Path) -> None:
    """Imports a model and checks that what is reported of it is finite."""
    model = read(path)
    result = report(model)
    assert result["facets"] == model.count >= 1
    assert all(math.isfinite(area) and area >= 0 for area in result["area_by_material"].values())
    with tempfile.TemporaryDirectory() as folder:
        export(model, Path(folder) / "out")


OBJ = Kind(
    "obj",
    ".obj",
    tuple(
        text.encode()
        for text in (
            cube(),
            cube() + cube(at=(2, 0, 0), label="s*blackbody*250*elevation_deg=4.5"),
            "o f*bareAl*300*\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1/1/1 2/2/1 3/3/1 4/4/1\n",
        )
    ),
    use_obj,
    words=tuple(b"v f o g vn 1/1 1//1 / 1/ \\ # f*bareAl*300* t** group=x -1 -9 99999999".split()),
)

# ---------------------------------------------------------------- Models of other programs

BLENDER = Path(__file__).parents[1] / "data" / "blender"


def use_names(path: Path) -> None:
    """Imports a model with a table of names."""
    with tempfile.TemporaryDirectory() as folder:
        model = Path(folder) / "cube.obj"
        model.write_text(cube(label="Hull"))
        assert 60 < read(model, names=path).temperature.min() <= 10_000


NAMES = Kind(
    "names",
    ".csv",
    (
        b"name,type,material,kelvin,group,elevation_deg\nHull.001,s,blackbody,250,ring,4.5\n"
        b"Wing,f,bare_aluminum,300,,\n",
        b"name;kelvin;material\nHull;300,5;gloss_black\n",
    ),
    use_names,
    tuple(b'name type material kelvin group f s t , ; # nan 1e308 Hull Hull.002 .json "'.split()),
)


def use_other_model(path: Path) -> None:
    """Imports a model without labels from a glTF, PLY or STL file."""
    result = report(read(path, material="blackbody", temperature=300.0))
    assert result["facets"] >= 1 and math.isfinite(result["volume"])


GLB, STL, MODEL_PLY = (
    Kind(
        f"model_{suffix}",
        f".{suffix}",
        ((BLENDER / f"plain.{suffix}").read_bytes(),),
        use_other_model,
        tuple(b'"nodes" "mesh":9 "count":-1 "max" {} [] null 1e999 solid facet nan -1'.split()),
    )
    for suffix in ("glb", "stl", "ply")
)

# ---------------------------------------------------------------- Meshes


def ply(ascii: bool = False) -> bytes:
    """A unit square of two triangles, each with its temperature."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "<f4")
    faces = np.zeros(2, [("n", "u1"), ("corners", "<i4", 3), ("temperature", "<f4")])
    faces["n"], faces["corners"], faces["temperature"] = 3, [[0, 1, 2], [0, 2, 3]], (300, 350)
    header = (
        f"ply\nformat {'ascii' if ascii else 'binary_little_endian'} 1.0\nelement vertex 4\n"
        "property float x\nproperty float y\nproperty float z\nelement face 2\n"
        "property list uchar int vertex_indices\nproperty float temperature_0\nend_header\n"
    ).encode()
    if not ascii:
        return header + vertices.tobytes() + faces.tobytes()
    rows = ["{:g} {:g} {:g}".format(*vertex) for vertex in vertices]
    rows += ["3 {} {} {} {}".format(*face["corners"], face["temperature"]) for face in faces]
    return header + "\n".join(rows).encode() + b"\n"


SCENE = """<scene version="3.0.0">
    <default name="temperature" value="300"/>
    <integrator type="bounce_path"> <integer name="max_bounces" value="2"/> </integrator>
    <sensor type="orthographic">
        <transform name="to_world">
            <lookat origin="0.5, 0.5, 2" target="0.5, 0.5, 0" up="0, 1, 0"/>
        </transform>
        <film type="hdrfilm">
            <integer name="width" value="4"/> <integer name="height" value="4"/>
        </film>
        <sampler type="independent"> <integer name="sample_count" value="4"/> </sampler>
    </sensor>
    <bsdf type="sandford_robertson" id="paint">
        <float name="epsilon" value="0.5"/> <float name="rho_d" value="0.1"/>
        <float name="b" value="0.2"/> <float name="e" value="0.3"/>
    </bsdf>
    %s
    <shape type="sphere">
        <point name="center" x="2" y="0" z="0"/> <float name="radius" value="0.5"/>
        <bsdf type="roughconductor"> <float name="alpha" value="0.2"/> </bsdf>
        <emitter type="thermal">
            <string name="band" value="LWIR"/> <float name="temperature" value="$temperature"/>
        </emitter>
    </shape>
    <shape type="rectangle">
        <transform name="to_world"> <scale value="2"/> <translate x="3"/> </transform>
        <bsdf type="diffuse"> <spectrum name="reflectance" value="0.4"/> </bsdf>
    </shape>
</scene>
"""
MESH = """<shape type="%s">
        <string name="filename" value="%s"/> <boolean name="face_normals" value="true"/>
        <ref id="paint"/>
        <emitter type="thermal">
            <string name="band" value="LWIR"/> <string name="group" value="plate"/>
            <texture type="mesh_attribute" name="temperature">
                <string name="name" value="face_temperature"/>
            </texture>
        </emitter>
    </shape>"""


def use_scene(path: Path) -> None:
    """Loads a scene and renders it where it is small; what comes out must be finite."""
    scene = mi_lcair.load(path)
    _ = scene.fingerprint, scene.remarks
    if int(np.prod(scene.sensor(0).film().crop_size())) * 2 <= MOST_PATHS:
        result = mi_lcair.render(scene, spp=2)
        assert math.isfinite(result.mean) and result.mean >= 0, f"mean radiance {result.mean}"


def use_ply(path: Path) -> None:
    """Uses a mesh through a scene beside it."""
    use_scene(path.with_name("scene.xml"))


XML_WORDS = (
    *b"diffuse roughconductor conductor plastic principled dielectric null measured".split(),
    *b"blendbsdf mask twosided hair bumpmap area constant point directional envmap".split(),
    *b"cube disk cylinder instance sphere ply bitmap volume checkerboard uniform".split(),
    *b"hdrfilm specfilm multijitter perspective radiancemeter face_normals flip_normals".split(),
    *b"to_uv near_clip far_clip shutter_open crop_width fov radius scale value name type".split(),
    *b"id true false material lobe form closure tail float integer string boolean".split(),
    *b"spectrum rgb texture transform ref".split(),
    b"<shape type='rectangle'/>",
    b"<include filename='mutant.xml'/>",
    b"<texture type='bitmap' name='reflectance'/>",
    b"<emitter type='area'/>",
    b"<!--",
    b"]]>",
    b"&lt;",
    b"&x;",
)
PLY_WORDS = tuple(b"property float double int uchar list element vertex face ascii 3 4 -1".split())

PLY = Kind(
    "ply",
    ".ply",
    (ply(), ply(ascii=True)),
    use_ply,
    PLY_WORDS,
    {"scene.xml": (SCENE % MESH % ("ply", "mutant.ply")).encode()},
    may_die=True,
    value=re.compile(rb"(?<=\s)-?[\w.]+(?=\s)"),
)
XML = Kind(
    "scene",
    ".xml",
    ((SCENE % MESH % ("ply", "plate.ply")).encode(),),
    use_scene,
    XML_WORDS,
    {"plate.ply": ply()},
    may_die=True,
    value=re.compile(rb'(?<==")[^"<>]*(?=")|(?<=<)\w+'),
)

# ---------------------------------------------------------------- Effective areas of a sweep

AREAS = ViewAreas(
    scene_name="plate",
    band=band("LWIR"),
    sources=[Source("self", "300 K", float(in_band_radiance(band("LWIR"), 300.0)), 300.0)],
    nodes_um=np.empty(0),
    views=(View(0.0), View(30.0, 5.0)),
    amounts=np.array([[1.0, 2.0], [3.0, 4.0]]),
    deviations=np.full((2, 8, 2), 0.01),
    relative=np.zeros(2),
    missed=np.zeros(2),
    paths=np.array([64, 64]),
    reached=np.array([True, False]),
)


def areas_bytes() -> bytes:
    """A file as a sweep keeps it."""
    dataset = AREAS.to_xarray()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "areas.nc"
        formats.write_netcdf(path, dataset.assign_attrs(checksum=formats.checksum(dataset)))
        return path.read_bytes()


def use_areas(path: Path) -> None:
    """Reads kept effective areas: what is damaged is refused."""
    read = ViewAreas.read(path)
    assert (read.band, read.views) == (AREAS.band, AREAS.views)
    for name in ("amounts", "deviations", "relative", "missed", "paths", "reached"):
        assert np.array_equal(getattr(read, name), getattr(AREAS, name)), name


VIEW_AREAS = Kind(
    "areas", ".nc", (areas_bytes(),), use_areas, (b"CDF\x02", b"view", b"LWIR", b"MWIR")
)

KINDS = (VIEW_AREAS, OBJ, NAMES, GLB, STL, MODEL_PLY, PLY, XML, *TEXT_KINDS, *RESULT_KINDS)
