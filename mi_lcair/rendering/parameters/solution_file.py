"""The file of an inversion's solution, and its use in other scenes."""

from pathlib import Path

from mi_lcair.errors import InputError, check_known
from mi_lcair.files import parse_json, read_text
from mi_lcair.rendering.facets.table import FacetTable
from mi_lcair.rendering.parameters.facets import set_facets
from mi_lcair.rendering.parameters.values import parameters_of, set_values
from mi_lcair.rendering.scene import Scene

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
    return applied(name, read_solution(name), scene, state or of_file or None)


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
