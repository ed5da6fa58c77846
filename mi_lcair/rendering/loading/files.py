"""Checks of a scene's files before Mitsuba opens them: XML, included files, named files."""

import os
import re
from pathlib import Path
from xml.parsers import expat

from mi_lcair.errors import InputError
from mi_lcair.files import check_file

# Largest depth of nested elements. Real scenes have about 6; Mitsuba's parser is recursive.
DEEPEST = 40
MOST_INCLUDES = 15  # largest depth of nested includes, as in Mitsuba
LARGEST_XML = 2**28  # largest size of an XML file [bytes]
OPERATIONS = ("translate", "rotate", "scale", "lookat", "matrix")
NUMBERS = ("float", "integer", "boolean", "point", "vector", "rgb", "spectrum", *OPERATIONS)
NAMING = ("name", "id", "type", "filename")  # attributes that are not numbers


def survey(path: Path, given: dict[str, str]) -> set[str]:
    """Names of the $-parameters of a scene file and of the files that it includes.

    given: values of some parameters, as text. Raises InputError, with the place, for errors that
    would end Mitsuba's process or that it would ignore: a file that is not XML, is not a regular
    file, is too large or includes itself; elements nested too deep, or inside an element that
    cannot contain any; an empty number.
    """
    reader = Survey(path.parent, given)
    reader.read(path)
    return reader.names


def survey_values(path: Path, given: dict[str, str]) -> dict[str, str]:
    """Values of the $-parameters of a scene file: those given, and defaults of the others."""
    reader = Survey(path.parent, given)
    reader.read(path)
    return reader.values


class Survey:
    """Reads scene files one element at a time.

    names: names of the parameters found so far. values: their values. folders: folders in which
    files are searched. open: the files that are being read, each included by the one before.
    checked: folders and texts for which `check_named` was called.
    """

    def __init__(self, folder: Path, given: dict[str, str]):
        self.values = dict(given)
        self.names: set[str] = set()
        self.folders = [folder, Path()]
        self.open: list[Path] = []
        self.checked: set[tuple[Path, str]] = set()

    def read(self, path: Path) -> None:
        """Read one file and the files that it includes."""
        if path.resolve() in self.open:
            raise InputError(f"{path}: includes itself")
        if len(self.open) > MOST_INCLUDES:
            raise InputError(f"{path}: is the {len(self.open)}th include within each other")
        check_file(path, LARGEST_XML)
        parser = expat.ParserCreate()
        elements: list[str] = []  # tags of the elements that are open in this file

        def place() -> str:
            line, column = parser.CurrentLineNumber, parser.CurrentColumnNumber
            return f"{path} (line {line}, col {column + 1})"

        def start(tag, attributes):
            self.element(tag, attributes, elements[-1] if elements else "", place)
            elements.append(tag)
            if len(elements) > DEEPEST:
                raise InputError(f"{place()}: elements are nested more than {DEEPEST} deep")

        parser.StartElementHandler = start
        parser.EndElementHandler = lambda tag: elements.pop()
        self.open.append(path.resolve())
        try:
            with path.open("rb") as file:
                parser.ParseFile(file)
        except OSError as error:
            raise InputError(f"{path}: cannot be read: {error.strerror}") from None
        except (expat.ExpatError, LookupError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"{path}: is not XML: {error}") from None
        self.open.pop()

    def element(self, tag: str, attributes: dict[str, str], parent: str, place) -> None:
        """Check one element and record its parameters.

        parent: tag of the element that contains it. place: function that gives its place in
        the file, for messages.
        """
        if parent in OPERATIONS:
            raise InputError(f"{place()}: <{tag}> inside <{parent}> is not read; move it outside")
        values = attributes
        if any("$" in value for value in attributes.values()):
            self.names.update(re.findall(r"\$(\w+)", " ".join(attributes.values())))
            values = {name: self.substituted(value) for name, value in attributes.items()}
        if tag in NUMBERS:
            empty = [name for name in values if name not in NAMING and not values[name].strip()]
            if empty:
                name = f' name="{values["name"]}"' if "name" in values else ""
                raise InputError(f"{place()}: <{tag}{name}> has an empty {empty[0]}; give a number")
        if tag == "default" and "name" in values:
            self.names.add(values["name"])
            self.values.setdefault(values["name"], values.get("value", ""))
        elif tag == "path":
            self.folders.append(self.folders[0] / values.get("value", ""))
        elif tag == "include":
            self.include(values.get("filename", ""))
        elif tag == "string":
            self.check_named(values.get("value", ""))
        if tag != "include":
            self.check_named(values.get("filename", ""))

    def substituted(self, text: str) -> str:
        """The text with the parameters' values in place of their names."""
        return re.sub(r"\$(\w+)", lambda name: str(self.values.get(name[1], name[0])), text)

    def check_named(self, text: str) -> None:
        """Raise InputError for a text that names something other than a regular file."""
        for folder in self.folders if text else ():
            if (folder, text) not in self.checked:
                self.checked.add((folder, text))
                check_file(folder / text)

    def include(self, text: str) -> None:
        """Read an included file if it exists; otherwise Mitsuba raises the error later."""
        for folder in (*self.folders, self.open[-1].parent):
            check_file(folder / text)
            if text and os.path.isfile(folder / text):
                self.read(folder / text)
                return
