"""What each face of a file is: the labels in its names, a user's table of names, or one material
and temperature for all.
"""

import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mi_lcair.errors import InputError, check_known, errors_of, option, shown, unknown
from mi_lcair.models3d.modellers.obj import Obj
from mi_lcair.physics.labels import NONE, name_of
from mi_lcair.physics.materials import check_fit, is_json, is_number
from mi_lcair.table import NUMBER, read_table

# Facet labels `{f|s|t}*{material}*{kelvin}*{anything}`, which are names of objects or groups
# -------------------------------------------------------------------------------------------
# The fourth field may contain `group=NAME` (the emitter's group) and `elevation_deg=NUMBER` (for a
# sky facet whose spectrum comes from a sky table), separated by `*`. The modelling program may use
# the rest of it. Source: Harkiss 2007, Figure 3.3.

TYPES = {"f": "model", "s": "sky", "t": "terrain"}
GROUPS = {"f": "self", "s": "sky", "t": "terrain"}  # groups of labels without `group=`
# Limits of temperatures, exclusive and inclusive [K]. A smaller number is probably in Celsius.
LOWEST, HIGHEST = 60.0, 10000.0
ICE_POINT = 273.15  # 0 degrees Celsius [K]

# Names that other programs and the models of the thesis use. Case, '_', '-' and blanks are ignored.
ALIASES = {
    "bareal": "bare_aluminum",
    "barealuminium": "bare_aluminum",
    "glossblk": "gloss_black",
    "glossbl": "gloss_black",
    "irwall": "ir_range_wall",
    "bb": "blackbody",
    "perfectdiffuse": "diffuse",
    "perfectlydiffuse": "diffuse",
}


@dataclass(frozen=True)
class Label:
    """Content of a label.

    The material is a name, an emissivity, or the path of a fit's JSON file. The temperature is in
    kelvin, or None if a table gives it.
    """

    type: str
    material: str
    temperature: float | None
    group: str
    elevation_deg: float | None = None


def parse(
    text: str,
    materials,
    material: str | None = None,
    has_temperatures: bool = False,
    temperature: float | None = None,
    folder: Path = Path(),
) -> Label:
    """The Label of a text such as `f*bareAl*300*`.

    Parameters
    ----------
    text : str
    materials : iterable of str
        Names of the known materials.
    material : str or None
        Material for model facets (f), in place of the label's material.
    has_temperatures : bool
        A table gives the temperatures, and those of the labels are not read.
    temperature : float or None
        Temperature of model facets (f) [K], in place of the label's temperature.
    folder : Path
        Folder of the JSON files that labels name as materials.

    Raises
    ------
    InputError
        If the label is invalid. The message names the field.
    """
    fields = [field.strip() for field in text.split("*")]
    if len(fields) < 3:
        raise InputError(
            f"{len(fields)} field{'s' * (len(fields) > 1)} where 3 are needed; a label is "
            "{f|s|t}*{material}*{kelvin}*, such as f*bare_aluminum*300*"
        )
    kind = fields[0]
    if kind not in TYPES:
        raise InputError(f"facet type '{kind}' must be f (model), s (sky) or t (terrain)")
    if not (material and kind == "f"):
        material = find_material(fields[1], materials, folder)
    if has_temperatures:
        temperature = None
    elif temperature is None or kind != "f":
        temperature = kelvin(fields[2])
    words = dict(field.split("=", 1) for field in fields[3:] if "=" in field)
    return Label(kind, material, temperature, _group(words, kind), _elevation(words, kind))


def find_material(name: str, materials, folder: Path = Path()) -> str:
    """The known material that a label names, the path of the fit's JSON file that it names, or its
    number.

    Raises InputError with a list of the known materials, or for a file in `folder` that is no fit.
    """
    if name in materials:
        return name
    if is_number(name):
        return str(float(name))
    if is_json(name):
        check_fit(folder / name)
        return str(folder / name)
    meant = _plain_label(ALIASES.get(_plain_label(name), name))
    for known in materials:
        if _plain_label(known) == meant:
            return known
    raise unknown("material", name, materials)


def kelvin(text: str) -> float:
    """The temperature [K] in a text; raises InputError for other numbers and degrees Celsius."""
    text = re.sub(r"\s*K$", "", text)
    celsius = re.fullmatch(r"(.*?)\s*(?:°|deg)?\s*C", text)
    try:
        value = float(celsius[1] if celsius else text)
    except ValueError:
        raise InputError(
            f"temperature '{text}' is not a number; give kelvin, such as 300"
        ) from None
    if not math.isfinite(value):
        raise InputError(f"temperature '{text}' is not finite; give kelvin, such as 300")
    if celsius or -ICE_POINT < value <= LOWEST:
        raise InputError(
            f"temperature '{text}' looks like degrees Celsius; give kelvin: {value + ICE_POINT:g}"
        )
    if not LOWEST < value <= HIGHEST:
        raise InputError(
            f"temperature '{text}' is out of range; "
            f"give kelvin, more than {LOWEST:g} and at most {HIGHEST:g}"
        )
    return value


def _plain_label(name):
    return re.sub(r"[\s_-]", "", name).casefold()


def _group(words, kind):
    group = words.get("group", GROUPS[kind])
    if not re.fullmatch(r"[A-Za-z0-9_-]+", group):
        raise InputError(
            f"group '{group}' must consist of letters, digits, '_' and '-'; end it with '*' if the "
            "modelling program adds to names"
        )
    return group


def _elevation(words, kind):
    if "elevation_deg" not in words:
        return None
    text = words["elevation_deg"]
    if kind != "s":
        raise InputError(f"elevation_deg={text} belongs to sky facets (s) only")
    try:
        elevation = float(text)
    except ValueError:
        elevation = math.nan
    if not 0 <= elevation <= 90:
        raise InputError(
            f"elevation_deg '{text}' must be a number from 0 to 90; end it with '*' if the "
            "modelling program adds to names"
        )
    return elevation


# Columns of a table, beside the name
COLUMNS = ("type", "material", "emissivity", "kelvin", "group", "elevation_deg")
NUMBERS = {"emissivity", "kelvin", "elevation_deg"}
OF_FACES = "of faces"  # in place of a temperature, where each face has its own
MOST_FOUND = 8  # names of a file that an error lists
COPY = re.compile(r"(.*)\.[0-9]{3}", re.DOTALL)  # a name that Blender has numbered
NUMBER_AT_END = re.compile(r"(?:.*[*=])?\s*[0-9]+\.[0-9]{3}", re.DOTALL)


class NameTable:
    """A user's table of names: what the faces of an object, group or material are.

    A CSV file has the column `name` and any of COLUMNS. The type is f unless it is given. Blanks
    and underscores are the same in names, and so are a name and its numbered copies, such as Wing
    and Wing.001.

    Raises InputError, with the line, for a table that cannot be used.
    """

    def __init__(self, path: str | Path):
        self.path = Path(path)
        table = read_table(self.path, ("name",), "table of names")
        mark = "." if table.separator == "," else ","
        with errors_of(self.path):
            check_known("column", ("name", *COLUMNS), *table.columns)
        self.entries = {}  # plain name: (place in messages, name, values by column)
        for line, cells in table.rows:
            values = {key: cell for key, cell in zip(table.columns, cells) if cell}
            for key, cell in values.items():
                if key in NUMBERS or NUMBER.fullmatch(cell):  # a material may be an emissivity
                    values[key] = cell.replace(mark, ".")
            place, name = f"{self.path}, line {line}", values.pop("name", "")
            if _plain(name) in self.entries:
                raise InputError(f"{place}: name '{name}' is given twice")
            self.entries[_plain(name)] = place, name, values
        self.used = set()

    def find(self, names) -> tuple[str, dict[str, str]] | None:
        """Place and values of the entry for the first of some names that the table has."""
        for name in map(_plain, names):
            if name in self.entries:
                self.used.add(name)
                place, _, values = self.entries[name]
                return place, values
        return None

    def unused(self) -> list[str]:
        """The names in the table for which no face was found."""
        return [name for key, (_, name, _) in self.entries.items() if key not in self.used]


def label_of(place: str, values: dict[str, str], group: str, folder: Path, **options) -> Label:
    """The Label of values by COLUMNS, or by base and coating in place of a material.

    place: where they are given, for messages. group: that of a model facet without another. folder,
    options: as those of `parse`.
    """
    kind = values.get("type", "f")
    for key, value in values.items():
        if "*" in value:
            raise InputError(f"{place}: {key} {shown(value)} must have no '*'")
    if "emissivity" in values:
        if "material" in values:
            raise InputError(f"{place}: gives material and emissivity; give one of them")
        values = values | {"material": emissivity(values["emissivity"], place)}
    given = {
        "material": options["material"] and kind == "f",
        "kelvin": options["has_temperatures"] or (options["temperature"] and kind == "f"),
    }
    if "base" in values and not given["material"]:
        with errors_of(place):
            values = values | {"material": name_of(values["base"], values.get("coating", NONE))}
    for key in ("material", "kelvin"):
        if key not in values and not given[key]:
            also = option("material" if key == "material" else "temperature")
            lacking = key + " or emissivity" * (key == "material")
            raise InputError(f"{place}: lacks {lacking}; give it there, or {also} for all facets")
    if values.get("kelvin") == OF_FACES and not given["kelvin"]:
        options = options | {"has_temperatures": True}
    if group and kind == "f":
        values = {"group": group} | values
    text = "*".join(
        [kind, values.get("material", ""), values.get("kelvin", "")]
        + [f"{key}={values[key]}" for key in COLUMNS[4:] if key in values]
    )
    with errors_of(place):
        return parse(text, folder=folder, **options)


def emissivity(text: str, place: str) -> str:
    """The emissivity in a cell, as the material that it stands for.

    Raises InputError, with the place, unless it is a number from 0 to 1.
    """
    try:
        if is_number(text):
            return text
    except InputError:
        pass
    raise InputError(f"{place}: emissivity {shown(text)} must be a number from 0 to 1")


def labels_of(obj: Obj, table: NameTable | None, **options) -> tuple[list[Label], np.ndarray]:
    """The Labels of a file's faces, and the index (F,) of each face's label.

    The table's entry for a face's material, group or object goes before the label in the name of
    its group or object, and that before the label in the name of its material. A face with none of
    them is a model facet, if material and temperatures are given.

    Parameters
    ----------
    obj : Obj
    table : NameTable or None
    options
        materials, material, has_temperatures and temperature as those of `parse`.

    Raises
    ------
    InputError
        For a label or entry that is invalid, and for a face that has none.
    """
    texts = {text for _, _, text in obj.names} | {material for material, _, _ in obj.parts}
    pairs, label = np.unique(np.stack([obj.name, obj.part]), axis=1, return_inverse=True)
    label = label.ravel()
    labels = []
    for number, (name, part) in enumerate(pairs.T):
        own, group = ("", {}), ""
        if obj.given:
            *own, group = obj.given[part]
        if table and (entry := table.find(obj.parts[part])):
            labels.append(label_of(*entry, group, table.path.parent, **options))
        elif own[1]:
            labels.append(label_of(*own, group, obj.path.parent, **options))
        elif name >= 0 or "*" in obj.parts[part][0]:
            line, kind, text = obj.names[name] if name >= 0 else (0, "material", obj.parts[part][0])
            where = f"{obj.path}, line {line}" if line else obj.path
            with errors_of(f"{where}: {kind} '{text}'"):
                bare = without_number(text, texts)
                labels.append(parse(bare, folder=obj.path.parent, **options))
        elif options["material"] and (options["temperature"] or options["has_temperatures"]):
            kinds = "f", options["material"], options["temperature"], group or GROUPS["f"]
            labels.append(Label(*kinds))
        else:
            raise _no_label(obj, int(np.argmax(label == number)), table, options)
    return labels, label


def without_number(text: str, others) -> str:
    """A label without the number that Blender adds to a copy's name, such as .001.

    A label that ends in a number with three decimals, such as f*bare_aluminum*300.125, is changed
    only if the label without them is among the `others`.
    """
    copy = COPY.fullmatch(text)
    if not copy or (NUMBER_AT_END.fullmatch(text) and copy[1] not in others):
        return text
    return copy[1]


def _no_label(obj, face, table, options):
    """The error for a face that has no label."""
    missing = " and ".join(
        option(name)
        for name, given in (
            ("material", options["material"]),
            ("temperature", options["temperature"] or options["has_temperatures"]),
        )
        if not given
    )
    called = [
        f"{kind} '{name}'"
        for kind, name in zip(("material", "group", "object"), obj.parts[obj.part[face]])
        if name
    ]
    if table and called:
        neither = ("does not name its " if len(called) == 1 else "names neither its ") + (
            " nor its ".join(called)
        )
        reason, way = f"the table {table.path} {neither}", "add one of them to the table"
        if len(called) == 1:
            way = "add it to the table"
    else:
        reason, way = "the face has no label", f"give {option('names')} with a table of names"
        if names := _names_of(obj):
            way += f" (here {names})"
    return InputError(
        f"{obj.place(face)}: {reason}; name its object or group {{f|s|t}}*{{material}}*{{kelvin}}*,"
        f" such as f*bare_aluminum*300*, {way}, or give {missing}"
    )


def _names_of(obj):
    """The first names that a table of names could have, without the numbers of copies."""
    names = [_plain(next(filter(None, part), "")) for part in obj.parts]
    names = [name for name in dict.fromkeys(names) if name and "*" not in name]
    return ", ".join(names[:MOST_FOUND]) + ", ..." * (len(names) > MOST_FOUND)


def _plain(name):
    """A name without the number of a copy; blanks are underscores, as Blender exports them."""
    name = re.sub(r"\s+", "_", name.strip())
    copy = COPY.fullmatch(name)
    return copy[1] if copy else name
