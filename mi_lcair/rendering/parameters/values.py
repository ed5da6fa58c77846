"""Parameters of a loaded scene by name: list, read, change and restore them.

====================== ============================================================================
GROUP.temperature      temperature of all thermal emitters of a group [K]
GROUP@KELVIN.temperature  one of several temperatures of a group: that of the facets which had
                       KELVIN when the scene was loaded [K]
GROUP.radiance         in-band radiance of sources given by `radiance` or `spectrum`
                       [W m^-2 sr^-1]
GROUP.irradiance       in-band irradiance of the sun on a plane perpendicular to it [W m^-2]
GROUP.scale            factor of the radiance of a sky
GROUP.emissivity       `emissivity` of the group's emitters, if they were given one
MATERIAL.NAME          parameter of the reflection model of all surfaces of a material
MATERIAL.scale         factor of what a material or plume by wavelength absorbs; `offset` and
                       `slope` [1/um] add to it, as do at_8000nm, ... near their wavelengths
ID.reflectance         reflectance of Mitsuba's BSDF `diffuse` with this id
ID.transmittance       transmittance of the BSDF `plume` with this id
model.yaw_deg ...      motions of meshes, see `mi_lcair.rendering.motions.motion`
====================== ============================================================================

A surface without a name of its material is called by its model, `diffuse` or `plume`. Several
numbers may belong to one name. Its value is then their mean, by area for a group's numbers.
A change of the value adds the same difference to all temperatures and material parameters. It
multiplies all radiances and emissivities by the same factor.
"""

import copyreg
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType

import mitsuba as mi

from mi_lcair.errors import InputError, check_known, complete
from mi_lcair.files import parse_json, read_text
from mi_lcair.plugins.derivatives import own_memory
from mi_lcair.rendering.facets import FacetTable
from mi_lcair.rendering.loading.parsing import RUN, run_plugin_files
from mi_lcair.rendering.motions.pose import declare, set_motions
from mi_lcair.rendering.motions.table import MOTIONS, Declared, read_motions
from mi_lcair.rendering.parameters import entries
from mi_lcair.rendering.parameters.modes import MODES, declare_modes, modes_of, set_facets
from mi_lcair.rendering.scene import INTEGRATOR, LOBE_OF, Scene, SceneLike, load, load_file, set_all
from mi_lcair.tasks import exclusively

NOT_IN_FILE = (MOTIONS, MODES)  # parameters that name files which declare more parameters


def load_with_values(
    scene: SceneLike,
    parameters: Mapping[str, object],
    around: Sequence[dict] = (),
    motions: Mapping[str, Declared] = MappingProxyType({}),
) -> Scene:
    """Load a scene with values of its parameters, see `mi_lcair.load`.

    parameters: $-parameters, names with a dot as in the table above, MOTIONS: a TOML file, and
    MODES: a CSV file.
    around: as for `load_file`. motions: further motions that are declared.
    """
    values = {n: v for n, v in parameters.items() if "." in n and not n.startswith(LOBE_OF)}
    in_file = {n: v for n, v in parameters.items() if n not in values and n not in NOT_IN_FILE}
    loaded = load_file(scene, in_file, around) if around else load(scene, **in_file)
    in_table = read_motions(str(parameters[MOTIONS])) if MOTIONS in parameters else {}
    if in_table or motions:
        declare(loaded, in_table | dict(motions))
    if MODES in parameters:
        declare_modes(loaded, str(parameters[MODES]))
    if values:
        parameters_named(loaded, list(values))  # names before numbers
        set_values(loaded, {name: number(name, value) for name, value in values.items()})
    loaded.parameters.update({n: str(v) for n, v in parameters.items() if n not in in_file})
    return loaded


@exclusively
def reduced(scene: Scene) -> tuple:
    """What pickle keeps of a scene: what a worker needs to load it again.

    Raises InputError for a scene without a file.
    """
    if scene.path is None:
        raise InputError(
            f"{scene.name}: workers load a scene from its file, and this one was loaded by "
            "Mitsuba; leave the workers out, or give the file"
        )
    integrator = scene.mi.integrator()
    return loaded_again, (
        scene.source,
        tuple((name, whole_path(value)) for name, value in sorted(scene.parameters.items())),
        tuple((name, getattr(integrator, name)) for name in INTEGRATOR),
        tuple(surface.lobe for surface in scene.surfaces()),
        tuple(sorted({str(path) for path, _ in RUN})),
        scene.fingerprint,
    )


copyreg.pickle(Scene, reduced)


@lru_cache(maxsize=2)
@exclusively
def loaded_again(
    source: str, parameters: tuple, settings: tuple, lobes: tuple, plugins: tuple, fingerprint: str
) -> Scene:
    """The scene that `reduced` describes, which a worker loads once.

    Raises InputError if the files here give another scene.
    """
    run_plugin_files(plugins)
    scene = load_with_values(source, dict(parameters))
    set_all(scene.mi.integrator(), dict(settings))
    for surface, lobe in zip(scene.surfaces(), lobes):
        surface.set_lobe(lobe)
    check_same(scene, fingerprint)
    return scene


def check_same(scene: Scene, fingerprint: str) -> None:
    """Raise InputError if a scene has another fingerprint."""
    if scene.fingerprint != fingerprint:
        raise InputError(
            f"scene '{scene.name}' has changed since it was loaded, or is another one on a worker, "
            "whose files or version of mi_lcair differ"
        )


def whole_path(text: str) -> str:
    """The absolute path of a file, because a worker has another working folder; others as are."""
    return str(Path(text).resolve()) if os.path.exists(text) else text


def number(name: str, value: object) -> float:
    """The value of a parameter as a number; raises InputError if it is none."""
    try:
        return float(value)
    except (TypeError, ValueError):
        raise InputError(f"{name} = {value} is no number") from None


def parameters_of(scene: Scene) -> dict[str, entries.Parameter]:
    """All parameters of a loaded scene that have derivatives or can be changed, by name."""
    return {name: entry.described() for name, entry in all_stored(scene).items()}


def all_stored(scene) -> dict[str, entries.StoredParameter]:
    """All parameters of a scene by name."""
    return entries.stored_parameters(scene) | modes_of(scene)


def parameter(scene: Scene, name: str) -> entries.Parameter:
    """The parameter of that name; raises InputError with the nearest names if there is none."""
    return parameters_named(scene, [name])[0].described()


def units(scene, names) -> tuple[str, ...]:
    """Units of parameters; "1" for dimensionless ones. Raises InputError for an unknown name."""
    return tuple(entry.described().unit for entry in parameters_named(scene, names))


def set_values(scene: Scene, values: Mapping[str, float]) -> None:
    """Change parameters of a scene.

    Parameters
    ----------
    scene : Scene
    values : mapping of str to float
        New value of each parameter, by name.

    Raises
    ------
    InputError
        If a name is unknown, if a value is outside its bounds, or if two names change the same
        number. The scene is then as before.
    """
    wanted = checked(scene, values)
    arrays = {}
    for entry, value in wanted:
        for stored, numbers in zip(entry.stored, entry.moved(value) if entry.stored else ()):
            array = arrays.setdefault(stored.owner, stored.array().copy())
            number = ... if stored.number is None else stored.number
            if entry.kind == "mode":  # several modes change the same temperatures
                numbers = array[number] + (numbers - stored.read())
            array[number] = numbers
    by_owner = {owner: mi.Float(array) for owner, array in arrays.items()}
    own_memory(by_owner.values())
    entries.set_arrays(by_owner)
    if motions := {entry.name: value for entry, value in wanted if entry.kind == "motion"}:
        set_motions(scene, motions)


def checked(
    scene: Scene, values: Mapping[str, float]
) -> list[tuple[entries.StoredParameter, float]]:
    """The parameters that `set_values` would change; raises InputError as `set_values`."""
    wanted = list(zip(parameters_named(scene, values), map(float, values.values())))
    entries.check_apart([entry for entry, _ in wanted])
    entries.check_emission(wanted)
    entries.check_materials(wanted)
    return wanted


@contextmanager
def changed(scene: Scene, values: Mapping[str, float]) -> Iterator[None]:
    """Context manager in which parameters have other values, see `set_values`.

    At its end the parameters are exactly as before, bit for bit.
    """
    changing = parameters_named(scene, values)
    owners = {stored.owner for entry in changing for stored in entry.stored}
    before = {(node, key): mi.Float(mi.traverse(node)[key]) for node, key in owners}
    pose = {entry.name: entry.value for entry in changing if entry.kind == "motion"}
    set_values(scene, values)
    try:
        yield
    finally:
        entries.set_arrays(before)
        if pose:
            set_motions(scene, pose)


def parameters_named(scene, names) -> list[entries.StoredParameter]:
    """The entries of parameters with these names, in their order."""
    if isinstance(names, str):
        raise InputError(f"names = '{names}' is one text; give a sequence of names: ['{names}']")
    if not isinstance(names, Iterable):
        raise InputError(f"names = {names!r} must be a sequence such as ['self.temperature']")
    known = all_stored(scene)
    check_known(f"parameter of {scene.name}", known, *names)
    return [known[name] for name in names]


# The file of an inversion's solution, and its use in other scenes
# ----------------------------------------------------------------

KIND = "mi_lcair solution"  # first entry of the file
OF_ANY_BAND = ("temperature",)  # kinds of parameters that hold in every band


def apply_solution(scene: Scene, file: str | Path, state: str | None = None) -> list[str]:
    """Set the parameters of a loaded scene to those of a solution's file.

    Temperatures hold in every band. Materials, emissivities and radiances are taken from data of
    the scene's band.

    Parameters
    ----------
    scene : Scene
    file : path-like
        File that `mi-lcair invert -o` wrote, FILE.json or FILE.json:STATE.
    state : str or None
        Heating state; needed, here or in `file`, if the values of several states differ.

    Returns
    -------
    list of str
        Names of the parameters that were set.

    Raises
    ------
    InputError
        If the file is no solution, or has nothing, or several values, for the scene.
    """
    name, _, of_file = str(file).partition(".json:")
    name = f"{name}.json" if of_file else str(file)
    content = read_solution(name)
    with complete(f"solution {name}: its content"):
        return applied(name, content, scene, state or of_file or None)


def read_solution(file: str | Path) -> dict:
    """The content of a solution's file; raises InputError for any other file."""
    content = parse_json(read_text(file, f"solution {file}"), f"solution {file}")
    if not isinstance(content, dict) or content.get("kind") != KIND:
        raise InputError(f"solution {file}: is no file that mi-lcair invert wrote")
    return content


def applied(file: str, content: dict, scene: Scene, state: str | None) -> list[str]:
    """Set the parameters of a scene to the content of a solution; returns their names."""
    data = content["data"]
    states = {entry["state"] for entry in data}
    check_known(f"state of {file}", states, state)
    known = parameters_of(scene)
    values, facets, owner = {}, {}, {}
    for entry in data:
        if state is not None and entry["state"] != state:
            continue
        chosen = {
            name: value
            for name, value in entry["values"].items()
            if name in known
            and (entry["kinds"][name] in OF_ANY_BAND or entry["band"] == scene.band.name)
        }
        chosen |= {
            (group, int(facet)): kelvin
            for group, temperatures in entry["facets"].items()
            for facet, kelvin in temperatures.items()
        }
        for name, value in chosen.items():
            if owner.setdefault(name, (value, entry))[0] != value:
                other = owner[name][1]
                raise InputError(
                    f"{file}: '{name}' differs between '{other['name']}' and '{entry['name']}'; "
                    f"name a state, {' or '.join(sorted(states))}, as in {file}:STATE"
                )
            if isinstance(name, tuple):
                facets[name] = value
            else:
                values[name] = value
    if not values and not facets:
        raise InputError(
            f"{file}: has no parameter of {scene.name} in band {scene.band.name}; its data are "
            f"{', '.join(sorted({entry['scene'] + ' ' + entry['band'] for entry in data}))}"
        )
    if facets:
        check_facets(file, scene, facets)
        set_facets(scene, {facet: kelvin for (_, facet), kelvin in facets.items()})
    set_values(scene, values)
    return [*values, *sorted({f"{group}.facets" for group, _ in facets})]


def check_facets(file: str, scene: Scene, facets: dict) -> None:
    """Raise InputError unless all facets belong to their groups in the scene."""
    table = FacetTable(scene)
    for group, facet in facets:
        if facet >= table.count or table.group[facet] != group:
            raise InputError(
                f"{file}: facet {facet} of group {group} is not one of {scene.name}; the solution "
                "belongs to another model"
            )
