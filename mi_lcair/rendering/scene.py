"""Loading of a thermal scene, with all checks that are possible before rendering."""

import os
import re
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path

import mitsuba as mi
import numpy as np

from mi_lcair import scenes
from mi_lcair.errors import InputError, mitsuba_error, unknown
from mi_lcair.physics.bands import Band
from mi_lcair.physics.reflection import NAMES
from mi_lcair.plugins.derivatives import deriving_plugins
from mi_lcair.plugins.paths.launch import numbers
from mi_lcair.plugins.reflection_bsdf import is_reflection_bsdf
from mi_lcair.rendering.loading.files import survey
from mi_lcair.rendering.loading.fingerprint import fingerprint, source_digest
from mi_lcair.rendering.loading.meshes import check_mesh_files, check_shapes
from mi_lcair.rendering.loading.names import name_objects
from mi_lcair.rendering.loading.nodes import check_nodes
from mi_lcair.rendering.loading.origin import check_meshes_near, far_origin, move
from mi_lcair.rendering.loading.remarks import (
    clipped,
    shapes_without_bsdf,
    surfaces_that_emit_nothing,
    thin_sheets,
)
from mi_lcair.rendering.loading.samplers import add_samplers, remarks_on_samplers

VARIANTS = ("llvm_ad_mono", "cuda_ad_mono")
PLUGINS = ("material", "plume", "thermal", "sun", "sky_dome", "bounce_path")
# Largest number of moves of a scene to the origin. One move may not be enough, because the position
# of a very distant scene is known only in single precision.
MOVES = 3


@dataclass(frozen=True)
class Scene:
    """A loaded scene.

    mi: Mitsuba's scene. name: name of the bundled scene or of the file. band, groups: the band and
    the groups of its thermal emitters. parameters: the $-parameters that were given, as text.
    notes: remarks on materials and shapes, one line each. sensors: Mitsuba's sensors. path: the
    scene file. origin: position of the loaded scene's origin in the file's coordinates, (3,) [m];
    it is 0 unless the scene was moved. digest: digest of the file and of all files that it names.
    """

    mi: mi.Scene
    name: str
    band: Band
    groups: list[str]
    parameters: dict[str, str]
    notes: list[str]
    sensors: list
    path: Path
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    digest: bytes = b""
    _tracers: dict = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def remarks(self) -> list[str]:
        """Remarks on possible errors of the image, one line each.

        These are the notes, triangles that overlap in one plane, and parts of the scene beyond a
        sensor's clip distances.
        """
        return [*self.notes, *thin_sheets(self.mi), *clipped(self.mi, self.sensors)]

    @property
    def source(self) -> str:
        """Argument of `load` for this scene in another process: a bundled name or a full path."""
        return self.name if self.path.parent == scenes.FOLDER else str(self.path.resolve())

    @property
    def fingerprint(self) -> str:
        """16 hexadecimal digits that change with everything that affects the image.

        These are all properties in the scene file, the content of all files that it names, and
        values that were changed after loading.
        """
        descriptions = [str(self.mi.integrator()), self.band.label]
        descriptions += [
            f"{surface.model.name} {surface.material} {surface.form} {surface.emissivity} "
            f"{surface.lobe}"
            for surface in self.surfaces()
        ]
        return fingerprint(self.digest, self.mi, descriptions)

    def sensor(self, index: int):
        """The sensor with this number, counted from 0; raises InputError if there is none."""
        if index >= len(self.sensors):
            raise InputError(
                f"{self.name}: sensor {index} does not exist; "
                f"the scene has {len(self.sensors)}, counted from 0"
            )
        return self.sensors[index]

    @property
    def sampler(self) -> str:
        """How the first sensor's paths draw their numbers: "lattice" or "independent"."""
        return numbers(self.sensors[0].sampler())

    def prepared(self, by_spectrum: bool = False):
        """Context manager that gives the scene's `PathTracer`, see `BouncePath.prepared`.

        It is the same one as before if nothing has changed, with its tables and its recordings.
        """
        return self.mi.integrator().prepared(self.mi, by_spectrum, self._tracers)

    def surfaces(self) -> list:
        """The scene's BSDFs of reflection models."""
        return [plugin for plugin in deriving_plugins(self.mi) if is_reflection_bsdf(plugin)]

    def set_lobe(self, lobe: str, material: str | None = None) -> None:
        """Set the lobe (brdf, mirror or diffuse) of one material, or of all reflection models."""
        surfaces = self.surfaces()
        chosen = [surface for surface in surfaces if material in (None, surface.material)]
        if not chosen:
            raise unknown("material", material, {surface.material for surface in surfaces})
        for surface in chosen:
            surface.set_lobe(lobe)


def load(scene, /, **parameters) -> Scene:
    """Load a scene XML or a bundled scene.

    Parameters
    ----------
    scene : str or Path
        Path of the file, or a name that `mi-lcair scenes` lists.
    **parameters
        Values of the scene's $-parameters.

    Returns
    -------
    Scene

    Raises
    ------
    InputError
        If the scene cannot be used. Examples: there is no such file, it is not XML, a plugin,
        property or parameter is unknown, a value is out of bounds, the emissivity of an emitting
        surface is not known, the integrator is not bounce_path, there is no thermal emitter.
    """
    if mi.variant() not in VARIANTS:
        raise InputError(
            f"variant {mi.variant()} cannot render thermal scenes; set one of {', '.join(VARIANTS)}"
        )
    path = find(scene)
    texts = {name: str(value) for name, value in parameters.items()}
    known = survey(path, texts)
    for name in texts:
        if name not in known:
            raise unknown(f"parameter of {path.name}", name, known)
    with searching(path.parent):
        try:
            return parsed_and_checked(path, texts)
        except RuntimeError as error:
            raise with_known_plugins(mitsuba_error(error)) from None


def parsed_and_checked(path: Path, texts: dict[str, str]) -> Scene:
    """The Scene of a file, moved to the origin if it is too far away for single precision."""
    state = parsed(path, texts)
    check_nodes(state)
    meshes = check_mesh_files(state)
    digest, defaults = source_digest(state), shapes_without_bsdf(state)
    origin = np.zeros(3)
    loaded = instantiated(state, path)
    for _ in range(MOVES):
        step = far_origin(loaded)
        if step is None:
            break
        origin += step
        state = parsed(path, texts)
        move(state, origin)
        loaded = instantiated(state, path)
    check_meshes_near(meshes, loaded)
    check_shapes(loaded)
    scene = checked(loaded, path, texts)
    notes = [*scene.notes, *defaults, *remarks_on_samplers(state)]
    if origin.any():
        notes.append(
            f"the scene lies {np.linalg.norm(origin):g} m from its origin; for the renderer's "
            "single precision it was moved there"
        )
    return replace(scene, notes=notes, origin=tuple(map(float, origin)), digest=digest)


@contextmanager
def searching(folder: Path):
    """Context manager in which Mitsuba searches for files in this folder first."""
    resolver = mi.file_resolver()
    beside = mi.FileResolver(resolver)
    beside.prepend(str(folder))
    mi.set_file_resolver(beside)
    try:
        yield
    finally:
        mi.set_file_resolver(resolver)


def configuration():
    """Mitsuba's settings for reading scene files."""
    config = mi.parser.ParserConfig(mi.variant())
    # Mitsuba would merge two equal thermal emitters, and one emitter cannot belong to two shapes
    config.merge_equivalent = config.merge_meshes = False
    return config


def parsed(path: Path, texts: dict[str, str]):
    """The parsed scene file, with Embree's watertight intersections switched on.

    Without them, one ray in 1e7 passes through the edge between two facets.
    """
    state = mi.parser.parse_file(configuration(), str(path), **texts)
    mi.parser.transform_all(configuration(), state)
    if state.root.props.plugin_name() != "scene":
        raise InputError(f"{path}: holds no <scene>")
    add_samplers(state)
    name_objects(state)
    if mi.variant().startswith("llvm"):
        state.root.props["embree_use_robust_intersections"] = True
    return state


def instantiated(state, path: Path) -> mi.Scene:
    """Mitsuba's objects of a parsed scene."""
    loaded = mi.parser.instantiate(configuration(), state)
    if not isinstance(loaded, mi.Scene):
        raise InputError(f"{path}: holds no <scene>")
    return loaded


def find(scene) -> Path:
    """The XML file of a path or a bundled scene's name."""
    path = Path(scene)
    if path.suffix or path.parent != Path("."):
        if not os.path.isfile(path):  # also False for a text too long to be a path
            raise InputError(f"scene '{scene}': no such file")
        return path
    return scenes.path(str(scene))


def with_known_plugins(error: Exception) -> Exception:
    """The error, with the nearest names added if it is about an unknown plugin."""
    match = re.search(r'Plugin "(\w+)" not found', str(error))
    if not match:
        return error
    installed = [file.stem for file in (Path(mi.__file__).parent / "plugins").glob("*.*")]
    nearest = get_close_matches(match[1], [*NAMES, *PLUGINS, *installed], n=5, cutoff=0.4)
    return InputError(f"{error}; the nearest known are: {', '.join(nearest) or 'none'}")


def checked(loaded, path: Path, parameters: dict[str, str]) -> Scene:
    """The Scene of Mitsuba's scene; raises InputError if it cannot be rendered."""
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
                f"{path}: the film of sensor {number} has no pixels; "
                "width and height must be positive"
            )
    with integrator.prepared(loaded) as tracer:
        emitters = tracer.emitters  # raises InputError for what cannot be derived
    if emitters.band is None:
        raise InputError(
            f"{path}: no thermal emitter names a band; "
            'add <emitter type="thermal"> to what radiates'
        )
    # The command `import` names every scene file scene.xml, so its folder gives the name
    name = path.resolve().parent.name if path.stem == "scene" else path.stem
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
    """Remarks on the materials of a scene, one line each."""
    lines = []
    for plugin in deriving_plugins(loaded):
        if is_reflection_bsdf(plugin):
            lines += [f"material {plugin.material}: {remark}" for remark in plugin.remarks()]
        elif plugin.material_emissivity is not None and plugin.material_emissivity.kind == "table":
            lines.append(
                f"group {plugin.group}: emissivity tabulated by sampling the BSDF, "
                f"standard error {plugin.material_emissivity.error:.1e}"
            )
    return list(dict.fromkeys([*lines, *surfaces_that_emit_nothing(loaded)]))
