"""Facet labels `{f|s|t}*{material}*{kelvin}*{anything}`, which are names of objects or groups.

The fourth field may contain `group=NAME` (the emitter's group) and `elevation_deg=NUMBER` (for a
sky facet whose spectrum comes from a sky table), separated by `*`. The modelling program may use
the rest of it. Source: Harkiss 2007, Figure 3.3.
"""

import math
import re
from dataclasses import dataclass
from pathlib import Path

from mi_lcair.errors import InputError, unknown
from mi_lcair.physics.materials import check_fit, is_json, is_number

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


def unlabelled(material: str, temperature: float | None = None) -> Label:
    """The Label of a model facet that has none."""
    return Label("f", material, temperature, GROUPS["f"])


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
    meant = _plain(ALIASES.get(_plain(name), name))
    for known in materials:
        if _plain(known) == meant:
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


def _plain(name):
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
