"""The bundled scenes: their names, files, titles and parameters. Needs no Mitsuba.

A scene is an XML file in this folder. Its first comment is its title and description; each
<default> on the scene's first level is a parameter, and the comment that follows it says what it
is, with its unit.

A scenario is a TOML file in the folder of its scene's name (mi_lcair/detection/scenario.py); its first
comment is its title.
"""

from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from mi_lcair.errors import unknown

FOLDER = Path(__file__).parent


class Parameter(NamedTuple):
    """A scene's $-parameter: its default value as the XML has it, and one line that says what it
    is.
    """

    default: str
    description: str


def names() -> list[str]:
    """Names of the bundled scenes, in alphabetical order."""
    return sorted(file.stem for file in FOLDER.glob("*.xml"))


def path(name: str) -> Path:
    """The XML file of a bundled scene. Raises InputError for an unknown name."""
    if name not in names():
        raise unknown("bundled scene", name, names())
    return FOLDER / f"{name}.xml"


def title(name: str) -> str:
    """What a bundled scene is, in one line. Raises InputError for an unknown name."""
    comment = next(element for element in _elements(name) if element.tag is ElementTree.Comment)
    return comment.text.strip().splitlines()[0]


def parameters(name: str) -> dict[str, Parameter]:
    """Parameters of a bundled scene, in the file's order. Raises InputError for an unknown name."""
    elements = _elements(name)
    return {
        default.get("name"): Parameter(default.get("value"), comment.text.strip())
        for default, comment in zip(elements, elements[1:])
        if default.tag == "default"
    }


def scenarios(name: str | None = None) -> list[str]:
    """Names of the bundled scenarios, SCENE/FILE, in alphabetical order; of one scene or of all."""
    return sorted(
        f"{file.parent.name}/{file.stem}" for file in FOLDER.glob(f"{name or '*'}/*.toml")
    )


def scenario_path(name: str) -> Path:
    """The TOML file of a bundled scenario. Raises InputError for an unknown name."""
    if name not in scenarios():
        raise unknown("scenario", name, [*scenarios(), "a .toml file"])
    return FOLDER / f"{name}.toml"


def scenario_title(name: str) -> str:
    """What a bundled scenario is, in one line. Raises InputError for an unknown name."""
    return first_comment(scenario_path(name).read_text())


def first_comment(toml: str) -> str:
    """The first line of a TOML text, where that is a comment; else nothing."""
    first = toml.strip().partition("\n")[0]
    return first.lstrip("# ").strip() if first.startswith("#") else ""


def _elements(name):
    """The first level of the scene's XML, comments included."""
    parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
    return list(ElementTree.parse(path(name), parser).getroot())
