"""Properties of the project's plugins: one declaration each, which says what a scene may write and
what the plugin's manual page says.

A plugin declares its properties as a tuple of `Property` and takes all of them through `read`. A
test compares each declaration with the table in the plugin's docstring.
"""

import math
import re
from dataclasses import dataclass
from numbers import Integral, Real

import mitsuba as mi
import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.plugins.beside_scene import beside_scene

HOTTEST = 1e5  # K; beyond it, in-band radiances approach the limits of Float32's squares
BRIGHTEST = 1e15  # W m^-2 sr^-1; its square, times many samples, still fits into Float32
LABEL = re.compile(r"[A-Za-z0-9_-]{1,64}")  # names of channels and of columns are made of labels
WORDS = {  # how a message names a value of the wrong kind
    bool: "a boolean",
    int: "an integer",
    float: "a float",
    str: "a string",
}


@dataclass(frozen=True)
class Property:
    """One property of a plugin.

    name: in scene files. kind: "float", "integer", "boolean", "string" or "float or texture".
    default: the value where a scene gives none; None where there is no such value. lower, upper:
    bounds of a number, inclusive; is_positive: 0 itself is excluded too. choices: the only strings
    that are allowed. is_label: a string of letters, digits, '_' and '-'. is_file: a string that may
    name a file, which is looked for beside the scene. unit: of a number, in messages.
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
        """The value as the plugin takes it. Raises InputError where it is of another kind or out of
        bounds.
        """
        where = f"{plugin}: {self.name}"
        if self.kind == "float or texture" and isinstance(value, mi.Texture):
            return value
        if not self.is_of_kind(value):
            found = WORDS.get(type(value), f"a {type(value).__name__.lower()}")
            shown = f" = {value!r}" if type(value) in WORDS else ""
            raise InputError(f"{where}{shown} is {found}; it must be {self.article()}{self.kind}")
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
        """The allowed numbers, after "must"."""
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
    """The value of each declared property by its name; of one that is not given, its default.

    Marks the properties as queried, so that Mitsuba refuses what is not declared. Raises
    InputError, one line that names plugin, property, value and what would be right.
    """
    return {
        entry.name: entry.checked(props[entry.name], plugin)
        if entry.name in props
        else entry.default
        for entry in declared
    }
