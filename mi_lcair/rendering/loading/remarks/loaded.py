"""Remarks on materials, suns, clip distances and temperatures of a loaded scene."""

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.declared import percent
from mi_lcair.models3d.label import ICE_POINT, LOWEST
from mi_lcair.plugins.bsdfs.plume import is_passed
from mi_lcair.plugins.bsdfs.reflection_bsdf import is_reflection_bsdf, reflection_layers
from mi_lcair.plugins.derivatives import deriving, members, nodes
from mi_lcair.plugins.emission.triangles import (
    NORMALS,
    is_faceted,
    points,
    triangle_corners,
    triangle_vertices,
)
from mi_lcair.plugins.emitters.thermal_emitter import one_sun, thermal_shapes
from mi_lcair.plugins.paths.launch import numbers
from mi_lcair.plugins.paths.offsets import OF_POSITION, UNIT
from mi_lcair.rendering.loading.nodes import properties, references
from mi_lcair.rendering.loading.origin import extent, far_origin
from mi_lcair.rendering.loading.parsing import INDEPENDENT

COARSE = 3e-5  # uncertainty of places, as a part of the scene's size, that is remarked
CELSIUS = 4.3  # temperatures below are those of helium and of space [K]
WITHOUT_BSDF = ("instance", "shapegroup", "merge")  # shapes whose parts have the BSDFs


def shapes_without_bsdf(state) -> list[str]:
    """Remarks on the shapes of a parsed scene that get Mitsuba's default BSDF."""
    lines = []
    for node in state.nodes:
        if node.type != mi.ObjectType.Shape or node.props.plugin_name() in WITHOUT_BSDF:
            continue
        inside = {state.nodes[child].type for child in references(properties(node))}
        if mi.ObjectType.BSDF not in inside:
            reflects = "nothing" if mi.ObjectType.Emitter in inside else "half of what arrives"
            lines.append(
                f"{mi.parser.file_location(state, node)}: the {node.props.plugin_name()} has no "
                f"BSDF; Mitsuba's default stands for it and reflects {reflects}"
            )
    return lines


def turned_inside_out(state, scene: mi.Scene) -> list[str]:
    """Remarks on one-sided spheres and meshes that their `to_world` mirrors.

    A mesh whose file has vertex normals keeps its front side. state: the parsed scene.
    """
    shapes, lines = {shape.id(): shape for shape in scene.shapes()}, []
    for node in state.nodes:
        values, shape = properties(node), shapes.get(node.props.id())
        if shape is None or "to_world" not in values or values.get("flip_normals", False):
            continue
        mirrors = np.linalg.det(np.array(values["to_world"].matrix)[:3, :3]) < 0
        if not mirrors or node.props.plugin_name() not in ("sphere", "ply", "obj", "serialized"):
            continue
        if mi.has_flag(shape.bsdf().flags(), mi.BSDFFlags.BackSide):
            continue
        if is_faceted(shape) and len(normals := points(members(shape)[NORMALS])):
            p0, p1, p2 = triangle_corners(shape)
            normals = normals[triangle_vertices(shape)[:, 0]]
            if np.sum(np.cross(p1 - p0, p2 - p0) * normals) < 0:
                continue
        lines.append(
            f"{mi.parser.file_location(state, node)}: to_world mirrors the "
            f"{node.props.plugin_name()}, which turns it inside out: it emits and reflects on its "
            'other side; add <boolean name="flip_normals" value="true"/>'
        )
    return lines


def remarks_on_materials(scene: mi.Scene) -> list[str]:
    """Remarks on the materials of a scene, one line each."""
    lines = []
    for plugin in deriving(nodes(scene)):
        if is_reflection_bsdf(plugin):
            lines += [f"material {plugin.material}: {remark}" for remark in plugin.remarks()]
        lines += [
            f"group {plugin.group}: emissivity tabulated by sampling the BSDF, "
            f"standard error {table.error:.1e}"
            for table in plugin.derivations
        ]
    return list(dict.fromkeys([*lines, *surfaces_that_emit_nothing(scene), *in_celsius(scene)]))


def remarks_on_loaded(scene: mi.Scene) -> list[str]:
    """Remarks on a scene that Mitsuba has loaded, which `load` would have prepared otherwise."""
    lines = []
    if far_origin(scene) is not None:
        low, high = extent(scene)
        offset = OF_POSITION * UNIT * max(abs(low).max(), abs(high).max())
        lines.append(
            "the scene lies far from its origin, where single precision is coarse: rays start "
            f"{offset:.1g} m off surfaces, {percent(offset / (high - low).max())} of its size; "
            "mi_lcair.load moves the scene of a file"
        )
    if any(numbers(sensor.sampler()) == "independent" for sensor in scene.sensors()):
        lines.append(INDEPENDENT)
    return lines


def suns_below_the_horizon(scene: mi.Scene) -> list[str]:
    """Remarks on suns that shine from below the x-y plane, as if there were no ground."""
    sun = one_sun(scene.emitters())
    if sun is None or sun.elevation_deg > 0:
        return []
    return [
        f"{sun.group}: elevation_deg = {sun.elevation_deg:g} is below the horizon, and the sun "
        "lights the scene from below; choose one above 0"
    ]


def in_celsius(scene: mi.Scene) -> list[str]:
    """Remarks on temperatures that are probably meant in degrees Celsius."""
    lines = []
    for shape in thermal_shapes(scene):
        given = shape.emitter().first_temperatures
        if given is not None and CELSIUS < given.min() <= LOWEST:
            coldest = float(given.min())
            lines.append(
                f"group {shape.emitter().group}: a temperature of {coldest:g} K looks like degrees "
                f"Celsius; in kelvin it is {coldest + ICE_POINT:g}"
            )
    return lines


def surfaces_that_emit_nothing(scene: mi.Scene) -> list[str]:
    """Remarks on thermal emitters whose surface has an emissivity of 0."""
    cos = np.tile([1.0, 0.5, 0.1, -1.0, -0.5, -0.1], 16)
    texture = np.random.default_rng(0).random((2, len(cos)))
    remarks, known = [], set()  # known: surfaces that emit
    for shape in thermal_shapes(scene):
        emitter, layers, surface = shape.emitter(), reflection_layers(shape.bsdf()), shape
        if layers and emitter.given_emissivity is None:
            # Surfaces with equal parameters have the same emissivity
            surface = int(shape.bsdf().flags()), *(layer.reflection for layer in layers)
        if surface in known:
            continue
        si = dr.zeros(mi.SurfaceInteraction3f, len(cos))
        si.wi, si.shape = mi.Vector3f(np.sqrt(1 - cos**2), 0 * cos, cos), mi.ShapePtr(shape)
        si.n, si.sh_frame = mi.Normal3f(0, 0, 1), mi.Frame3f(mi.Normal3f(0, 0, 1))
        si.uv = mi.Point2f(texture)
        if not dr.all(dr.detach(emitter.emissivity(si, mi.Bool(True))) < 1e-5):
            known.add(surface)
        else:
            material = f"material {layers[0].material}" if layers else "its BSDF"
            does, left = "reflects", "black but for what it reflects"
            if is_passed(int(shape.bsdf().flags())):
                does, left = "transmits", "invisible"
            remarks.append(
                f"group {emitter.group}, shape '{shape.id()}': {material} {does} all that "
                f"arrives, so that the thermal emitter emits nothing and the surface is {left}; "
                "use a material that absorbs, or give the emitter an `emissivity`"
            )
    return remarks


def clipped(loaded, sensors) -> list[str]:
    """Remarks on sensors that may not see the whole scene because of near_clip and far_clip.

    Mitsuba's defaults are 0.01 m and 10 km. The scale of an orthographic sensor's `to_world` also
    applies to its near_clip, and the distance from there to its far_clip stays as it is.
    Also on those from which parallel rays come so far that single precision does not resolve the
    scene well.
    """
    (low, high), lines = extent(loaded), []
    for number, sensor in enumerate(sensors):
        clips, place = members(sensor), members(sensor).get("to_world")
        if place is None or "near_clip" not in clips:
            continue
        matrix = np.squeeze(np.array(place.matrix, dtype=float))
        eye, near, far = matrix[:3, 3], clips["near_clip"], clips["far_clip"]
        is_parallel, scaled = sensor.class_name() == "OrthographicCamera", ""
        if is_parallel:
            start = near * float(f"{np.linalg.norm(matrix[:3, 2]):.6g}")
            scaled = ", scaled by its to_world" if start != near else ""
            near, far = start, start + far - near
        nearest = np.linalg.norm(np.maximum(np.maximum(low - eye, eye - high), 0))
        farthest = np.linalg.norm(np.maximum(high - eye, eye - low))
        if nearest < near and near > 0.01 * np.linalg.norm(high - low):
            lines.append(
                f"sensor {number}: does not see what is nearer than its near_clip = {near:g} m"
                + scaled
            )
        if farthest > far:
            lines.append(
                f"sensor {number}: does not see what is farther than its far_clip = {far:g} m"
                + scaled
            )
        size = (high - low).max()
        if is_parallel and UNIT * nearest > COARSE * size > 0:
            lines.append(
                f"sensor {number}: its rays begin {nearest:.3g} m before a scene of {size:.3g} m, "
                f"and single precision leaves places uncertain by {percent(UNIT * nearest / size)} "
                "of it; put the sensor nearer, where its parallel rays see the same"
            )
    return lines
