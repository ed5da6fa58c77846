"""Declarations of what a user states: numbers, tables, and rules between the entries of a table.

Parameters of reflection models, properties of plugins and entries of TOML tables are declared with
`Bounds`. A table is a dataclass on the base `Described`, which checks it:

.. code-block:: python

    @dataclass(frozen=True)
    class Optics(Described, where="[optics]", rules=(one_of("focal_m", "angle_deg"),)):
        focal_m: float | None = entry(None, is_positive=True, unit="m")
        angle_deg: float | None = entry(None, lower=1, upper=90)
        lens: Literal["thin", "aplanatic"] = "thin"
        axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
"""

import math
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import MISSING, dataclass, field, fields
from numbers import Integral, Real
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin

from mi_lcair.errors import InputError, check_known, errors_of


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """Bounds of a number, its unit and its meaning.

    lower, upper: inclusive bounds. is_positive: whether the number must be larger than 0. unit: in
    messages and tables; "1" for a dimensionless number, or if the number's name ends with the unit.
    meaning: description in one line.
    """

    lower: float = -math.inf
    upper: float = math.inf
    is_positive: bool = False
    unit: str = "1"
    meaning: str = ""

    def check(self, value: float, name: str, rounding: float = 0.0, hint: str = "") -> None:
        """Raise InputError if a number is not finite or lies outside the bounds.

        name: the number's name in the message. rounding: relative excess that is allowed. hint:
        ends the message.
        """
        least = self.lower - rounding * abs(self.lower) if rounding else self.lower
        most = self.upper + rounding * abs(self.upper) if rounding else self.upper
        if isinstance(value, (str, bool)) or not (
            math.isfinite(value) and least <= value <= most and (value > 0 or not self.is_positive)
        ):
            unit = "" if self.unit == "1" else f" {self.unit}"
            raise InputError(f"{name} = {in_words(value)}{unit}; must {self}{hint}")

    def check_all(self, values: Any, name: Callable[[int], str], hint: str = "") -> None:
        """Check the least and the largest number of an array (n,), or NaN if it has any.

        name: the name of a number of the array in the message, by its place.
        """
        for k in (values.argmin(), values.argmax()) if len(values) else ():
            self.check(values[k], name(k), hint=hint)

    def __str__(self) -> str:
        """The allowed numbers, to follow "must" in a message."""
        upper = f" and at most {in_words(self.upper)}" if self.upper < math.inf else ""
        if self.is_positive:
            return f"be positive{upper}" if upper else "be positive and finite"
        if self.lower == -math.inf:
            return f"be finite{upper}"
        if upper:
            return f"lie in {in_words(self.lower)}..{in_words(self.upper)}"
        return f"be {in_words(self.lower)} or more, and finite"


def in_words(value: float | str | bool) -> str:
    """A value as TOML has it: an integer with all its digits, another number with six."""
    if isinstance(value, (str, bool)):
        return f'"{value}"' if isinstance(value, str) else str(value).lower()
    return str(value) if isinstance(value, int) else f"{value:g}"


def entry(default: Any = MISSING, is_file: bool = False, **bounds: Any) -> Any:
    """Field of a dataclass: a number with the given `Bounds`, or a text that may name a file.

    default: also dict, for an empty one.
    """
    declared = {"is_file": True} if is_file else {"bounds": Bounds(**bounds)}
    default = {"default_factory" if default is dict else "default": default}
    return field(**default, metadata=declared)


@dataclass(frozen=True)
class Rule:
    """A rule between the entries of a table.

    message: of a table, what is wrong, or None. replaced: by the name of an entry, those that it
    takes the place of.
    """

    message: Callable[[Any], str | None]
    replaced: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


def given(table: Any, names: tuple[str, ...]) -> list[str]:
    """The names of the entries that differ from their defaults, the attributes of the class."""
    return [name for name in names if getattr(table, name) != getattr(type(table), name, MISSING)]


def listed(names: Any, last: str = "and") -> str:
    """Names in a sentence: "a, b and c"."""
    *first, final = names
    return f"{', '.join(first)} {last} {final}" if first else final


def rule(holds: Callable[[Any], Any], message: str) -> Rule:
    """The rule that `holds(table)`. message: a format, in which `t` is the table."""
    return Rule(lambda table: None if holds(table) else message.format(t=table))


def one_of(*names: str, is_needed: bool = True) -> Rule:
    """The rule that exactly one of the entries is given, or at most one if none is needed."""

    def message(table):
        has = given(table, names)
        if not has and is_needed:
            verb = "are" if len(names) > 1 else "is"
            return f"{listed(names)} {verb} missing; give one of them"
        return f"has {listed(has)}; give one of {listed(names)}" if len(has) > 1 else None

    return Rule(message, {name: tuple(x for x in names if x != name) for name in names})


def excludes(name: str, *others: str, why: str = "give one of them") -> Rule:
    """The rule that an entry and any of the others do not go together."""

    def message(table):
        has = given(table, others) if given(table, (name,)) else []
        return f"{name} and {has[0]} cannot be combined; {why}" if has else None

    return Rule(message, {name: others, **dict.fromkeys(others, (name,))})


def needs(name: str, *others: str, why: str = "", any_of: bool = False, **values: Any) -> Rule:
    """The rule that an entry needs the others, or `any_of` them, and further ones of some values.

    name: one entry. why: ends the message.
    """
    wanted = [*([listed(others, "or" if any_of else "and")] if others else [])]
    wanted += [f"{key} = {in_words(value)}" for key, value in values.items()]

    def message(table):
        has = len(given(table, others))
        is_enough = has > 0 if any_of else has == len(others)
        fits = all(getattr(table, key) == value for key, value in values.items())
        if not given(table, (name,)) or is_enough and fits:
            return None
        return f"{name} needs {listed(wanted)}{why and f'; {why}'}"

    return Rule(message)


def together(*names: str, unless: str = "") -> Rule:
    """The rule that all entries are given: if any of them is, or `unless` another one is.

    unless: the name of the other one, also with an example, "position_m = [x, y, z]".
    """

    def message(table):
        has = given(table, names)
        is_free = given(table, (unless.split()[0],)) if unless else not has
        if is_free or len(has) == len(names):
            return None
        missing = next(name for name in names if name not in has)
        return f"{missing} is missing; give {listed(names)}{unless and f', or {unless}'}"

    return Rule(message)


def required(kind: Any) -> Any:
    """The type X of a field of type X, X | None or X | Literal[...]."""
    return get_args(kind)[0] if get_origin(kind) in (UnionType, Union) else kind


class Described:
    """Base of the dataclasses that are tables of a file, a dictionary or changes of them.

    A subclass is checked when it is made: numbers against their `Bounds`, words against Literal
    types, tuples of fixed lengths, and the rules.

    where: begins the messages. rules: those between its entries, beside those of its base.
    """

    _where, _rules = "", ()

    def __init_subclass__(cls, where: str = "", rules: tuple[Rule, ...] = (), **others):
        super().__init_subclass__(**others)
        cls._where, cls._rules = where or cls._where, (*cls._rules, *rules)

    def __post_init__(self):
        with errors_of(self._where) if self._where else nullcontext():
            check_fields(self)
            check_rules(self, self._rules)
            self.complete()

    def complete(self) -> None:
        """Derive what is not given; raises InputError where that is not possible."""

    def derive(self, **values: Any) -> None:
        """Set entries that follow from others, although the table is frozen, and check them."""
        for name, value in values.items():
            object.__setattr__(self, name, value)
        check_fields(self)

    @classmethod
    def replaced(cls, name: str) -> set[str]:
        """Names of the entries that an entry takes the place of."""
        return {other for each in cls._rules for other in each.replaced.get(name, ())}


def check_rules(table: Any, rules: tuple[Rule, ...]) -> None:
    """Raise InputError for the first rule that a table breaks."""
    for each in rules:
        if message := each.message(table):
            raise InputError(message)


def check_fields(table: Any) -> None:
    """Raise InputError if a dataclass has a number, a word or a length that its fields exclude.

    Fields that are None are not checked; of a tuple each number is.
    """
    for declared in fields(table):
        name, value, kind = declared.name, getattr(table, declared.name), required(declared.type)
        if value is None:
            continue
        values, kinds = value if isinstance(value, tuple) else (value,), get_args(kind)
        if get_origin(kind) is tuple:
            if ... not in kinds and len(values) != len(kinds):
                raise InputError(f"{name} = {list(values)}; give {len(kinds)} numbers")
            kind = kinds[0]
        if get_origin(kind) is Literal:
            check_known(name, get_args(kind), *values)
        if kind is dict:
            texts(name, value)
        is_word = isinstance(value, str) and {*get_args(declared.type)} - {int, float, NoneType}
        if "bounds" in declared.metadata and not is_word:
            for number in values:
                is_no_number = isinstance(number, (str, bool))  # for Python True is a number
                if isinstance(number, Real) and not is_no_number:  # no arrays, no complex numbers
                    declared.metadata["bounds"].check(number, name)
                if kind is int and not isinstance(number, Integral) or is_no_number:
                    whole = "whole " if kind is int else ""
                    raise InputError(f"{name} = {number!r}; must be a {whole}number")


def texts(where: str, table: Mapping[str, object]) -> dict[str, str]:
    """The texts, numbers and booleans of a table as texts, such as $-parameters of a scene.

    Raises InputError for other values. where: begins the message.
    """
    for key, value in table.items():
        if type(value) not in (str, int, float, bool):
            raise InputError(f"{where}: {key} = {value}; must be a text or a number")
    return {k: str(v).lower() if isinstance(v, bool) else str(v) for k, v in table.items()}


def fraction(value: float | str | None) -> float | None:
    """A fraction as a number.

    Parameters
    ----------
    value : float, str or None
        A number below 1, which is returned as it is, or a text between 0 and 1 such as "0.01" or
        "1%". None stays None.

    Raises
    ------
    InputError
        If a text is not such a fraction, or if a number is 1 or more, as 5 is where 5 % is meant.
    """
    if not isinstance(value, str):
        is_number = isinstance(value, Real) and not isinstance(value, bool)
        if value is not None and not (is_number and value < 1):
            raise InputError(f"{value} is not a fraction between 0 and 1, such as 0.01 or '1%'")
        return value
    number, percent, rest = value.partition("%")
    try:
        result = float(number) / (100 if percent else 1)
    except ValueError:
        result = 0.0
    if rest.strip() or not 0 < result < 1:
        raise InputError(f"'{value}' is not a fraction between 0 and 1, such as 0.01 or 1%")
    return result


def percent(value: float) -> str:
    """A fraction as text, in percent with two digits."""
    return f"{float(f'{100 * value:.2g}'):g} %"
