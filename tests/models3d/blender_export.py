"""Writes the files of tests/data/blender with Blender: `python blender_export.py FOLDER`.

`python blender_export.py FOLDER drone` writes drone.obj and drone.usda of scenes/examples instead.

It runs in an interpreter that has Blender's module `bpy`. The tests' model is a hull with a
fin on top of its tail and a copy of the fin on its left. It has no symmetry, so that every turn of
the axes shows. The copy is turned and mirrored by its object's transform.
"""

import sys
from math import cos, pi, radians, sin
from pathlib import Path

import bpy

HULL = ((-2, -0.5, 0), (2, 0.5, 1))  # nose at x = 2
FIN = ((-0.5, -0.1, 0), (0.5, 0.1, 0.8))
LABELS = ("f*bare_aluminum*310*hull", "f*gloss_black*330*group=fin")
PLAIN = ("Hull", "Fin")


def box(name, lower, upper, materials):
    """Add a box whose sides have the given materials by turns."""
    corners = [
        (x, y, z) for x in (lower[0], upper[0]) for y in (lower[1], upper[1])
        for z in (lower[2], upper[2])
    ]  # fmt: skip
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], sides)
    for material in materials:
        mesh.materials.append(bpy.data.materials.get(material) or bpy.data.materials.new(material))
    for side in mesh.polygons:
        side.material_index = side.index % len(materials)
    added = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(added)
    return added


def model(names):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    hull, fin = names
    box(hull, *HULL, ["Paint", "Hot steel"])
    box(fin, *FIN, ["Paint"]).location = (-1.4, 0, 1.05)
    copy = box(fin, *FIN, ["Paint"])  # Blender adds .001 to its name
    copy.location, copy.scale = (0.5, 1.2, 0.2), (-1, 1, 0.5)
    copy.rotation_euler = (0, 0, radians(90))


def main(folder):
    model(LABELS)
    bpy.ops.wm.obj_export(filepath=str(folder / "default.obj"))
    bpy.ops.wm.obj_export(
        filepath=str(folder / "y_forward_z_up.obj"), forward_axis="Y", up_axis="Z"
    )
    bpy.ops.export_scene.gltf(filepath=str(folder / "labelled.glb"))
    model(PLAIN)
    bpy.ops.wm.obj_export(filepath=str(folder / "plain.obj"), forward_axis="Y", up_axis="Z")
    bpy.ops.export_scene.gltf(filepath=str(folder / "plain.glb"))
    bpy.ops.wm.ply_export(filepath=str(folder / "plain.ply"))
    bpy.ops.wm.stl_export(filepath=str(folder / "plain.stl"))
    bpy.ops.wm.usd_export(filepath=str(folder / "plain.usda"))
    say(bpy.data.materials["Paint"], material="gloss_black", kelvin=310.5)
    hot = bpy.data.materials["Hot steel"]
    say(hot, kelvin=400, group="hot")
    hot["omni:simready:nonvisual:base"] = "oxidized_steel"
    hot["omni:simready:nonvisual:coating"] = "none"
    say(bpy.data.objects["Fin"], kelvin=330)
    of_faces = bpy.data.meshes["Fin.001"].attributes.new("thermal:kelvin", "FLOAT", "FACE")
    for number, face in enumerate(of_faces.data):
        face.value = 341 + number
    bpy.ops.wm.usd_export(filepath=str(folder / "thermal.usda"))


def say(owner, **values):
    """Give an object or material custom properties thermal:NAME."""
    for name, value in values.items():
        owner[f"thermal:{name}"] = value


def drone(folder):
    """A fuselage of eight sides with a nozzle, two wings and a fin; small gaps separate them."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    ring = [(0.3 * cos(pi * (k + 0.5) / 4), 0.3 * sin(pi * (k + 0.5) / 4)) for k in range(8)]
    corners = [(x, y, z) for x in (-1.5, 1.0) for y, z in ring] + [(1.7, 0, 0)]
    sides = [(k, (k + 1) % 8, 8 + (k + 1) % 8, 8 + k) for k in range(8)]
    cone = [(8 + k, 8 + (k + 1) % 8, 16) for k in range(8)]
    mesh = bpy.data.meshes.new("Fuselage")
    mesh.from_pydata(corners, [], [*sides, *cone, tuple(range(7, -1, -1))])
    for material in ("Skin", "Nozzle"):
        mesh.materials.append(bpy.data.materials.new(material))
    mesh.polygons[-1].material_index = 1
    bpy.context.collection.objects.link(bpy.data.objects.new("Fuselage", mesh))
    for side in (1, -1):
        box("Wing", (-0.6, 0.29, -0.03), (0.2, 1.8, 0.03), ["Skin"]).scale = (1, side, 1)
    box("Fin", (-1.4, -0.02, 0.29), (-0.9, 0.02, 0.8), ["Skin"])
    bpy.ops.wm.obj_export(filepath=str(folder / "drone.obj"))
    skin, nozzle = bpy.data.materials["Skin"], bpy.data.materials["Nozzle"]
    say(skin, kelvin=290)
    skin["omni:simready:nonvisual:base"] = "aluminum"
    skin["omni:simready:nonvisual:coating"] = "paint"
    say(nozzle, kelvin=600, group="exhaust", material="blackbody")
    bpy.ops.wm.usd_export(filepath=str(folder / "drone.usda"))


if __name__ == "__main__":
    output = Path(sys.argv[1]).resolve()
    (drone if sys.argv[2:] == ["drone"] else main)(output)
    for materials in output.glob("*.mtl"):
        materials.unlink()
