"""Loading of a thermal scene, with all checks that are possible before rendering."""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path

import mitsuba
import mitsuba as mi
import numpy as np

from mi_lcair import scenes
from mi_lcair.errors import InputError, check_known, mitsuba_error, unknown
from mi_lcair.physics.bands import Band
from mi_lcair.physics.spectra.bins import Binning
from mi_lcair.plugins import PLUGINS
from mi_lcair.plugins.bsdfs.reflection_bsdf import is_reflection_bsdf
from mi_lcair.plugins.derivatives import deriving, nodes
from mi_lcair.plugins.integrators.bounce_path import BouncePath
from mi_lcair.plugins.paths.launch import numbers
from mi_lcair.plugins.paths.scene_state import SceneState
from mi_lcair.rendering.loading import parsing, remarks
from mi_lcair.rendering.loading.files import survey
from mi_lcair.rendering.loading.meshes import (
    check_mesh_files,
    check_shapes,
    described_digest,
    fingerprint,
    source_digest,
)
from mi_lcair.startup import VARIANTS, check_variant
from mi_lcair.tasks import discarded, exclusive, exclusively

# Largest number of moves of a scene to the origin. One move may not be enough, because the position
# of a very distant scene is known only in single precision.
MOVES = 3
LOBE_OF = "lobe."  # beginning of a parameter that sets the lobe of a material


@dataclass(frozen=True, eq=False, repr=False)
class Scene:
    """A loaded scene. You can pass it to every function of mi_lcair, and to `mi.render` and
    `mi.traverse`.

    Attributes
    ----------
    mi : mi.Scene
        Mitsuba's scene. If you change its objects, for example by `mi.traverse(scene)` and
        `update()`, all later results use the changed scene.
    name : str
        Name of the bundled scene or of the file, or the id of a scene that Mitsuba loaded.
    band : Band
        Band of its thermal emitters.
    groups : list of str
        Groups of its thermal emitters.
    parameters : dict of str to str
        $-parameters that were given, as text.
    notes : list of str
        Warnings about materials and shapes, one line each.
    of_nothing : tuple of str
        Those of the notes about reflections of empty space.
    sensors : list of mi.Sensor
        Mitsuba's sensors.
    path : Path or None
        The scene file. None for a scene that Mitsuba loaded.
    origin : tuple of float
        Position of the loaded scene's origin in the file's coordinates, (3,) [m]. It is 0 unless
        the scene was moved.
    digest : bytes
        Digest of the file and of all files that it names, or of the description that Mitsuba
        prints of its own scene.
    """

    mi: mi.Scene
    name: str
    band: Band
    groups: list[str]
    parameters: dict[str, str]
    notes: list[str]
    sensors: list[mitsuba.Sensor]
    path: Path | None
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    digest: bytes = b""
    of_nothing: tuple[str, ...] = ()
    # What motions have changed in `mi`, shared by all scenes with the same objects.
    moved: dict = field(default_factory=dict, repr=False, compare=False)
    _tracers: dict = field(default_factory=dict, init=False, repr=False, compare=False)
    # The state of the scene for which triangles were last compared, and the remarks on them.
    _compared: list = field(default_factory=list, init=False, repr=False, compare=False)

    def __del__(self, turn=exclusive, later=discarded) -> None:
        # Mitsuba's objects leave Dr.Jit's registry. If another thread is recording, it holds the
        # registry and waits for Python's lock, which this thread would hold meanwhile. When Python
        # ends, the module's names are gone, and those of the arguments are not.
        later.append(vars(self).copy())
        vars(self).clear()
        if turn.acquire(blocking=False):
            later.clear()
            turn.release()

    def __repr__(self) -> str:
        from mi_lcair.rendering.loading.meshes import line

        return line(self)

    @property
    def remarks(self) -> list[str]:
        """Remarks on possible errors of the image, one line each.

        These are the notes, triangles that overlap in one plane, and parts of the scene beyond a
        sensor's clip distances. Triangles are compared again only if the scene has changed.
        """
        with exclusive:
            state = SceneState(nodes(self.mi))
            if not self._compared or self._compared[0] != state:
                self._compared[:] = state, remarks.remarks_on_triangles(self.mi)
        return [*self.notes, *self._compared[1], *remarks.clipped(self.mi, self.sensors)]

    @property
    def source(self) -> str:
        """Argument of `load` for this scene in another process: a bundled name or a full path.

        The name, which cannot be loaded, for a scene without a file.
        """
        in_file = self.path is not None and self.path.parent != scenes.FOLDER
        return str(self.path.resolve()) if in_file else self.name

    @property
    @exclusively
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
        spectra = [surface.spectrum for surface in self.surfaces()]
        descriptions += [spectrum.digest for spectrum in spectra if spectrum is not None]
        return fingerprint(self.digest, self.mi, descriptions)

    def sensor(self, index: int) -> mitsuba.Sensor:
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

    def prepared(
        self,
        by_spectrum: bool = False,
        explored: Collection[mitsuba.BSDF] = (),
        binning: Binning = Binning(),
    ) -> AbstractContextManager:
        """Context manager that gives the scene's `PathTracer`, see `BouncePath.prepared`.

        It is the same one as before if nothing has changed, with its tables and its recordings.
        """
        return self.mi.integrator().prepared(self.mi, by_spectrum, self._tracers, explored, binning)

    def surfaces(self) -> list[mitsuba.BSDF]:
        """The scene's BSDFs of reflection models."""
        return [plugin for plugin in deriving(nodes(self.mi)) if is_reflection_bsdf(plugin)]

    def set_lobe(self, lobe: str, material: str | None = None) -> None:
        """Set the lobe (brdf, mirror or diffuse) of one material, or of all reflection models."""
        surfaces = self.surfaces()
        if not surfaces:
            raise InputError(f"{self.name}: no lobe can be set; no surface has a reflection model")
        of_material = [surface for surface in surfaces if material in (None, surface.material)]
        if not of_material:
            raise unknown("material", material, {surface.material for surface in surfaces})
        for surface in of_material:
            surface.set_lobe(lobe)


# What functions take for a scene: a loaded one, a bundled name, a file, or Mitsuba's own
SceneLike = Scene | mi.Scene | str | PathLike[str]


@exclusively
def load(scene: str | PathLike[str] | mi.Scene, /, **parameters: object) -> Scene:
    """The Scene of a file, or of a scene that Mitsuba loaded, see `mi_lcair.load`."""
    check_variant(VARIANTS.__contains__)
    if not isinstance(scene, (str, PathLike)):
        if parameters:
            raise InputError(f"{parameters_of_loaded(parameters)}; mi.load_file takes them")
        return of_mitsuba(scene)
    return load_file(scene, parameters)


def load_file(
    scene: str | PathLike[str], parameters: Mapping[str, object], around: Sequence[dict] = ()
) -> Scene:
    """Load a scene XML or a bundled scene, see `load`.

    around: properties of emitters that replace sky and sun of the scene, see `Words.emitters`.
    """
    path = scenes.file_of(scene)
    texts = {name: str(value) for name, value in parameters.items()}
    in_file = {name: text for name, text in texts.items() if not name.startswith(LOBE_OF)}
    known = survey(path, in_file)
    check_known(f"parameter of {path.name}", known, *in_file)
    with parsing.searching(path.parent):
        try:
            loaded = parsed_and_checked(path, in_file, around)
        except RuntimeError as error:
            error = parsing.with_known_plugins(mitsuba_error(error))
            raise with_parameter(error, path, in_file) from None
    for name in texts.keys() - in_file.keys():
        loaded.set_lobe(texts[name], name.removeprefix(LOBE_OF))
    return replace(loaded, parameters=texts)


def with_parameter(error: Exception, path: Path, given: Mapping[str, str]) -> Exception:
    """The error, with the $-parameter that was given the text which Mitsuba's message quotes.

    Of a bundled scene the meaning of the parameter is added.
    """
    quoted = " ".join(re.findall('"([^"]*)"', str(error)))
    for name, text in given.items():
        if text and re.search(rf"(?<![^\W_]){re.escape(text)}(?![^\W_])", quoted):
            known = scenes.parameters(path.stem) if path.parent == scenes.FOLDER else {}
            meaning = f": {known[name].description}" if name in known else ""
            message = f"{str(error).rstrip('!.')}; parameter {name} = {text}{meaning}"
            return type(error)(message)
    return error


def parameters_of_loaded(parameters: Mapping[str, object]) -> str:
    """The beginning of an error for $-parameters of a scene that is loaded already."""
    return f"the scene is loaded, so that its $-parameters ({', '.join(parameters)}) are set"


def of_mitsuba(loaded: mi.Scene) -> Scene:
    """The Scene of a scene that Mitsuba has loaded; see `load`."""
    if not isinstance(loaded, mi.Scene):
        raise InputError(
            f"{type(loaded).__name__} is no scene; give a Scene, the name of a bundled scene, a "
            f"file, or a scene that Mitsuba loaded in the variant {mi.variant()}"
        )
    check_shapes(loaded)
    scene = checked(loaded, None, {})
    notes = [*scene.notes, *remarks.remarks_on_loaded(loaded)]
    return replace(scene, notes=notes, digest=described_digest(loaded))


def parsed_and_checked(path: Path, texts: dict[str, str], around: Sequence[dict]) -> Scene:
    """The Scene of a file, moved to the origin if it is too far away for single precision."""
    state = parsing.parsed(path, texts, around)
    parsing.check_nodes(state)
    meshes = check_mesh_files(state)
    digest, defaults = source_digest(state), remarks.shapes_without_bsdf(state)
    origin = np.zeros(3)
    loaded = parsing.instantiated(state)
    for _ in range(MOVES):
        step = parsing.far_origin(loaded)
        if step is None:
            break
        origin += step
        state = parsing.parsed(path, texts, around)
        parsing.move(state, origin)
        loaded = parsing.instantiated(state)
    parsing.check_meshes_near(meshes, state, loaded)
    check_shapes(loaded)
    scene = checked(loaded, path, texts)
    notes = [*scene.notes, *defaults, *parsing.remarks_on_samplers(state)]
    notes += remarks.turned_inside_out(state, loaded)
    if origin.any():
        notes.append(
            f"the scene is {np.linalg.norm(origin):g} m away from its origin; it was moved to "
            "the origin, because the renderer uses single precision"
        )
    return replace(scene, notes=notes, origin=tuple(map(float, origin)), digest=digest)


def checked(loaded: mi.Scene, path: Path | None, parameters: dict[str, str]) -> Scene:
    """The Scene of Mitsuba's scene; raises InputError if it cannot be rendered.

    path: its file; None if Mitsuba loaded it.
    """
    # The command `import` names every scene file scene.xml, so its folder gives the name
    if path is None:
        name = where = loaded.id() or "scene"
    else:
        name = path.resolve().parent.name if path.stem == "scene" else path.stem
        where = str(path)
    integrator = loaded.integrator()
    if not isinstance(integrator, PLUGINS["bounce_path"].type):
        now = "" if integrator is None else f", not {integrator.class_name()}"
        raise InputError(
            f'{where}: the integrator must be bounce_path{now}: <integrator type="bounce_path"/>'
            + (
                ', or {"type": "bounce_path"} for mi.load_dict'
                if path is None
                else "; mi-lcair import makes a thermal scene of one that was written for Mitsuba"
            )
        )
    if not loaded.sensors():
        raise InputError(f"{where}: has no sensor")
    for number, sensor in enumerate(loaded.sensors()):
        if 0 in sensor.film().crop_size():
            raise InputError(
                f"{where}: the film of sensor {number} has no pixels; "
                "width and height must be positive"
            )
    with integrator.prepared(loaded) as tracer:
        emitters = tracer.emitters  # raises InputError for what cannot be derived
        # The void around bundled scenes is meant
        is_bundled = path is not None and path.parent == scenes.FOLDER
        of_view = ([], []) if is_bundled else remarks.remarks_on_view(loaded, emitters)
        of_nothing, behind = of_view
        bins = tracer.bins
        of_bins = [f"materials by wavelength: {bins} without air and tolerance"] if bins else []
    if emitters.band is None:
        raise InputError(
            f"{where}: no thermal emitter names a band; "
            'add <emitter type="thermal"> to what radiates'
        )
    return Scene(
        mi=loaded,
        name=name,
        band=emitters.band,
        groups=emitters.labels,
        parameters=parameters,
        notes=[
            *remarks.remarks_on_materials(loaded),
            *remarks.suns_below_the_horizon(loaded),
            *remarks.skies_by_night(loaded),
            *of_nothing,
            *behind,
            *of_bins,
        ],
        sensors=list(loaded.sensors()),
        path=path,
        of_nothing=tuple(of_nothing),
    )


# Settings of a loaded scene that may change between renders, and how to change them
# ----------------------------------------------------------------------------------

INTEGRATOR = tuple(entry.name for entry in BouncePath.PROPERTIES)


@contextmanager
def changed(
    scene: Scene, lobe: str | dict[str, str] | None = None, **settings: object
) -> Iterator[None]:
    """Context manager in which a scene has other settings; they are restored at the end.

    lobe: lobe of all reflection models, or of some materials as a dictionary (brdf, mirror or
    diffuse). settings: properties of bounce_path. Raises InputError for an unknown name, material
    or lobe, and for values that contradict each other.
    """
    integrator = scene.mi.integrator()
    check_known("setting", INTEGRATOR, *settings)
    values = {name: getattr(integrator, name) for name in settings}
    with exclusive:
        # Recorded by surface, because two surfaces with the same material may have different lobes
        lobes = [(surface, surface.lobe) for surface in scene.surfaces()]
    try:
        with exclusive:
            for material, rung in (lobe if isinstance(lobe, dict) else {None: lobe}).items():
                if rung is not None:
                    scene.set_lobe(rung, material)
            set_all(integrator, settings)
            integrator.check()
        yield
    finally:
        with exclusive:
            set_all(integrator, values)
            for surface, rung in lobes:
                surface.set_lobe(rung)


def set_all(integrator, values: dict) -> None:
    for name, value in values.items():
        setattr(integrator, name, value)
