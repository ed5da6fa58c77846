"""Kinds of files and names that `show` and `convert` take."""

import json
from pathlib import Path

from mi_lcair.errors import InputError
from mi_lcair.files import read_text
from mi_lcair.formats import MODELS

# Kinds, as messages name them
IMAGE, TREND, SPECTRUM = "an image", "a trend", "a spectrum"
FACET, FACETS, MODEL, SCENE = "--facet", "--facets", "a model", "a scene"
SCENARIO, MATERIAL = "a scenario", "a material"
TAKEN = (
    "image (.exr), no trend or spectrum (.csv, .nc), no model (.obj, .glb, .gltf, .ply, .stl or "
    "the folder of an import), no scene (.xml), no scenario (.toml) and no material"
)


def kind_of(what: str, facet=None, facets=None, materials=None) -> str:
    """The kind of `what`, one of the names above; `facet`, `facets`: the options of `show`.

    Raises InputError for anything else.
    """
    from mi_lcair import scenes
    from mi_lcair.physics.materials import names

    if facet is not None:
        return FACET
    if facets is not None:
        return FACETS
    path = Path(what)
    suffix = path.suffix.lower()
    if suffix == ".exr":
        return IMAGE
    if suffix in (".csv", ".nc"):
        return kind_of_table(path)
    if suffix in MODELS:
        return MODEL
    if suffix == ".xml" or what in scenes.names() or scenes.in_folder(path):
        return SCENE
    if suffix == ".toml" or what in scenes.scenarios():
        return SCENARIO
    if suffix == ".json":
        check_material(path)
    if suffix == ".json" or what in names(materials):
        return MATERIAL
    raise InputError(
        f"'{what}' is no {TAKEN}; scenes are {', '.join(scenes.names())}, "
        f"materials {', '.join(names(materials))}"
    )


def check_material(path: Path) -> None:
    """Raise InputError for the JSON of a result that is no fit; reading finds other errors."""
    try:
        kind = json.loads(read_text(path)).get("kind", "fit")
    except (InputError, ValueError, AttributeError, RecursionError):
        return
    if kind != "fit":
        raise InputError(
            f"'{path}' is the JSON of a result of kind '{kind}'; show draws that of a fit, and "
            "report shows those of a signature and a fit"
        )


def kind_of_table(path: Path) -> str:
    """TREND or SPECTRUM, by the columns of a CSV or netCDF file.

    Raises InputError for another table.
    """

    from mi_lcair.formats import tables

    kind = tables.kind_of(path, tables.read_columns(path))
    if kind == tables.FACETS:
        raise InputError(
            f"'{path}' is a table of facets; name its scene: mi-lcair show SCENE --facets {path} "
            "-c COLUMN"
        )
    return {tables.TREND: TREND, tables.SPECTRUM: SPECTRUM}[kind]
