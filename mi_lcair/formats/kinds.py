"""What a file or a name is, by its suffix, its content, or what is bundled."""

from pathlib import Path

from mi_lcair import scenes
from mi_lcair.errors import InputError
from mi_lcair.files import parse_json, read_text
from mi_lcair.formats import MODELS, check_model, tables
from mi_lcair.formats.tables import FACETS, SPECTRUM, TREND

# Kinds beside those of tables, as messages name them
IMAGE, SIGNATURE, FIT, MODEL = "an image", "a signature", "a fit", "a model"
SCENE, SCENARIO, MATERIAL = "a scene", "a scenario", "a material"
BY_SUFFIX = {".exr": IMAGE, ".xml": SCENE, ".toml": SCENARIO, **dict.fromkeys(MODELS, MODEL)}
BY_RESULT = {"signature": SIGNATURE, "fit": FIT}  # by the entry `kind` of a result's JSON

__all__ = [
    "FACETS", "FIT", "IMAGE", "MATERIAL", "MODEL", "SCENARIO", "SCENE", "SIGNATURE", "SPECTRUM",
    "TREND", "kind_of", "read_json",
]  # fmt: skip


def kind_of(what: str | Path, materials: str | Path | None = None) -> str:
    """The kind of a file or name, one of the names above.

    materials: file of the user's materials, whose names count too. Raises InputError for anything
    else.
    """
    from mi_lcair.physics.materials import is_number, names

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
    if is_number(what) or what in names(materials):
        return MATERIAL
    check_model(what)
    raise InputError(
        f"'{what}' is no image (.exr), no trend, spectrum or facets (.csv, .nc), no result "
        f"(.json), no model ({', '.join(MODELS)} or the folder of an import), no scene (.xml), no "
        f"scenario (.toml) and no material; scenes are {', '.join(scenes.names())}, materials "
        f"{', '.join(names(materials))}"
    )


def read_json(path: str | Path) -> dict:
    """The entries of the JSON of a signature or of a fit. Without `kind` it is that of a fit.

    Raises InputError for another file.
    """
    entries = parse_json(read_text(path), f"'{path}': not JSON")
    if not isinstance(entries, dict):
        raise InputError(f"'{path}': neither a signature's JSON nor a fit's")
    entries = {"kind": "fit"} | entries
    if str(entries["kind"]) not in BY_RESULT:
        raise InputError(
            f"'{path}' is the JSON of a result of kind '{entries['kind']}'; show draws that of a "
            "fit, and report shows those of a signature and a fit"
        )
    return entries
