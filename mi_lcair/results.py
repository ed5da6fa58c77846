"""What all results can do, their sections, and the units that names of columns end in."""

import json
from base64 import b64encode
from collections.abc import Iterable, Iterator
from dataclasses import MISSING, asdict, dataclass, field, fields, is_dataclass
from functools import partial
from inspect import signature
from operator import attrgetter
from os import PathLike
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Any, ClassVar, get_args, get_origin, get_type_hints

import numpy as np

from mi_lcair.drawing import PICTURES, notebook_png, write_figure
from mi_lcair.errors import InputError, check_known, printable
from mi_lcair.estimate import Contribution, Estimate, in_unit
from mi_lcair.extras import named, optional
from mi_lcair.files import check_suffix, check_writable, replacing
from mi_lcair.sections import (
    Drawing,
    Facts,
    LongTable,
    OwnPicture,
    Part,
    Picture,
    Remarks,
    Section,
    Table,
    first_rows,
    part_html,
    unpacked,
    words_of,
)

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure


# Results from the entries of their JSON: the inverse of `Result.as_dict`
# -----------------------------------------------------------------------

PLAIN = {float: (float, int), int: int, str: str, bool: bool}  # types of JSON for those of fields
NAMED = {float: "number", int: "whole number", str: "text", bool: "true or false"}  # in messages


def built(hint: Any, value: Any) -> Any:
    """An object of a type from what `strict` made of it.

    Parameters
    ----------
    hint : type
        Annotation of a field: a dataclass, a plain type, an array, a list, tuple, dict or optional
        of these. All items of a tuple have the type of the first one.
    value : object
        Numbers, texts, lists and dictionaries. A number that is None becomes NaN. Entries of a
        dictionary that are no fields of the dataclass are ignored.

    Raises
    ------
    KeyError, TypeError, ValueError
        If a field without a default is missing, or if a value has another type.
    """
    kind, inner = get_origin(hint), get_args(hint)
    if kind is UnionType:
        return None if value is None else built(inner[0], value)
    if is_dataclass(hint):
        hints = get_type_hints(hint)
        given = [
            entry
            for entry in fields(hint)
            if entry.name in value or entry.default is entry.default_factory is MISSING
        ]
        return hint(**{entry.name: built(hints[entry.name], value[entry.name]) for entry in given})
    if hasattr(hint, "_fields"):  # a NamedTuple
        hints = get_type_hints(hint)
        return hint(**{name: built(hints[name], value[name]) for name in hint._fields})
    if hint is np.ndarray:
        array = np.array(value)
        return array.astype(float) if array.dtype == object else array
    if kind in (list, tuple):
        return kind(built(inner[0], item) for item in value)
    if kind is dict:
        return {inner[0](key): built(inner[1], item) for key, item in value.items()}
    if hint is float and value is None:
        return np.nan
    if hint in PLAIN and not isinstance(value, PLAIN[hint]):
        raise ValueError(f"{value!r} in place of a {NAMED[hint]}")
    return value


def columns_of(lists: dict) -> dict[str, np.ndarray]:
    """Columns from the lists of JSON; null is NaN in a column of numbers."""
    columns = {}
    for name, values in lists.items():
        is_text = any(isinstance(value, str) for value in values)
        columns[name] = np.array(values, dtype=object if is_text else float)
    return columns


# What every result can do: say what it is, show itself, become a table, and be saved
# -----------------------------------------------------------------------------------

LONGEST = 199  # largest length of `repr` [characters]
# Writers of any result's table by suffix, and the method that gives what they write
WRITERS = {
    ".csv": ("mi_lcair.formats:write_csv", "columns"),
    ".nc": ("mi_lcair.formats:write_netcdf", "to_xarray"),
}
# Writers of further files of any result by suffix, as `saved_by` of a class
PAGE = {".html": "mi_lcair.api.pages:save_page"}


class Result:
    """Base class of the results of all functions.

    A result describes itself in one line (`summary`, `repr`) and shows its picture or its table in
    a notebook. Methods convert it to sections for the console and for pages (`sections`), to a
    dictionary (`as_dict`), a table (`columns`, `to_dataframe`, `to_xarray`), a figure (`plot`) or a
    file (`save`).

    A class is a dataclass whose fields are the result. It sets the names below, and defines
    `summary`, `columns`, `facts` for what the console prints, and `picture`.

    Attributes
    ----------
    kind : str
        Kind of the result, such as "signature". It is the entry `kind` of the JSON.
    heading : str
        Heading of its first section; by default the kind.
    computed : dict of str to str
        Further entries of the JSON: their keys, and the attributes or methods that give them, also
        those of fields, such as "scenario.name".
    drawn_by : str
        Function that draws its own picture, as "module:function", see `picture`.
    saved_by : dict of str to str
        Functions that write files of further suffixes, as "module:function": write(path, result,
        **options).
    """

    kind: ClassVar[str] = ""
    heading: ClassVar[str] = ""
    computed: ClassVar[dict[str, str]] = {}
    drawn_by: ClassVar[str] = ""
    saved_by: ClassVar[dict[str, str]] = {}

    def summary(self) -> str:
        """One line with the result's value, error and unit."""
        raise NotImplementedError

    def entries(self) -> dict[str, Any]:
        """Entries of `as_dict` after `kind`, of which arrays and NaN may be part.

        They are the fields, with the keys that `entry` states, and `computed`.
        """
        found = entries_of(self)
        more = {key: attrgetter(name)(self) for key, name in self.computed.items()}
        return found | {key: value() if callable(value) else value for key, value in more.items()}

    @classmethod
    def of_entries(cls, entries: dict[str, Any]) -> "Result":
        """The result with these entries of its JSON; `Recorded` if the class has `facts_of`.

        Raises KeyError, TypeError or ValueError if one is missing or has another type.
        """
        if hasattr(cls, "facts_of"):
            return Recorded(cls, entries)
        known = {name: entries[key] for key, name, _ in _keys(cls) if key in entries}
        return built(cls, known)

    def columns(self) -> dict[str, np.ndarray]:
        """The main table, `table`: equally long columns by name, which end in the unit, if any."""
        return self.table

    def facts(self) -> Iterator["tuple[str, Any] | Part | Section"]:
        """Yield what the console prints and a page shows of the result.

        Pairs (label, value) are facts; parts of a section may follow or precede them, and whole
        sections come last. Without Remarks among them those of the result follow.
        """
        yield summary_of(self)
        yield LongTable(self.columns())

    def picture(self, **options: Any) -> Picture | None:
        """What `plot` draws: one of the pictures of `mi_lcair.charts`, or its own."""
        if not self.drawn_by:
            return None
        draw = named(self.drawn_by)
        check_options(f"the picture of {self._named()}", draw, options)
        return OwnPicture(self.page_title(), partial(draw, self, **options))

    def __repr__(self) -> str:
        return printable(self.summary(), LONGEST)

    def _repr_html_(self) -> str:
        """The summary, and the picture or the table, for a notebook."""
        try:
            data = b64encode(notebook_png(self.plot())).decode()
            body = f'<img alt="{self.kind}" src="data:image/png;base64,{data}"/>'
        except InputError:  # without a picture, or with values that cannot be drawn
            body = first_rows(self.columns())
        return f"<div>{part_html(self.summary())}{body}</div>"

    def page_title(self) -> str:
        """What the result is, as the title of a page: the beginning of `summary`."""
        words = self.summary().partition(":")[0]
        return words[:1].upper() + words[1:]

    def sections(self, **options: Any) -> list[Section]:
        """What the console prints and a page shows of the result.

        A page shows its picture, unless one of the sections has a drawing.

        Parameters
        ----------
        **options
            Options of the function that makes them.

        Raises
        ------
        InputError
            If that function has no such option.
        """
        check_options(f"the page of {self._named()}", self.facts, options)
        sections = self._sections(list(self.facts(**options)))
        parts = [part for section in sections for part in section.parts]
        if self.has_picture and not any(isinstance(part, (Drawing, Picture)) for part in parts):
            sections[0].parts.append(self.picture())
        return sections

    def _sections(self, parts: list) -> list[Section]:
        """The sections of what `facts` yields."""
        first = []
        for part in parts:
            if isinstance(part, tuple):
                if not (first and isinstance(first[-1], Facts)):
                    first.append(Facts([]))
                first[-1].rows.append(part)
            elif not isinstance(part, Section):
                first.append(part)
        if not any(isinstance(part, Remarks) for part in first):
            first.append(Remarks(list(getattr(self, "remarks", ()))))
        title = self.heading or self.kind.replace("_", " ").capitalize()
        return [Section(title, first), *(part for part in parts if isinstance(part, Section))]

    def page(self, **options: Any) -> list[Section]:
        """The sections of a page: `sections`, and how the result was made as a detail."""
        sections = self.sections(**options)
        is_told = any(section.is_detail for section in sections)
        return sections if is_told else [*sections, details(self.entries())]

    def as_dict(self) -> dict[str, Any]:
        """The result for JSON: numbers, texts, lists and dictionaries, with units in the names.

        A number that does not exist (NaN, infinite) is None.
        """
        return strict({"kind": self.kind, **self.entries()})

    def as_rows(self) -> list[dict[str, Any]]:
        """The table of `columns` as a dictionary for each row."""
        columns = self.columns()
        return [dict(zip(columns, row)) for row in zip(*columns.values())]

    def to_dataframe(self) -> "pandas.DataFrame":
        """The table of `columns` as a pandas DataFrame.

        Raises InputError if pandas is not installed.
        """
        return optional("pandas", f"the data frame of {self._named()}").DataFrame(self.columns())

    def to_xarray(self) -> "xarray.Dataset":
        """The table of `columns` as an xarray Dataset, whose variables carry their units.

        Raises InputError if xarray is not installed.
        """
        return named("mi_lcair.formats:dataset")(self.columns(), **self.attributes())

    def attributes(self) -> dict:
        """Attributes of the Dataset."""
        return {"kind": self.kind, "title": printable(self.summary())}

    def dataset(self, variables: dict, coordinates: dict) -> "xarray.Dataset":
        """An xarray Dataset of {name: (dimensions, values)}, with units from the ends of the names.

        Raises InputError if xarray is not installed.
        """
        xarray = optional("xarray", f"the dataset of {self._named()}")
        described = named("mi_lcair.formats:described")
        return described(xarray.Dataset(variables, coordinates, self.attributes()))

    def plot(self, path: str | PathLike[str] | None = None, **options: Any) -> "Figure":
        """The picture of the result, as a Matplotlib Figure.

        Parameters
        ----------
        path : path-like, optional
            File to write it to: .png, .svg or .pdf.
        **options
            Options of the function that draws it.

        Raises
        ------
        InputError
            If the result has no picture, if it has no such option, or if the file cannot be
            written.
        """
        if not self.has_picture:
            raise InputError(
                f"{self._named()} has no picture; it can be saved as {', '.join(self.suffixes())}"
            )
        if path is not None:
            check_suffix(path, PICTURES, f"{self._named()}: output")
            check_writable(path)
        check_options(f"the picture of {self._named()}", self.picture, options)
        figure = self.picture(**options).draw()
        if path is not None:
            write_figure(figure, path)
        return figure

    def suffixes(self) -> list[str]:
        """Suffixes of the files that `save` can write."""
        of_result = WRITERS | PAGE | self.saved_by
        return [".json", *of_result, *(PICTURES if self.has_picture else ())]

    def save(self, path: str | PathLike[str], **options: Any) -> None:
        """Write the result to a file, whose suffix chooses the format (`suffixes`).

        Parameters
        ----------
        path : path-like
            File to write. It appears completely or not at all.
        **options
            Options of the function that draws or writes.

        Raises
        ------
        InputError
            If the result has no such format, if the format has no such option, or if the file
            cannot be written.
        """
        path = Path(path)
        suffix = check_suffix(path, self.suffixes(), f"{self._named()}: output")
        if suffix in PICTURES:
            self.plot(path, **options)
        elif suffix == ".json":
            check_options(f"{suffix} of {self._named()}", self.as_dict, options)
            with replacing(path) as partial:
                text = json.dumps(self.as_dict(), indent=2, allow_nan=False)
                partial.write_text(f"{text}\n", encoding="utf-8")
        else:
            check_writable(path)
            of_result = PAGE | self.saved_by
            writer, content = WRITERS.get(suffix, ("", ""))
            write = named(of_result.get(suffix, writer))
            check_options(f"{suffix} of {self._named()}", write, options)
            write(path, self if suffix in of_result else getattr(self, content)(), **options)

    @property
    def has_picture(self) -> bool:
        """Whether `plot` can draw the result."""
        return type(self).picture is not Result.picture or bool(self.drawn_by)

    def _named(self) -> str:
        """The result as messages name it."""
        return f"a result of kind '{self.kind}'"


@dataclass(frozen=True, repr=False)
class Recorded(Result):
    """A result as its JSON states it, which shows the same without what it was made from.

    Attributes
    ----------
    made_by : type
        Class of the result. Its methods facts_of(entries, **options) and picture_of(entries) give
        what it shows.
    given : dict
        Entries of its JSON.
    """

    made_by: type[Result]
    given: dict[str, Any]

    @property
    def kind(self) -> str:
        return self.made_by.kind

    @property
    def heading(self) -> str:
        return self.made_by.heading

    @property
    def has_picture(self) -> bool:
        return hasattr(self.made_by, "picture_of")

    def summary(self) -> str:
        """What the result is."""
        names = (self.given.get(name) for name in ("scene_name", "scenario_name", "name"))
        return f"{self.kind} of {next(filter(None, names), 'no name')}: as it was saved"

    def entries(self) -> dict[str, Any]:
        return self.given

    @property
    def remarks(self) -> list[str]:
        return self.given.get("remarks", [])

    def facts(self, **options: Any) -> Iterator["tuple[str, Any] | Part | Section"]:
        check_options(f"the page of {self._named()}", self.made_by.facts_of, options)
        return self.made_by.facts_of(self.given, **options)

    def picture(self) -> Picture:
        return self.made_by.picture_of(self.given)


def check_options(what: str, function, options: dict) -> None:
    """Raise InputError for an option that the function of a picture or format does not take.

    Options that a function passes on are those of the TypedDict that it unpacks. A function that
    passes any options on checks them itself.
    """
    known = []
    for parameter in signature(function).parameters.values():
        if parameter.kind is parameter.VAR_KEYWORD:
            if parameter.annotation in (parameter.empty, Any):
                return
            (options_type,) = get_args(parameter.annotation)
            known += options_type.__annotations__
        elif parameter.default is not parameter.empty:
            known.append(parameter.name)
    check_known(f"option of {what}", known, *options)


def entry(key: str | None = None, of: str = "", **options: Any) -> Any:
    """A field of a result whose entry of the JSON has another key; without one it has no entry.

    of: attribute of the field's value that is the entry, such as "label" for a band. options: those
    of `dataclasses.field`.
    """
    return field(metadata={"entry": (key, of)}, **options)


def _keys(cls) -> list[tuple[str, str, str]]:
    """Key of the JSON, name, and attribute of the value for each field that has an entry."""
    stated = [(one.name, one.metadata.get("entry", (one.name, ""))) for one in fields(cls)]
    return [(key, name, of) for name, (key, of) in stated if key]


def entries_of(value: Any) -> dict[str, Any]:
    """The fields of a dataclass that have an entry of the JSON, by the keys that `entry` states."""
    pairs = [(key, getattr(value, name), of) for key, name, of in _keys(type(value))]
    return {key: getattr(part, of) if of else part for key, part, of in pairs}


def strict(value):
    """A value as strict JSON has it: arrays as lists, NumPy's numbers as Python's, NaN as None.

    A dataclass becomes the dictionary of its `entries_of`, or that of its method `as_dict`, and a
    NamedTuple that of its fields.
    """
    if hasattr(value, "as_dict"):
        value = value.as_dict()
    if isinstance(value, Estimate):
        value = value.as_dict()
    if is_dataclass(value):
        value = entries_of(value)
    if hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, dict):
        return {str(key): strict(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [strict(entry) for entry in value]
    if isinstance(value, np.ndarray):
        return strict(value.tolist())
    if isinstance(value, np.generic):
        return strict(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value


def summary_of(result: Result) -> Facts:
    """The summary of a result as a fact."""
    head, _, words = result.summary().rpartition(": ")
    return Facts([(head or result.kind.replace("_", " "), words)])


def extremes(columns: dict[str, np.ndarray]) -> Facts:
    """The least and the greatest value of each quantity. Not of errors and of `reached`."""
    return Facts(
        [
            (name, f"{np.nanmin(values):.5g} to {np.nanmax(values):.5g}")
            for name, values in columns.items()
            if values.dtype.kind in "iuf"
            and name != "reached"
            and not ("_standard_error" in name or "_half_width" in name or np.isnan(values).all())
        ]
    )


def details(entries: dict, title: str = "How it was made") -> Section:
    """The numbers and texts of a result's dictionary, without durations, as a detail of a page."""
    rows = [
        (words_of(name), unpacked(value))
        for name, value in entries.items()
        if not isinstance(value, (dict, list, tuple, np.ndarray))
        and name != "kind"
        and not name.endswith("time_s")
    ]
    return Section(title, [Facts(rows)], is_detail=True)


def settings_section(title: str, settings: Any, first: Iterable[tuple[str, Any]] = ()) -> Section:
    """The entries of tables that are given, below the rows `first`. settings: a dataclass."""
    rows = list(first)
    for table, entries in asdict(settings).items():
        if isinstance(entries, dict):
            given = [f"{key} = {x}" for key, x in entries.items() if x not in (None, {}, [], ())]
            rows += [(f"[{table}]", ", ".join(given))] if given else []
    return Section(title, [Facts(rows)])


__all__ = ["Result", "entry"]


# What contributes to the error of an estimate, as a table that all results share
# -------------------------------------------------------------------------------


def contributions(estimate: Estimate) -> Table:
    """What contributes to the error of a single value. A group is followed by its members."""
    head = ["quantity", "value", "sigma", "sensitivity"]
    head += [in_unit("contribution", estimate.unit), "share"]
    rows = [_cells(entry) for row in estimate.contributions for entry in (row, *row.members)]
    return Table(head, rows)


def _cells(row: Contribution) -> list[str]:
    """Cells of what contributes to an estimate. A member of a group has no share."""
    slope = _number(row.sensitivity)
    if row.sensitivity_error is not None and row.sensitivity_error >= 1e-3 * abs(row.sensitivity):
        slope += f" +- {row.sensitivity_error:.1g}"
    quantity = row.quantity if row.share is not None else f"  {row.quantity}"
    return [
        quantity + (f" ({row.distribution})" if row.distribution else ""),
        _number(row.value) and in_unit(_number(row.value), row.unit),
        _number(row.sigma, 3),
        slope,
        f"{row.contribution:.4g}" if row.sensitivity is None else f"{row.contribution:+.4g}",
        "" if row.share is None else f"{100 * row.share:.2f} %",
    ]


def _number(value: float | None, digits: int = 5) -> str:
    """A number as text; empty without one."""
    return "" if value is None else f"{value:.{digits}g}"
