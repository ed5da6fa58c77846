"""Pieces of small scene files."""

import numpy as np

SENSOR = """<sensor type="orthographic"> <film type="hdrfilm">
    <integer name="width" value="4"/> <integer name="height" value="4"/>
    <string name="pixel_format" value="luminance"/> </film> </sensor>"""
PATH = '<integrator type="bounce_path"/>'
THERMAL = """<emitter type="thermal">
    <string name="band" value="LWIR"/> <float name="temperature" value="300"/> </emitter>"""
PAINT = """<bsdf type="sandford_robertson">
    <string name="material" value="gloss_black"/> <string name="band" value="LWIR"/> </bsdf>"""
TEXTURE = """<texture type="mesh_attribute" name="temperature">
    <string name="name" value="face_temperature"/> </texture>"""
FACETS = f'<emitter type="thermal"> <string name="band" value="LWIR"/> {TEXTURE} </emitter>'


def shape(inside: str, kind: str = "rectangle") -> str:
    return f'<shape type="{kind}">{inside}</shape>'


def mesh(inside: str, name: str = "plate.ply") -> str:
    return shape(
        f'<string name="filename" value="{name}"/> <boolean name="face_normals" value="true"/>'
        + inside,
        "ply",
    )


def write(folder, *elements: str, name: str = "scene.xml"):
    path = folder / name
    path.write_text('<scene version="3.0.0">' + "".join(elements) + "</scene>")
    return path


def write_ply(path, vertices, faces, **attributes) -> None:
    """A binary PLY; attributes: one number per face, by name, such as temperature."""
    vertices = np.asarray(vertices, "<f4")
    rows = np.zeros(len(faces), [("n", "u1"), ("of", "<i4", 3), *((k, "<f4") for k in attributes)])
    rows["n"], rows["of"] = 3, faces
    for name, values in attributes.items():
        rows[name] = values
    names = "".join(f"property float {name}_0\n" for name in attributes)
    path.write_bytes(
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\n{names}"
        "end_header\n".encode()
        + vertices.tobytes()
        + rows.tobytes()
    )


SQUARE = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]
HALVES = [[0, 1, 2], [0, 2, 3]]
