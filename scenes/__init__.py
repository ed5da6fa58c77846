"""Names, files, titles and parameters of the bundled scenes.

This module does not import Mitsuba. A scene is an XML file in this folder. The first comment of the
file is the title and description of the scene. Each <default> on the first level is a parameter.
The comment after it states the meaning and the unit.

A scenario is a TOML file in the folder with its scene's name (mi_lcair/detection/scenario.py). The
first comment of the file is its title.
"""

import os
from os import PathLike
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from mi_lcair.errors import unknown

FOLDER = Path(__file__).resolve().parent


class Parameter(NamedTuple):
    """A $-parameter of a scene: its default value as in the XML, and one line of description."""

    default: str
    description: str


def names() -> list[str]:
    """Return the names of the bundled scenes in alphabetical order."""
    return sorted(file.stem for file in FOLDER.glob("*.xml"))


def path(name: str) -> Path:
    """Return the XML file of a bundled scene. Raises InputError for an unknown name."""
    if name not in names():
        raise unknown("bundled scene", name, names())
    return FOLDER / f"{name}.xml"


def in_folder(folder: str | PathLike[str]) -> Path | None:
    """Return the scene in a folder that `mi-lcair import` wrote, and None for anything else.

    The name of a bundled scene means that scene, also where a folder has the same name.
    """
    scene = Path(folder) / "scene.xml"
    return scene if str(folder) not in names() and os.path.isfile(scene) else None


def title(name: str) -> str:
    """Return the title of a bundled scene, one line. Raises InputError for an unknown name."""
    comment = next(element for element in _elements(name) if element.tag is ElementTree.Comment)
    return comment.text.strip().splitlines()[0]


def parameters(name: str) -> dict[str, Parameter]:
    """Return the parameters of a bundled scene, name -> parameter, in the order of the file.

    Raises InputError for an unknown name.
    """
    elements = _elements(name)
    return {
        default.get("name"): Parameter(default.get("value"), comment.text.strip())
        for default, comment in zip(elements, elements[1:])
        if default.tag == "default"
    }


def scenarios(name: str | None = None) -> list[str]:
    """Return the names of the bundled scenarios, SCENE/FILE, in alphabetical order.

    name: a scene, or None for all scenes. Folders without a scene, such as examples/, have none.
    """
    folders = names() if name is None else [name]
    return sorted(
        f"{scene}/{file.stem}" for scene in folders for file in (FOLDER / scene).glob("*.toml")
    )


def scenario_path(name: str) -> Path:
    """Return the TOML file of a bundled scenario. Raises InputError for an unknown name."""
    if name not in scenarios():
        raise unknown("scenario", name, [*scenarios(), "a .toml file"])
    return FOLDER / f"{name}.toml"


def scenario_title(name: str) -> str:
    """Return the title of a bundled scenario, one line. Raises InputError for an unknown name."""
    return first_comment(scenario_path(name).read_text())


def first_comment(toml: str) -> str:
    """Return the first line of a TOML text without its #, or "" if that line is not a comment."""
    first = toml.strip().partition("\n")[0]
    return first.lstrip("# ").strip() if first.startswith("#") else ""


def _elements(name):
    """Return the elements on the first level of the scene's XML, including comments."""
    parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    return list(ElementTree.parse(path(name), parser).getroot())
