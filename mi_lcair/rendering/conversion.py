"""A scene that was written for Mitsuba as a thermal one: its surfaces emit by their temperature."""

import os
import re
from collections.abc import Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from xml.etree import ElementTree

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.declared import percent
from mi_lcair.errors import InputError, check_known, mitsuba_error, option
from mi_lcair.files import filling
from mi_lcair.models3d.modellers.naming import kelvin
from mi_lcair.plugins.emission.emissivity import emissivity_of
from mi_lcair.rendering.loading import parsing
from mi_lcair.rendering.loading.files import survey
from mi_lcair.rendering.loading.meshes import check_mesh_files, check_shapes
from mi_lcair.rendering.scene import checked
from mi_lcair.tasks import exclusively

UNLIMITED = 30  # reflections of a scene whose integrator sets no limit
RAYS = 2**14  # rays of the first sensor that find the share of surfaces in its image
LEFT_OUT = (mi.ObjectType.Emitter, mi.ObjectType.Integrator, mi.ObjectType.Medium)
GROUPS = ("instance", "shapegroup", "merge")  # shapes that hold others
SHAPE, BSDF, REFERENCE = mi.ObjectType.Shape, mi.ObjectType.BSDF, mi.Properties.ResolvedReference
ALL = ""  # name of the emissivity of all surfaces that need one
WHY = re.compile(r"^bsdf '[^']*':? (.*?)[:;]")  # the reason in messages of `emissivity_of`
VISIBLE = (
    "reflectances are those of the scene, which are meant for visible light; put materials that "
    'were measured in the infrared in their place: <bsdf type="material">'
)


@exclusively
def thermal_scene(
    path: str | Path,
    folder: str | Path,
    temperature: float,
    band: str = "LWIR",
    emissivity: Sequence[str] = (),
    parameters: Mapping[str, str] | None = None,
    overwrite: bool = False,
) -> list[str]:
    """Write FOLDER/scene.xml, a thermal version of a scene in Mitsuba's XML.

    Includes become part of it, and its $-parameters their values. The integrator becomes
    `bounce_path`. Every shape gets an emitter `thermal` in place of its own, the other emitters and
    the mediums are left out, and samplers become `lattice`. `temperature` and `band` are
    $-parameters of the new scene. Meshes and textures stay where they are.

    Parameters
    ----------
    path : str or Path
        The scene, an XML file.
    folder : str or Path
        It is created if it does not exist.
    temperature : float
        Temperature of all surfaces [K].
    band : str
        Band of the radiances.
    emissivity : sequence of str
        Emissivity of surfaces of a Mitsuba scene: "NAME=NUMBER" for shapes and BSDFs with this id
        and for BSDFs of this plugin, or "NUMBER" for all surfaces whose emissivity does not follow
        from their BSDF.
    parameters : mapping of str to str, optional
        Values of the scene's $-parameters.
    overwrite : bool
        Replace a scene.xml that is there.

    Returns
    -------
    list of str
        What a user should know about the new scene, one line each.

    Raises
    ------
    InputError
        If the file is no scene that can be rendered, if an emissivity is missing, or if scene.xml
        cannot be written.
    """
    path, written, given = Path(path), Path(folder) / "scene.xml", dict(parameters or {})
    kelvins = kelvin(f"{temperature:.9g}")
    if written.exists() and (written.samefile(path) or not overwrite):
        instead = f"name another folder or give {option('overwrite', True)}"
        raise InputError(f"{written}: exists; {instead}")
    names = survey(path, given)
    check_known(f"parameter of {path.name}", names, *given)
    with parsing.searching(path.parent):
        try:
            state = mi.parser.parse_file(parsing.configuration(), str(path), **given)
            mi.parser.transform_all(parsing.configuration(), state)
            if state.root.props.plugin_name() != "scene" or not held(state, 0, SHAPE):
                raise InputError(f"{path}: must be a <scene> with at least one shape")
            parsing.check_nodes(state)
            check_mesh_files(state)
            remarks = [VISIBLE, *convert(state)]
            fixed = emissivities(state, emissivity)
            for _, shape in held(state, 0, SHAPE):
                emitter = {"type": "thermal", "band": band, "temperature": kelvins}
                emitter |= {"emissivity": fixed[shape]} if shape in fixed else {}
                add(state, shape, mi.ObjectType.Emitter, emitter)
            scene = parsing.instantiated(mi.parser.ParserState(state))  # it changes the nodes
            check_shapes(scene)
            checked(scene, path, {})  # raises InputError for what cannot be rendered
        except RuntimeError as error:
            raise parsing.with_known_plugins(mitsuba_error(error)) from None
        if Path(band).is_file():  # a response
            band = os.path.relpath(band, written.parent)
        text = xml(state, written.parent, {"temperature": f"{kelvins:g}", "band": band})
    if fixed:
        ids = {state.nodes[shape].props.id() for shape in fixed}
        remarks.append(
            f"surfaces with a given emissivity are {percent(share(scene, ids))} of the first "
            "sensor's image; it may differ from 1 - reflectance, and is uniform on a surface"
        )
    if names:
        remarks.append(f"$-parameters became numbers: {', '.join(sorted(names))}; -D sets them")
    written.absolute().parent.parent.mkdir(parents=True, exist_ok=True)
    with filling(written.parent) as partial:
        (partial / written.name).write_text(text, encoding="utf-8")
    return remarks


def held(state, number: int, *kinds) -> list[tuple[str, int]]:
    """Names and numbers of those children of a node that are of these kinds."""
    values = parsing.properties(state.nodes[number]).items()
    references = [(name, v.index()) for name, v in values if isinstance(v, REFERENCE)]
    return [(name, child) for name, child in references if state.nodes[child].type in kinds]


def add(state, parent: int, kind, entries: dict) -> None:
    """Give a node a child, see `parsing.add_child`."""
    parsing.add_child(state, state.nodes[parent], f"_arg_{kind.name.lower()}", kind, entries)


def place_groups(state) -> None:
    """Put shapes in place of the instances of their group, and of those that hold them.

    Raises InputError for shapes that cannot be placed.
    """
    for name, number in held(state, 0, SHAPE):
        plugin, outer = state.nodes[number].props.plugin_name(), state.nodes[number]
        if plugin not in GROUPS:
            continue
        del state.root.props[name]
        place = parsing.properties(outer).get("to_world", mi.ScalarAffineTransform4d())
        groups = held(state, number, SHAPE) if plugin == "instance" else [(name, number)]
        shapes = [shape for _, group in groups for _, shape in held(state, group, SHAPE)]
        for k, shape in enumerate(shapes if plugin != "shapegroup" else []):
            placed = mi.parser.SceneNode(state.nodes[shape])
            if placed.props.plugin_name() == "sdfgrid":  # Mitsuba does not turn it
                raise InputError(
                    f"{mi.parser.file_location(state, placed)}: sdfgrid: its instances cannot "
                    "become shapes; use a mesh in its place"
                )
            own = parsing.properties(placed).get("to_world", mi.ScalarAffineTransform4d())
            placed.props["to_world"] = place @ own
            placed.props.set_id("")  # there may be several of them
            state.root.props[f"{name}_{k}"] = REFERENCE(len(state.nodes))
            state.nodes.append(placed)


def convert(state) -> list[str]:
    """Make a parsed scene thermal but for the emitters of its shapes; returns remarks."""
    place_groups(state)
    parsing.name_objects(state)
    depths, lights, mediums, lamps, boundaries = [-1], [], [], 0, []
    for number in range(len(state.nodes)):
        node = state.nodes[number]
        plugin, values = node.props.plugin_name(), parsing.properties(node)
        if node.type == mi.ObjectType.Integrator:
            depths.append(values.get("max_depth", 2 if plugin == "direct" else -1))
        if node.type in LEFT_OUT:
            continue
        if node.type == mi.ObjectType.Sampler:
            node.props = mi.Properties("lattice")
            for name in values.keys() & {"sample_count", "seed"}:
                node.props[name] = values[name]
        emitters = held(state, number, mi.ObjectType.Emitter)
        of_medium = held(state, number, mi.ObjectType.Medium)
        for name, _ in held(state, number, *LEFT_OUT):
            del node.props[name]
        mediums += [state.nodes[child].props.plugin_name() for _, child in of_medium]
        if number == 0:
            lights += [state.nodes[child].props.plugin_name() for _, child in emitters]
        elif node.type == SHAPE and emitters:
            lamps += 1
        elif node.type == SHAPE:
            bsdfs = held(state, number, BSDF)
            if not bsdfs:  # Mitsuba's default, which an emitter would make black
                add(state, number, BSDF, {"type": "diffuse"})
            elif state.nodes[bsdfs[0][1]].props.plugin_name() == "null":
                boundaries.append(number)
    for name, number in held(state, 0, SHAPE):
        if number in boundaries:
            del state.root.props[name]
    depth = max(depths)
    bounces = UNLIMITED if depth < 0 else max(depth - 1, 0)
    entries = {"type": "bounce_path", "max_bounces": bounces}
    add(state, 0, mi.ObjectType.Integrator, entries)
    lights = [plugin for plugin in lights if plugin not in parsing.SURFACE_EMITTERS]
    remarks = {
        f"lamps ({lamps}) have the same temperature as all shapes; change it in the scene": lamps,
        f"left out: {', '.join(lights)}; put an emitter `sky` around the scene": lights,
        f"mediums are left out: {', '.join(dict.fromkeys(mediums))}": mediums,
        f"the integrator has no limit of reflections; max_bounces is {UNLIMITED}": depth < 0,
    }
    return [remark for remark, holds in remarks.items() if holds]


def emissivities(state, words: Sequence[str]) -> dict[int, float]:
    """Emissivities that are given, by the number of the shape.

    words: as in `thermal_scene`. Raises InputError if one does not follow from the BSDF and is not
    given, and for a name that nothing has.
    """
    given, fixed, lacking = dict(map(assigned, words)), {}, {}
    names = {shape: names_of(state, shape) for _, shape in held(state, 0, SHAPE)}
    check_known("shape or BSDF", set().union(*names.values()), *given.keys() - {ALL})
    why = cache(partial(underived, state))
    for shape, known in names.items():
        word = next((name for name in known if name in given), ALL)
        reasons = {bsdf: why(bsdf) for _, bsdf in held(state, shape, BSDF) if word == ALL}
        if word != ALL or (ALL in given and any(reasons.values())):
            fixed[shape] = given[word]
        else:
            lacking |= {bsdf: reason for bsdf, reason in reasons.items() if reason}
    if lacking:
        called = [names_of(state, bsdf)[0] for bsdf in lacking]
        bsdf, reason = next(iter(lacking.items()))
        raise InputError(
            f"{mi.parser.file_location(state, state.nodes[bsdf])}: {reason}, so that its "
            f"emissivity is unknown; give {option('emissivity', 'NUMBER')} for all such surfaces, "
            f"or NAME=NUMBER for each of {', '.join(dict.fromkeys(called))}"
        )
    return fixed


def assigned(word: str) -> tuple[str, float]:
    """Name and number of NAME=NUMBER; the name is ALL for a number alone."""
    name, _, text = word.rpartition("=")
    try:
        number = float(text)
    except ValueError:
        raise InputError(f"emissivity '{word}': must be NUMBER or NAME=NUMBER") from None
    parsing.SHARE.check(number, f"emissivity '{word}'")
    return name, number


def names_of(state, number: int) -> list[str]:
    """Names by which a shape or BSDF is called: ids, then plugins, those of its BSDFs last."""
    node = state.nodes[number]
    own = [node.props.id()] + [node.props.plugin_name()] * (node.type == BSDF)
    inner = [name for _, child in held(state, number, BSDF) for name in names_of(state, child)]
    return [name for name in (*own, *inner) if name]


def underived(state, number: int) -> str:
    """Why the emissivity of a BSDF does not follow from its reflectance; empty if it does."""
    alone = mi.parser.ParserState(state)
    alone.nodes[0] = mi.parser.SceneNode(state.nodes[number])
    try:
        emissivity_of(mi.parser.instantiate(parsing.configuration(), alone))
    except InputError as error:
        return f"bsdf {names_of(state, number)[0]} {WHY.search(str(error))[1]}"
    return ""


def share(scene, ids: set[str]) -> float:
    """Share of the first sensor's image that shows shapes with these ids."""
    numbers = np.random.default_rng(0).random((4, RAYS)).astype(np.float32)
    points = mi.Point2f(*numbers[:2]), mi.Point2f(*numbers[2:])
    ray, _ = scene.sensors()[0].sample_ray(0.0, 0.5, *points)
    shape, seen = scene.ray_intersect_preliminary(ray).shape, mi.Bool(False)
    for one in scene.shapes():
        if one.id() in ids:
            seen |= shape == mi.ShapePtr(one)
    return dr.count(seen)[0] / RAYS


def xml(state, folder: Path, defaults: dict[str, str]) -> str:
    """Text of a thermal scene in a folder, with these $-parameters."""
    for node in state.nodes:
        name = parsing.properties(node).get("filename")
        if isinstance(name, str):
            node.props["filename"] = os.path.relpath(str(mi.file_resolver().resolve(name)), folder)
    root = ElementTree.fromstring(mi.parser.write_string(state))
    identify(root, state, 0)
    for emitter in root.iter("emitter"):
        for entry in emitter:
            if entry.get("name") in defaults:
                entry.set("value", f"${entry.get('name')}")
    for name, value in defaults.items():
        root.insert(0, ElementTree.Element("default", name=name, value=value))
    ElementTree.indent(root, "    ")
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def identify(element: ElementTree.Element, state, number: int) -> None:
    """Give an element and those in it their ids; Mitsuba writes only those that others name."""
    if state.nodes[number].props.id():
        element.set("id", state.nodes[number].props.id())
    inside = [child for child in element if child.tag == "ref" or "type" in child.attrib]
    children = parsing.references(parsing.properties(state.nodes[number]))
    for child, number_of_child in zip(inside, children, strict=True):
        if child.tag != "ref":
            identify(child, state, number_of_child)
