"""Loading a thermal scene and checking, before anything is rendered, that it can be."""

import re
from dataclasses import dataclass
from difflib import get_close_matches
from hashlib import sha256
from pathlib import Path
from xml.etree import ElementTree

import mitsuba as mi
import numpy as np

from mi_lcair import scenes
from mi_lcair.errors import InputError, mitsuba_error, unknown
from mi_lcair.physics.bands import Band
from mi_lcair.physics.reflection import NAMES
from mi_lcair.plugins.derivatives import deriving_plugins, members
from mi_lcair.plugins.reflection_bsdf import is_reflection_bsdf

VARIANTS = ("llvm_ad_mono", "cuda_ad_mono")
NO_ID = re.compile(r"object_\d+")  # what has no id is named by its address in memory


@dataclass(frozen=True)
class Scene:
    """A loaded scene: `mi` is Mitsuba's own object, `band` and `groups` what its thermal emitters
    name.

    name: the bundled scene's name or the file's; parameters: the $-parameters that were given, as
    text; notes: what a user should know of its materials, one line each; sensors: through which it
    may be seen; path: its file.
    """

    mi: mi.Scene
    name: str
    band: Band
    groups: list[str]
    parameters: dict[str, str]
    notes: list[str]
    sensors: list
    path: Path

    @property
    def remarks(self) -> list[str]:
        """What a user should know before trusting the picture: the notes, and what the sensors
        cannot see.
        """
        return [*self.notes, *clipped(self.mi, self.sensors)]

    @property
    def source(self) -> str:
        """What `load` takes for it in another process: a bundled scene's name, or the file's whole
        path.
        """
        return self.name if self.path.parent == scenes.FOLDER else str(self.path.resolve())

    @property
    def fingerprint(self) -> str:
        """16 hexadecimal digits that change with whatever the picture depends on: shapes,
        materials, emitters, integrator.
        """
        said = [str(self.mi.integrator()), self.band.label]
        said += [
            f"{surface.model.name} {surface.material} {surface.form} {surface.emissivity} {surface.lobe}"
            for surface in self.surfaces()
        ]
        said += [
            f"{getattr(shape.emitter(), 'group', '')} {getattr(shape.emitter(), 'facet_type', '')}"
            for shape in self.mi.shapes()
        ]
        digest = sha256()
        for name, value in [*enumerate(said), *mi.traverse(self.mi)]:
            exact = hasattr(value, "__array__") or isinstance(value, (int, float))
            digest.update(
                NO_ID.sub("", str(name)).encode()
                + (
                    np.ascontiguousarray(value).tobytes()
                    if exact
                    else NO_ID.sub("", str(value)).encode()
                )
            )
        return digest.hexdigest()[:16]

    def sensor(self, index: int):
        if index >= len(self.sensors):
            raise InputError(
                f"{self.name}: sensor {index} does not exist; the scene has {len(self.sensors)}, counted from 0"
            )
        return self.sensors[index]

    def prepared(self, by_spectrum: bool = False):
        """Context manager that gives the scene's `PathTracer`; within, its paths may be traced."""
        return self.mi.integrator().prepared(self.mi, by_spectrum)

    def surfaces(self) -> list:
        """The scene's BSDFs of reflection models."""
        return [plugin for plugin in deriving_plugins(self.mi) if is_reflection_bsdf(plugin)]

    def set_lobe(self, lobe: str, material: str | None = None) -> None:
        """Sets the fidelity rung (brdf, mirror, diffuse) of one material, or of all that
        have a fidelity ladder.
        """
        surfaces = self.surfaces()
        chosen = [surface for surface in surfaces if material in (None, surface.material)]
        if not chosen:
            raise unknown("material", material, {surface.material for surface in surfaces})
        for surface in chosen:
            surface.set_lobe(lobe)


def load(scene, /, **parameters) -> Scene:
    """Loads a scene XML or a bundled scene, with values for its $-parameters.

    scene: a path, or a name that `mi-lcair scenes` lists. Raises InputError, one line, for whatever
    makes the scene unusable: no such file, not XML, an unknown plugin, property or parameter, a bad
    value, an emitting surface whose emissivity is not known, another integrator, no thermal
    emitter.
    """
    if mi.variant() not in VARIANTS:
        raise InputError(
            f"variant {mi.variant()} cannot render thermal scenes; set one of {', '.join(VARIANTS)}"
        )
    path = find(scene)
    texts = {name: str(value) for name, value in parameters.items()}
    known = declared_parameters(path, texts)
    for name in texts:
        if name not in known:
            raise unknown(f"parameter of {path.name}", name, known)
    try:
        loaded = instantiated(path, texts)
    except RuntimeError as error:
        raise with_known_plugins(mitsuba_error(error)) from None
    if not isinstance(loaded, mi.Scene):
        raise InputError(f"{path}: holds no <scene>")
    return checked(loaded, path, texts)


def instantiated(path: Path, texts: dict[str, str]):
    """What `mi.load_file` makes of a scene file, but with Embree's watertight intersections:
    without them one ray in 1e7 slips through the edge between two facets.
    """
    config = mi.parser.ParserConfig(mi.variant())
    # Mitsuba would merge two equal thermal emitters, and one emitter cannot belong to two shapes
    config.merge_equivalent = config.merge_meshes = False
    resolver = mi.file_resolver()
    beside = mi.FileResolver(resolver)
    beside.prepend(str(path.parent))
    mi.set_file_resolver(beside)
    try:
        state = mi.parser.parse_file(config, str(path), **texts)
        mi.parser.transform_all(config, state)
        if state.root.props.plugin_name() == "scene" and mi.variant().startswith("llvm"):
            state.root.props["embree_use_robust_intersections"] = True
        return mi.parser.instantiate(config, state)
    finally:
        mi.set_file_resolver(resolver)


def find(scene) -> Path:
    """The XML file of a path or a bundled scene's name."""
    path = Path(scene)
    if path.suffix or path.parent != Path("."):
        if not path.is_file():
            raise InputError(f"scene '{scene}': no such file")
        return path
    return scenes.path(str(scene))


def declared_parameters(path: Path, given: dict[str, str]) -> set[str]:
    """Names of the $-parameters of a scene file and of what it includes, for the values `given` to
    some of them.
    """
    try:
        root = ElementTree.parse(path).getroot()
    except (ElementTree.ParseError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: is not XML: {error}") from None
    values = {default.get("name"): default.get("value") for default in root.iter("default")} | given
    names = {default.get("name") for default in root.iter("default")}
    names.update(
        name
        for element in root.iter()
        for value in element.attrib.values()
        for name in re.findall(r"\$(\w+)", value)
    )
    for include in root.iter("include"):
        file = path.parent / re.sub(
            r"\$(\w+)", lambda name: str(values.get(name[1], name[0])), include.get("filename", "")
        )
        if file.is_file():
            names |= declared_parameters(file, values)
    return names


def with_known_plugins(error: Exception) -> Exception:
    """Adds the nearest names to the error of an unknown plugin."""
    found = re.search(r'Plugin "(\w+)" not found', str(error))
    if not found:
        return error
    installed = [file.stem for file in (Path(mi.__file__).parent / "plugins").glob("*.*")]
    nearest = get_close_matches(
        found[1], [*NAMES, "material", "thermal", "bounce_path", *installed], n=5, cutoff=0.4
    )
    return InputError(f"{error}; the nearest known are: {', '.join(nearest) or 'none'}")


def checked(loaded, path: Path, parameters: dict[str, str]) -> Scene:
    """The Scene, with its derived quantities made; refuses what cannot be rendered."""
    integrator = loaded.integrator()
    if not hasattr(integrator, "prepared"):
        raise InputError(
            f'{path}: the integrator must be bounce_path: <integrator type="bounce_path"/>'
        )
    if not loaded.sensors():
        raise InputError(f"{path}: has no sensor")
    for number, sensor in enumerate(loaded.sensors()):
        if 0 in sensor.film().crop_size():
            raise InputError(
                f"{path}: the film of sensor {number} has no pixels; width and height must be positive"
            )
    with integrator.prepared(loaded) as tracer:
        emitters = tracer.emitters  # whatever cannot be derived is refused here
    if emitters.band is None:
        raise InputError(
            f'{path}: no thermal emitter names a band; add <emitter type="thermal"> to what radiates'
        )
    name = (
        path.resolve().parent.name if path.stem == "scene" else path.stem
    )  # as `import` names its files
    return Scene(
        mi=loaded,
        name=name,
        band=emitters.band,
        groups=emitters.labels,
        parameters=parameters,
        notes=notes(loaded),
        sensors=list(loaded.sensors()),
        path=path,
    )


def notes(loaded) -> list[str]:
    found = []
    for plugin in deriving_plugins(loaded):
        if is_reflection_bsdf(plugin):
            found += [f"material {plugin.material}: {remark}" for remark in plugin.remarks()]
        elif plugin.material_emissivity is not None and plugin.material_emissivity.kind == "table":
            found.append(
                f"group {plugin.group}: emissivity tabulated by sampling the BSDF, "
                f"standard error {plugin.material_emissivity.error:.1e}"
            )
    return list(dict.fromkeys(found))


def clipped(loaded, sensors) -> list[str]:
    """Remarks on sensors that may not see the scene whole: Mitsuba cuts each first ray at near_clip
    and far_clip, 0.01 m and 10 km unless the scene says otherwise.
    """
    box, found = loaded.bbox(), []
    low, high = np.array(box.min), np.array(box.max)
    for number, sensor in enumerate(sensors):
        clips, place = members(sensor), members(sensor).get("to_world")
        if place is None or "near_clip" not in clips:
            continue
        eye = np.array(place.matrix)[:3, 3].ravel()[:3]
        nearest = np.linalg.norm(np.maximum(np.maximum(low - eye, eye - high), 0))
        farthest = np.linalg.norm(np.maximum(high - eye, eye - low))
        if nearest < clips["near_clip"] and clips["near_clip"] > 0.01 * np.linalg.norm(high - low):
            found.append(
                f"sensor {number}: does not see what is nearer than its near_clip = {clips['near_clip']:g} m"
            )
        if farthest > clips["far_clip"]:
            found.append(
                f"sensor {number}: does not see what is farther than its far_clip = {clips['far_clip']:g} m"
            )
    return found
