"""What a file or a name is, by its suffix, its content, or what is bundled."""

import re
from difflib import get_close_matches
from pathlib import Path

from mi_lcair import scenes
from mi_lcair.errors import InputError
from mi_lcair.extras import named
from mi_lcair.files import parse_json, read_text
from mi_lcair.formats import tables
from mi_lcair.formats.tables import FACETS, RESULTS, SPECTRUM, TREND
from mi_lcair.results import Result

# Kinds beside those of tables, as messages name them
IMAGE, SIGNATURE, FIT, MODEL = "an image", "a signature", "a fit", "a model"
SCENE, SCENARIO, MATERIAL = "a scene", "a scenario", "a material"
BLACKBODIES, AIR, SKY = "blackbodies", "an atmosphere", "a sky"
SOLUTION, BUDGET, AUDIT, CONTRAST = "a solution", "a budget", "an audit", "a contrast"
BY_SUFFIX = {".exr": IMAGE, ".xml": SCENE, ".toml": SCENARIO, **dict.fromkeys(scenes.MODELS, MODEL)}
TEMPERATURES = re.compile(r"\d+(\.\d+)?K(,\d+(\.\d+)?K)*")  # such as 260K,300K
# By the entry `kind` of a result's JSON
BY_RESULT = {
    "signature": SIGNATURE,
    "fit": FIT,
    "mi_lcair solution": SOLUTION,
    "budget": BUDGET,
    "audit": AUDIT,
    "contrast": CONTRAST,
}
# Classes whose JSON holds all that they show; their method `of_entries` reads it
CLASSES = {
    SOLUTION: "mi_lcair.inversion.solution:Solution",
    BUDGET: "mi_lcair.uncertainty.budget:Budget",
    AUDIT: "mi_lcair.energy.audit_result:Audit",
}

__all__ = [
    "AIR", "AUDIT", "BLACKBODIES", "BUDGET", "CONTRAST", "FACETS", "FIT", "IMAGE", "MATERIAL",
    "MODEL", "RESULTS", "SCENARIO", "SCENE", "SIGNATURE", "SKY", "SOLUTION", "SPECTRUM", "TREND",
    "kind_of", "read_json", "read_result",
]  # fmt: skip


def kind_of(what: str | Path, materials: str | Path | None = None) -> str:
    """The kind of a file or name, one of the names above.

    materials: file of the user's materials, whose names count too. Raises InputError for anything
    else.
    """
    from mi_lcair.physics.atmosphere import atmosphere_names
    from mi_lcair.physics.materials import is_number, names
    from mi_lcair.physics.sky import sky_names

    what, suffix = str(what), Path(what).suffix.lower()
    if suffix in BY_SUFFIX:
        return BY_SUFFIX[suffix]
    if suffix in (".csv", ".nc"):
        return tables.kind_of(what, tables.read_columns(what))
    if suffix == ".json":
        return BY_RESULT[read_json(what)["kind"]]
    if what in scenes.names() or scenes.in_folder(what):
        return SCENE
    if what in scenes.scenarios():
        return SCENARIO
    if TEMPERATURES.fullmatch(what):
        return BLACKBODIES
    if what in sky_names():
        return SKY
    if what in atmosphere_names():
        return AIR
    if is_number(what) or what in names(materials):
        return MATERIAL
    scenes.check_model(what)
    bundled = [*scenes.names(), *names(materials), *sky_names(), *atmosphere_names()]
    hint = f"; the nearest are {', '.join(get_close_matches(what, bundled, 3, 0.0))}"
    if suffix:
        hint = "; TIFFs are for other programs, such as ImageJ" if suffix.startswith(".tif") else ""
    raise InputError(
        f"'{what}' is no image (.exr), no trend, spectrum or facets (.csv, .nc), no result "
        f"(.json), no model ({', '.join(scenes.MODELS)} or the folder of an import), no scene "
        "(.xml), no scenario (.toml), no temperatures (260K,300K), and no name of a scene, "
        f"material, air or sky{hint}"
    )


def read_json(path: str | Path) -> dict:
    """The entries of a result's JSON, one of BY_RESULT. Without `kind` it is that of a fit.

    Raises InputError for another file.
    """
    entries = parse_json(read_text(path), f"'{path}': not JSON")
    if not isinstance(entries, dict) or not {"kind", "parameters", "materials"} & set(entries):
        raise InputError(f"'{path}': not the JSON of a result")
    entries = {"kind": "fit"} | entries
    if str(entries["kind"]) not in BY_RESULT:
        raise InputError(
            f"'{path}' is the JSON of a result of kind '{entries['kind']}'; those that are read "
            f"are {', '.join(BY_RESULT.values())}"
        )
    return entries


def read_result(path: str | Path) -> Result:
    """The result in a JSON file of one of CLASSES; raises InputError for an incomplete file."""
    entries = read_json(path)
    kind = BY_RESULT[entries["kind"]]
    try:
        return named(CLASSES[kind]).of_entries(entries)
    except (KeyError, IndexError, TypeError, AttributeError, ValueError) as error:
        raise incomplete(path, kind, error) from None


def incomplete(path: str | Path, kind: str, error: Exception) -> InputError:
    """The error for the JSON of a result that lacks entries."""
    return InputError(
        f"'{path}': {kind} that is incomplete ({type(error).__name__}: {error}); make it anew"
    )
