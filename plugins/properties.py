"""Declaration and check of the properties that plugins take from scene files.

A plugin declares its properties as a tuple of `Property` and reads all of them through `read`. A
test compares the declarations with the table in the plugin's docstring, which is the manual page.
"""

import re
from dataclasses import dataclass
from functools import cache
from numbers import Integral, Real
from pathlib import Path

import mitsuba as mi
import numpy as np

from mi_lcair.declared import Bounds, Rule, check_rules
from mi_lcair.errors import InputError, check_known, errors_of

# Largest temperature [K]. Squares of the in-band radiance of a hotter blackbody would come near the
# largest Float32 number.
HOTTEST = 1e5
TEMPERATURE = Bounds(is_positive=True, upper=HOTTEST, unit="K")
# Largest radiance [W m^-2 sr^-1]. Its square, summed over many samples, is still a Float32 number.
BRIGHTEST = 1e15
RADIANCE_UNIT = "W m^-2 sr^-1"
LABEL = re.compile(r"[A-Za-z0-9_-]{1,64}")  # labels become parts of channel and column names
BOOLEANS = {"true": True, "false": False}  # as scene files write them
# Names of types in the message about a value of the wrong type.
WORDS = {bool: "a boolean", int: "an integer", float: "a float", str: "a string"}


@dataclass(frozen=True)
class Property(Bounds):
    """One property of a plugin. A number has the declared `Bounds`.

    name: its name in scene files. kind: "float", "integer", "boolean", "string" or "float or
    texture". default: the value if a scene gives none; None if there is no default. choices: the
    allowed strings; for a boolean, the string that is allowed in its place. is_label: a string must
    consist of letters, digits, '_' and '-'. is_file: a string may name a file, which is searched
    beside the scene.
    """

    name: str
    kind: str
    default: object = None
    choices: tuple[str, ...] = ()
    is_label: bool = False
    is_file: bool = False

    def checked(self, value, plugin: str):
        """The value in the type that the plugin uses.

        Raises InputError if the value has the wrong type or is out of bounds.
        """
        where = f"{plugin}: {self.name}"
        if self.kind == "boolean" and self.choices:
            # A string in the scene file, which may also be one of the choices
            value = BOOLEANS.get(value, value) if isinstance(value, str) else value
            if value in self.choices:
                return value
        if self.kind == "float or texture" and isinstance(value, mi.Texture):
            return value
        if not self.is_of_kind(value):
            kind = WORDS.get(type(value), f"a {type(value).__name__.lower()}")
            number = f" = {value!r}" if type(value) in WORDS else ""
            article = "an" if self.kind == "integer" else "a"
            allowed = f"{article} {self.kind}{self.or_choice()}"
            raise InputError(f"{where}{number} is {kind}; it must be {allowed}")
        if self.kind == "string":
            return self.checked_string(value, plugin)
        if self.kind != "boolean":
            self.check(value, where)
        return float(value) if self.kind.startswith("float") else value

    def is_of_kind(self, value) -> bool:
        is_boolean = isinstance(value, (bool, np.bool_))
        if self.kind == "boolean":
            return is_boolean
        if self.kind == "string":
            return isinstance(value, str)
        number = Integral if self.kind == "integer" else Real
        return isinstance(value, number) and not is_boolean

    def or_choice(self) -> str:
        """The string that is allowed in place of a boolean, for a message."""
        return f" or '{self.choices[0]}'" if self.kind == "boolean" and self.choices else ""

    def checked_string(self, value: str, plugin: str) -> str:
        if self.choices:
            with errors_of(plugin):
                check_known(self.name, self.choices, value)
        if self.is_label and not LABEL.fullmatch(value):
            raise InputError(
                f"{plugin}: {self.name} '{value[:64]}' must consist of letters, digits, '_' and "
                "'-', at most 64 of them"
            )
        return beside_scene(value) if self.is_file else value


def read(
    props: mi.Properties,
    plugin: str,
    declared: tuple[Property, ...],
    rules: tuple[Rule, ...] = (),
) -> dict:
    """Values of the declared properties by name, or their defaults where none are given.

    Marks the properties as queried, so that Mitsuba rejects all others.

    Parameters
    ----------
    props : mi.Properties
        The properties that the scene gives.
    plugin : str
        Name of the plugin in messages.
    declared : tuple of Property
    rules : tuple of Rule
        Those between the properties.

    Returns
    -------
    dict

    Raises
    ------
    InputError
        If a value is not allowed. The message names plugin, property, value and allowed values.
        Also if a rule is broken.
    """
    values = {
        entry.name: entry.checked(props[entry.name], plugin)
        if entry.name in props
        else entry.default
        for entry in declared
    }
    table = table_type(declared)()
    vars(table).update(values)
    with errors_of(plugin):
        check_rules(table, rules)
    return values


@cache
def table_type(declared: tuple[Property, ...]) -> type:
    """A class with the defaults, for rules; one for many objects, as a class is slow to collect."""
    return type("Declared", (), {entry.name: entry.default for entry in declared})


def beside_scene(text: str) -> str:
    """The path of a file named in a scene; a text without a file suffix is returned unchanged."""
    if "." not in text or not Path(text).suffix:
        return text
    return str(mi.file_resolver().resolve(text))
