"""Kinds of files and names that `show` and `convert` take, and the reading of tables."""

import json
from pathlib import Path

from mi_lcair.errors import InputError
from mi_lcair.files import read_text

# Kinds, as messages name them
IMAGE, TREND, SPECTRUM = "an image", "a trend", "a spectrum"
FACET, FACETS, MODEL, SCENE = "--facet", "--facets", "a model", "a scene"
SCENARIO, MATERIAL = "a scenario", "a material"
MODELS = (".obj", ".ply", ".stl", ".glb", ".gltf")
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
    if suffix == ".xml" or what in scenes.names() or scenes.scene_in(path):
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
    """TREND, SPECTRUM or FACETS, by the names of the columns of a CSV or netCDF file.

    Raises InputError for another table.
    """
    names = columns_of(path)
    if {"azimuth_deg", "elevation_deg", "intensity_W_sr"} <= set(names):
        return TREND
    if {"wavelength_um", "target_W_sr_um", "scene_W_sr_um"} <= set(names):
        return SPECTRUM
    if "facet" in names:
        raise InputError(
            f"'{path}' is a table of facets; name its scene: mi-lcair show SCENE --facets {path} "
            "-c COLUMN"
        )
    raise InputError(
        f"'{path}' is no table of a trend (azimuth_deg, elevation_deg, intensity_W_sr) and no "
        "spectrum of a signature (wavelength_um, target_W_sr_um, scene_W_sr_um)"
    )


def columns_of(path: Path) -> list[str]:
    """Names of the columns of a CSV file, or of the variables of a netCDF file."""
    if path.suffix.lower() == ".nc":
        return list(read_columns(path))
    from mi_lcair.table import column_names

    lines = read_text(path).splitlines()
    first = next((n for n, line in enumerate(lines) if line.strip() and line[0] != "#"), None)
    if first is None:
        raise InputError(f"{path}: holds no table")
    return column_names(str(path), first + 1, lines[first], ("azimuth_deg", "intensity_W_sr"))[0]


def read_columns(path: Path) -> dict:
    """Columns of a CSV or netCDF file by name; a column of texts in a CSV is left out.

    Raises InputError for a file that cannot be read.
    """
    if path.suffix.lower() == ".nc":
        from mi_lcair.formats import netcdf

        return netcdf.read_columns(path)
    import numpy as np

    from mi_lcair.table import read_table

    table = read_table(path, ())
    found = {}
    for name in table.columns:
        try:
            found[name] = table.numbers([name], may_lack=True)[name]
        except InputError:
            place = table.columns.index(name)
            found[name] = np.array([cells[place] for _, cells in table.rows])
    return found
