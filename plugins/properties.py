"""Declaration and check of the properties that plugins take from scene files.

A plugin declares its properties as a tuple of `Property` and reads all of them through `read`. A
test compares the declarations with the table in the plugin's docstring, which is the manual page.
"""

import math
import re
from dataclasses import dataclass
from numbers import Integral, Real

import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins.beside_scene import beside_scene

# Largest temperature [K]. Squares of the in-band radiance of a hotter blackbody would come near the
# largest Float32 number.
HOTTEST = 1e5
# Largest radiance [W m^-2 sr^-1]. Its square, summed over many samples, is still a Float32 number.
BRIGHTEST = 1e15
LABEL = re.compile(r"[A-Za-z0-9_-]{1,64}")  # labels become parts of channel and column names
# Names of types in the message about a value of the wrong type.
WORDS = {
    bool: "a boolean",
    int: "an integer",
    float: "a float",
    str: "a string",
}


@dataclass(frozen=True)
class Property:
    """One property of a plugin.

    name: its name in scene files. kind: "float", "integer", "boolean", "string" or "float or
    texture". default: the value if a scene gives none; None if there is no default. lower, upper:
    inclusive bounds of a number. is_positive: a number must be larger than 0. choices: the allowed
    strings. is_label: a string must consist of letters, digits, '_' and '-'. is_file: a string may
    name a file, which is searched beside the scene. unit: unit of a number in messages.
    """

    name: str
    kind: str
    default: object = None
    lower: float = -math.inf
    upper: float = math.inf
    is_positive: bool = False
    choices: tuple[str, ...] = ()
    is_label: bool = False
    is_file: bool = False
    unit: str = ""

    def checked(self, value, plugin: str):
        """The value in the type that the plugin uses.

        Raises InputError if the value has the wrong type or is out of bounds.
        """
        where = f"{plugin}: {self.name}"
        if self.kind == "float or texture" and isinstance(value, mi.Texture):
            return value
        if not self.is_of_kind(value):
            kind = WORDS.get(type(value), f"a {type(value).__name__.lower()}")
            number = f" = {value!r}" if type(value) in WORDS else ""
            raise InputError(f"{where}{number} is {kind}; it must be {self.article()}{self.kind}")
        if self.kind == "string":
            return self.checked_string(value, plugin)
        if self.kind != "boolean" and not self.is_within(value):
            unit = f" {self.unit}" if self.unit else ""
            raise InputError(f"{where} = {value:g}{unit}; it must {self.bounds()}")
        return float(value) if self.kind.startswith("float") else value

    def is_of_kind(self, value) -> bool:
        is_boolean = isinstance(value, (bool, np.bool_))
        if self.kind == "boolean":
            return is_boolean
        if self.kind == "string":
            return isinstance(value, str)
        number = Integral if self.kind == "integer" else Real
        return isinstance(value, number) and not is_boolean

    def is_within(self, value) -> bool:
        return (
            math.isfinite(value)
            and self.lower <= value <= self.upper
            and not (self.is_positive and value <= 0)
        )

    def bounds(self) -> str:
        """Description of the allowed numbers, to follow "must" in a message."""
        upper = f", at most {self.upper:g}" if self.upper < math.inf else ""
        if self.is_positive:
            return f"be positive and finite{upper}"
        if self.lower == -math.inf:
            return f"be finite{upper}"
        if self.upper == math.inf:
            return f"be finite and >= {self.lower:g}"
        return f"lie in {self.lower:g}..{self.upper:g}"

    def article(self) -> str:
        return "an " if self.kind == "integer" else "a "

    def checked_string(self, value: str, plugin: str) -> str:
        if self.choices and value not in self.choices:
            raise InputError(
                f"{plugin}: {self.name} '{value}' is unknown; it must be one of "
                f"{', '.join(self.choices)}"
            )
        if self.is_label and not LABEL.fullmatch(value):
            raise InputError(
                f"{plugin}: {self.name} '{value[:64]}' must consist of letters, digits, '_' and "
                "'-', at most 64 of them"
            )
        return beside_scene(value) if self.is_file else value


def read(props: mi.Properties, plugin: str, declared: tuple[Property, ...]) -> dict:
    """Values of the declared properties by name, or their defaults where none are given.

    Marks the properties as queried, so that Mitsuba rejects all others.

    Parameters
    ----------
    props : mi.Properties
        The properties that the scene gives.
    plugin : str
        Name of the plugin in messages.
    declared : tuple of Property

    Returns
    -------
    dict

    Raises
    ------
    InputError
        If a value is not allowed. The message names plugin, property, value and allowed values.
    """
    return {
        entry.name: entry.checked(props[entry.name], plugin)
        if entry.name in props
        else entry.default
        for entry in declared
    }
