"""Names, files, titles and parameters of the bundled scenes.

This module does not import Mitsuba. A scene is an XML file in this folder. The first comment of the
file is the title and description of the scene. Each <default> on the first level is a parameter.
The comment after it states the meaning and the unit.

A scenario is a TOML file in the folder with its scene's name (mi_lcair/detection/scenario.py). The
first comment of the file is its title.
"""

import os
from difflib import get_close_matches
from os import PathLike
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from mi_lcair import files
from mi_lcair.errors import InputError, unknown

FOLDER = Path(__file__).resolve().parent
USD = (*files.USD, ".usdz")
MODELS = (".obj", ".glb", ".gltf", ".ply", ".stl", *USD)  # suffixes of models, see `models3d`
# Programs by the suffix of their files, which must be exported in one of these formats
UNREAD = {
    ".blend": "Blender",
    ".fbx": "FBX",
    ".dae": "COLLADA",
    ".skp": "SketchUp",
    ".x3d": "X3D",
    **dict.fromkeys((".3ds", ".max"), "3ds Max"),
    **dict.fromkeys((".step", ".stp"), "STEP"),
    **dict.fromkeys((".igs", ".iges"), "IGES"),
}

# Files that are named in place of a scene, by suffix, and what is done with them.
NO_SCENES = {
    **dict.fromkeys(MODELS, "it is a model, of which mi-lcair import makes a scene"),
    ".toml": "a scenario is for contrast, image and budget",
    ".exr": "it is an image, which show and report take",
}


class XMLParameter(NamedTuple):
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


def file_of(scene: str | PathLike[str]) -> Path:
    """Return the XML file of a path, of a folder that `import` wrote, or of a bundled scene's name.

    Raises InputError if there is no such file, or if it is of another kind.
    """
    file = Path(scene)
    if (scene_in_folder := in_folder(scene)) is not None:
        return scene_in_folder
    if not file.suffix and file.parent == Path("."):
        return path(str(scene))
    if os.path.isdir(file):
        raise InputError(f"scene '{scene}': is a folder without scene.xml; name the scene's file")
    if not os.path.isfile(file):  # also False for a text too long to be a path
        raise InputError(f"scene '{scene}': no such file{_hint(str(scene))}")
    if file.suffix.lower() in NO_SCENES:
        raise InputError(f"'{scene}' is no scene: {NO_SCENES[file.suffix.lower()]}")
    return file


def check_model(file: str | PathLike[str]) -> None:
    """Raise InputError for the file of a modelling program that must be exported first."""
    program = UNREAD.get(Path(file).suffix.lower())
    if program:
        raise InputError(
            f"{file}: is a {program} file, which is not read; export the model as "
            f"{', '.join(MODELS[:-1])} or {MODELS[-1]} (in Blender: File, Export, Wavefront)"
        )


def _hint(text: str) -> str:
    """What may be meant by the name of a file that does not exist, as the end of an error."""
    if text.lstrip().startswith("<"):
        return "; mi.load_string loads XML text, and mi_lcair.load takes its scene"
    if text in scenarios():
        return "; it is a scenario, which contrast, image and budget take"
    nearest = get_close_matches(Path(text).stem, names(), 1)
    return f"; the nearest bundled scene is '{nearest[0]}'" if nearest else ""


def title(name: str) -> str:
    """Return the title of a bundled scene, one line. Raises InputError for an unknown name."""
    comment = next(element for element in _elements(name) if element.tag is ElementTree.Comment)
    return comment.text.strip().splitlines()[0]


def parameters(name: str) -> dict[str, XMLParameter]:
    """Return the parameters of a bundled scene, name -> parameter, in the order of the file.

    Raises InputError for an unknown name.
    """
    elements = _elements(name)
    return {
        default.get("name"): XMLParameter(default.get("value"), comment.text.strip())
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
