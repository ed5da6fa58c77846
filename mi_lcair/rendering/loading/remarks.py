"""Remarks on a loaded scene that point out possible errors of its image."""

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.coincident import overlaps
from mi_lcair.declared import percent
from mi_lcair.models3d.modellers.naming import ICE_POINT, LOWEST
from mi_lcair.plugins.bsdfs.plume import is_passed
from mi_lcair.plugins.bsdfs.reflection_bsdf import is_reflection_bsdf, reflection_layers
from mi_lcair.plugins.derivatives import deriving, members, nodes, own_memory
from mi_lcair.plugins.emission.emitter_table import EmitterTable
from mi_lcair.plugins.emission.triangles import (
    NORMALS,
    corners_of,
    is_faceted,
    points,
    triangle_corners,
    triangle_vertices,
)
from mi_lcair.plugins.emitters.thermal_emitter import is_thermal, one_sun, thermal_shapes
from mi_lcair.plugins.paths.launch import OF_POSITION, UNIT, numbers
from mi_lcair.plugins.paths.sheets import is_one_sided, nearest_hit
from mi_lcair.rendering.loading import parsing

# Remarks on triangles and rectangles of a scene: sheets in one plane, and parts too small
# ----------------------------------------------------------------------------------------

# Relative error of what is reflected between facets whose size is that of one rounding of their
# coordinates. True errors of 22 cubes of 1 mm to 1 km, up to 100 km from the origin, were at most
# 1.7 times as large. In five of them they were 4 to 17 times smaller, as rounding is random. Errors
# up to RESOLVED are not remarked.
ERROR, RESOLVED = 2.0, 1e-3


def remarks_on_triangles(scene: mi.Scene) -> list[str]:
    """Remarks on the triangles of meshes and the rectangles of a scene, one line each."""
    shapes = [shape for shape in scene.shapes() if shape.is_mesh()]
    if not shapes:
        return []
    meshes = list(map(corners_of, shapes))
    first, corners = np.cumsum([0, *map(len, meshes)]), np.concatenate(meshes).astype(float)
    one_sided = np.repeat(list(map(is_one_sided, shapes)), np.diff(first))

    def name(number: int) -> str:
        shape = int(np.searchsorted(first, number, side="right")) - 1
        label = shapes[shape].id()
        whose = f"triangle of '{label}'" if label else "triangle"
        return f"{whose} {number - first[shape]}" if is_faceted(shapes[shape]) else f"'{label}'"

    return [
        *without_area(corners, shapes, first),
        *thin_sheets(corners, one_sided, name),
        *small_parts(corners, name),
    ]


def without_area(corners: np.ndarray, shapes: list, first: np.ndarray) -> list[str]:
    """Remarks on shapes that no ray can hit, as all of their triangles are points or lines.

    first: number of the first triangle of each shape, and of all triangles.
    """
    is_empty = sizes(corners) == 0
    return [
        f"'{shape.id()}' has no area: all of its {end - begin} triangles are points or lines in "
        "single precision, and no ray hits them; move the scene to the origin, or remove the shape"
        for shape, begin, end in zip(shapes, first, first[1:])
        if is_empty[begin:end].all()
    ]


def sizes(corners: np.ndarray) -> np.ndarray:
    """Square root of twice the area of triangles (n, 3, 3), (n,) [m]."""
    sides = corners[:, 1:] - corners[:, :1]
    return np.sqrt(np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1))


def thin_sheets(corners: np.ndarray, one_sided: np.ndarray, name) -> list[str]:
    """Remarks on triangles that overlap in one plane, where rays hit either one at random.

    One-sided triangles back to back are none of them, see `Sheets`.

    corners: (n, 3, 3) [m]. one_sided: whether each is, (n,). name: function that gives the name of
    a triangle by its number.
    """
    sheets, remarks = overlaps(corners), []
    seen = ~one_sided[sheets.back_to_back].all(axis=1)
    for pairs, how in (
        (sheets.back_to_back[seen], "back to back"),
        (sheets.same_side, "one on the other"),
    ):
        if len(pairs):
            a, b = map(name, pairs[0])
            remarks.append(
                f"{len(pairs)} pair{'s' * (len(pairs) > 1)} of triangles lie in one plane, {how}, "
                f"first {a} and {b}; which of them is seen is left to rounding: move them apart or "
                "remove one"
            )
    return remarks


def small_parts(corners: np.ndarray, name) -> list[str]:
    """Remark on triangles whose size is not much more than the rounding of their coordinates."""
    size = sizes(corners)
    away = np.abs(corners).max(axis=(1, 2))
    error = ERROR * UNIT * away / np.maximum(size, 1e-30)
    small = (error > RESOLVED) & (size > 0)
    if not small.any():
        return []
    worst = int(np.where(small, error, 0).argmax())
    return [
        f"{small.sum()} of {len(corners)} triangles are small for where "
        f"they are: {name(worst)} is {size[worst]:.2g} m large and {away[worst]:.3g} m from the "
        f"origin, where single precision leaves errors of about {min(error[worst], 1):.1%}, "
        "sometimes of a tenth of it, of what such parts reflect to each other; move the scene, or "
        "make the part a scene of its own"
    ]


# Remarks on materials, suns, clip distances and temperatures of a loaded scene
# -----------------------------------------------------------------------------

COARSE = 3e-5  # uncertainty of places, as a part of the scene's size, that is remarked
CELSIUS = 4.3  # temperatures below are those of helium and of space [K]
WITHOUT_BSDF = ("instance", "shapegroup", "merge")  # shapes whose parts have the BSDFs


def shapes_without_bsdf(state) -> list[str]:
    """Remarks on the shapes of a parsed scene that get Mitsuba's default BSDF."""
    lines = []
    for node in state.nodes:
        if node.type != mi.ObjectType.Shape or node.props.plugin_name() in WITHOUT_BSDF:
            continue
        inside = {state.nodes[child].type for child in parsing.references(parsing.properties(node))}
        if mi.ObjectType.BSDF not in inside:
            reflects = "nothing" if mi.ObjectType.Emitter in inside else "half of what arrives"
            lines.append(
                f"{mi.parser.file_location(state, node)}: the {node.props.plugin_name()} has no "
                f"BSDF; Mitsuba's default BSDF is used and reflects {reflects}"
            )
    return lines


def turned_inside_out(state, scene: mi.Scene) -> list[str]:
    """Remarks on one-sided spheres and meshes that their `to_world` mirrors.

    A mesh whose file has vertex normals keeps its front side. state: the parsed scene.
    """
    shapes, lines = {shape.id(): shape for shape in scene.shapes()}, []
    for node in state.nodes:
        if node.props.plugin_name() not in ("sphere", "ply", "obj", "serialized"):
            continue
        values, shape = parsing.properties(node), shapes.get(node.props.id())
        if shape is None or "to_world" not in values or values.get("flip_normals", False):
            continue
        if not np.linalg.det(np.array(values["to_world"].matrix)[:3, :3]) < 0:
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
    if parsing.far_origin(scene) is not None:
        low, high = parsing.extent(scene)
        offset = OF_POSITION * UNIT * max(abs(low).max(), abs(high).max())
        lines.append(
            "the scene is far from its origin, where single precision is coarse: rays start "
            f"{offset:.1g} m away from surfaces, {percent(offset / (high - low).max())} of its "
            "size; load the scene from a file with mi_lcair.load, which moves it to the origin"
        )
    if any(numbers(sensor.sampler()) == "independent" for sensor in scene.sensors()):
        lines.append(parsing.INDEPENDENT)
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


def skies_by_night(scene: mi.Scene) -> list[str]:
    """Remarks on an emitter sky that does not know the sun of the scene."""
    sun, sky = one_sun(scene.emitters()), scene.environment()
    if sun is None or sun.elevation_deg < 1 or not is_thermal(sky) or not sky.is_divided:
        return []
    if sky.sun_elevation_deg is not None or sky.values["sky"] == "overcast":
        return []
    emissivity = sky.ground_emissivity
    unlit = ["a sky without scattered sunlight"] * (sky.values["sky"] == "clear")
    unlit += ["ground in the dark"] * (emissivity is not None and float(emissivity[0]) < 1)
    given = {"sun_elevation_deg": sun.elevation_deg, "sun_azimuth_deg": sun.azimuth_deg}
    properties = " ".join(f'<float name="{name}" value="{at:g}"/>' for name, at in given.items())
    return [
        f"{sky.group}: without sun_elevation_deg it is {' and '.join(unlit)} beside the emitter "
        f"sun; add {properties}"
    ] * bool(unlit)


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
    wi = mi.Vector3f(np.sqrt(1 - cos**2), 0 * cos, cos)
    texture = mi.Point2f(np.random.default_rng(0).random((2, len(cos))))
    own_memory([wi, texture])
    remarks, known = [], set()  # known: surfaces that emit
    for shape in thermal_shapes(scene):
        emitter, layers, surface = shape.emitter(), reflection_layers(shape.bsdf()), shape
        if layers and emitter.given_emissivity is None:
            # Surfaces with equal parameters have the same emissivity
            surface = int(shape.bsdf().flags()), *(layer.reflection for layer in layers)
        if surface in known:
            continue
        si = dr.zeros(mi.SurfaceInteraction3f, len(cos))
        si.wi, si.uv, si.shape = wi, texture, mi.ShapePtr(shape)
        si.n, si.sh_frame = mi.Normal3f(0, 0, 1), mi.Frame3f(mi.Normal3f(0, 0, 1))
        if not dr.all(dr.detach(emitter.emissivity(si, mi.Bool(True))) < 1e-5):
            known.add(surface)
        else:
            material = f"material {layers[0].material}" if layers else "its BSDF"
            does, left = "reflects", "black except for reflections"
            if is_passed(int(shape.bsdf().flags())):
                does, left = "transmits", "invisible"
            remarks.append(
                f"group {emitter.group}, shape '{shape.id()}': {material} {does} all radiation, "
                f"so that the thermal emitter emits nothing and the surface is {left}; use a "
                "material that absorbs, or give the emitter an `emissivity`"
            )
    return remarks


def clipped(loaded, sensors) -> list[str]:
    """Remarks on sensors that may not see the whole scene because of near_clip and far_clip.

    Mitsuba's defaults are 0.01 m and 10 km. The scale of an orthographic sensor's `to_world` also
    applies to its near_clip, and the distance from there to its far_clip stays as it is.
    Also on those from which parallel rays come so far that single precision does not resolve the
    scene well.
    """
    (low, high), lines = parsing.extent(loaded), []
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
                f"sensor {number}: does not see surfaces nearer than its near_clip = {near:g} m"
                + scaled
            )
        if farthest > far:
            lines.append(
                f"sensor {number}: does not see surfaces farther than its far_clip = {far:g} m"
                + scaled
            )
        size = (high - low).max()
        if is_parallel and UNIT * nearest > COARSE * size > 0:
            lines.append(
                f"sensor {number}: its rays begin {nearest:.3g} m before a scene of {size:.3g} "
                "m, and single precision leaves places uncertain by "
                f"{percent(UNIT * nearest / size)} of it; move the sensor nearer; its parallel "
                "rays then see the same"
            )
    return lines


# Remarks on a scene of which the first sensor sees dark surfaces: backs, or nothing reflected
# --------------------------------------------------------------------------------------------

RAYS = 2**12  # rays of the first sensor that are followed to what the target reflects there
# Smallest share of the reflected light, and of all light that a surface could reflect, that is
# remarked
LEAST_SHARE, LEAST_REFLECTED = 0.05, 0.01
MOST_BEHIND = 0.5  # share of what is seen from behind that is not remarked


def remarks_on_view(scene: mi.Scene, emitters: EmitterTable) -> tuple[list[str], list[str]]:
    """Remarks on what the first sensor sees: reflections of nothing, and backs of surfaces.

    The first is on rays whose first reflection escapes to where nothing emits. Without surroundings
    a reflecting surface is as dark as in empty space. The remark says for which share of the
    reflected light this is so. The second is on a model of which the sensor sees mostly the backs
    of one-sided surfaces.
    """
    # The same numbers for each scene
    numbers = np.random.default_rng(0).random((7, RAYS)).astype(np.float32)
    numbers = own_memory([mi.Float(row) for row in numbers])
    with dr.suspend_grad():
        ray, _ = scene.sensors()[0].sample_ray(
            0.0, numbers[0], mi.Point2f(*numbers[1:3]), mi.Point2f(*numbers[3:5])
        )
        pi = nearest_hit(scene, emitters.sheets, ray)
        si = pi.compute_surface_interaction(ray)
        bsdf, of_model = si.bsdf(ray), si.is_valid() & emitters.is_model(si.emitter(scene))
        on_target = of_model & ~is_passed(bsdf.flags())
        side = dr.select(
            si.wi.z > 0, mi.UInt32(+mi.BSDFFlags.FrontSide), mi.UInt32(+mi.BSDFFlags.BackSide)
        )
        sample = mi.Point2f(*numbers[5:7])
        bs, weight = bsdf.sample(mi.BSDFContext(), si, numbers[0], sample, on_target)
        reflected = dr.select(on_target, weight[0], 0)
        ray = emitters.spawn_ray(si, si.to_world(bs.wo))
        beyond = nearest_hit(scene, emitters.sheets, ray, active=on_target)
        escapes = on_target & ~beyond.is_valid()
        if scene.environment() is not None:
            of_sky = beyond.compute_surface_interaction(ray, active=on_target)
            escapes &= scene.environment().eval(of_sky)[0] == 0
        is_behind = on_target & (bsdf.flags() & side == 0)
        values = dr.select(on_target, mi.Float(1), 0), reflected, reflected * escapes
        # In few kernels, as many shapes make each one slow. One for both rays ends the process in
        # a scene of many kinds of shapes.
        dr.eval(values[0], is_behind)
        dr.eval(values[1:])
        met, total, lost = (dr.sum(value)[0] for value in values)
        behind = dr.count(is_behind)[0]
    of_nothing, backs = [], []
    if lost > max(LEAST_SHARE * total, LEAST_REFLECTED * met):
        of_nothing = [
            f"{percent(lost / total)} of the target's reflections see nothing (0 K); add an "
            "emitter sky to the scene, or [surroundings] to the scenario"
        ]
    if behind > MOST_BEHIND * met:
        backs = [
            f"{percent(behind / met)} of the model's area that the first sensor sees are backs "
            "of one-sided surfaces, which are black; turn their facets, or wrap their BSDFs in "
            "twosided"
        ]
    return of_nothing, backs
