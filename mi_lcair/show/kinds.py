"""What a file or a name is, by its suffix, its content, or what is bundled."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

from mi_lcair import scenes
from mi_lcair.errors import InputError, complete
from mi_lcair.extras import named
from mi_lcair.files import FACET_FILES, parse_json, read_text
from mi_lcair.formats import read_columns
from mi_lcair.results import Result

# Names of kinds, as messages have them
IMAGE, SIGNATURE, FIT, MODEL = "an image", "a signature", "a fit", "a model"
SCENE, SCENARIO, MATERIAL = "a scene", "a scenario", "a material"
BLACKBODIES, AIR, SKY = "blackbodies", "an atmosphere", "a sky"
SOLUTION, BUDGET, AUDIT, CONTRAST = "a solution", "a budget", "an audit", "a contrast"
CHART, CALIBRATION = "a chart", "a calibration"
ANOTHER = "a result of another kind"  # a JSON whose entries a page shows as they are
TREND, SPECTRUM, FACETS = "a trend", "a spectrum", "a table of facets"
RESULTS = "a table of results"  # that of a sweep or a flight
TEMPERATURES = re.compile(r"\d+(\.\d+)?K(,\d+(\.\d+)?K)*")  # such as 260K,300K
INTERVALS = "_half_width"  # in the names of columns of RESULTS
SCALE = ("log", "vmin", "vmax", "cmap", "common_scale", "outlines")  # options of images
OF_MATERIAL = ("band", "theta_deg", "materials")


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of file or name, and what the commands do with it.

    suffixes: of its files. json: entry `kind` of its JSON. made_by: class whose `of_entries` reads
    that. columns: those by which its tables are known. page: function of
    `mi_lcair/show/page/reading.py`. drawn, options: function of
    `mi_lcair/cli/pictures.py`, and its options beside the output. hint: what `show` says in
    place of a picture. converted, to, settings: function of `mi_lcair/cli/files.py`, the
    suffixes that it writes, and its options.
    """

    suffixes: tuple[str, ...] = ()
    json: str = ""
    made_by: str = ""
    columns: tuple[str, ...] = ()
    page: str = ""
    drawn: str = ""
    options: tuple[str, ...] = ()
    hint: str = "report shows it"
    converted: str = ""
    to: tuple[str, ...] = ()
    settings: tuple[str, ...] = ()


TABLE = {"page": "result", "converted": "result", "to": (".csv", ".nc")}
KINDS = {
    IMAGE: Kind(
        suffixes=(".exr",), page="image", drawn="image", converted="image", to=(".tif", ".tiff"),
        options=("channels", *SCALE, "scene", "parameters", "sensor"), settings=("channel",),
    ),
    SIGNATURE: Kind(json="signature", page="signature",
        made_by="mi_lcair.signatures.signature:Signature",
        converted="facets_of_signature", to=FACET_FILES, settings=("scene", "parameters")),
    FIT: Kind(json="fit", page="fit", drawn="brdf", options=OF_MATERIAL,
        converted="fit", to=(".csv", ".json", ".xomp")),
    SOLUTION: Kind(json="mi_lcair solution", drawn="result",
        made_by="mi_lcair.knowing.inversion.solution:Solution", **TABLE),
    CALIBRATION: Kind(json="calibration", drawn="result",
        made_by="mi_lcair.knowing.twin.calibration:HeatCalibration", **TABLE),
    BUDGET: Kind(json="budget", drawn="result",
        made_by="mi_lcair.knowing.budgets.budget:Budget", **TABLE),
    AUDIT: Kind(json="audit", made_by="mi_lcair.laboratory.audit:Audit", **TABLE),
    CONTRAST: Kind(json="contrast", page="result", drawn="result",
        made_by="mi_lcair.detection.contrast:Contrast"),
    CHART: Kind(json="chart", drawn="result",
        made_by="mi_lcair.signatures.cost_chart:CostChart", **TABLE),
    TREND: Kind(columns=("azimuth_deg", "elevation_deg", "intensity_W_sr"),
        page="trend", drawn="trend"),
    SPECTRUM: Kind(columns=("wavelength_um", "target_W_sr_um"), page="spectrum", drawn="spectrum"),
    FACETS: Kind(columns=("facet",), page="facets",
        hint="name its scene, in the shell: mi-lcair show SCENE --facets {} -c COLUMN"),
    RESULTS: Kind(page="results"),
    ANOTHER: Kind(page="entries"),
    MODEL: Kind(suffixes=scenes.MODELS, page="facet_model", drawn="model", options=("materials",),
        converted="model", to=FACET_FILES),
    SCENE: Kind(suffixes=(".xml",), drawn="scene", options=("parameters",),
        converted="scene", to=FACET_FILES, settings=("parameters",)),
    SCENARIO: Kind(suffixes=(".toml",), drawn="scenario", options=("parameters",)),
    MATERIAL: Kind(suffixes=(".xomp",), drawn="brdf", options=OF_MATERIAL),
    **dict.fromkeys((BLACKBODIES, AIR, SKY), Kind(drawn="curves", options=("band",))),
}  # fmt: skip
BY_RESULT = {kind.json: name for name, kind in KINDS.items() if kind.json}


def kind_of(what: str | Path, materials: str | Path | None = None) -> str:
    """The kind of a file or name, one of the names above.

    materials: file of the user's materials, whose names count too. Raises InputError for anything
    else.
    """
    from mi_lcair.physics.atmosphere import atmosphere_names
    from mi_lcair.physics.materials import is_number, names
    from mi_lcair.physics.sky import sky_names

    what, suffix = str(what), Path(what).suffix.lower()
    for name, kind in KINDS.items():
        if suffix in kind.suffixes:
            return name
    if suffix in (".csv", ".nc"):
        return kind_of_table(what, read_columns(what))
    if suffix == ".json":
        return BY_RESULT.get(read_json(what)["kind"], ANOTHER)
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


def kind_of_table(path: str | Path, names: Iterable[str]) -> str:
    """TREND, SPECTRUM, FACETS or RESULTS, by the names of a table's columns.

    Raises InputError for another table; `path` is that of its file in the message.
    """
    if any(INTERVALS in name for name in names):
        return RESULTS
    known = {name: kind.columns for name, kind in KINDS.items() if kind.columns}
    for name, needed in known.items():
        if set(needed) <= set(names):
            return name
    trend, spectrum, facets = (", ".join(needed) for needed in known.values())
    raise InputError(
        f"'{path}': neither a trend ({trend}), nor a spectrum ({spectrum}), nor facets ({facets}), "
        f"nor the table of a sweep or a flight (with columns *{INTERVALS}*)"
    )


def read_json(path: str | Path) -> dict:
    """The entries of a result's JSON. Without `kind` it is that of a fit.

    Raises InputError for another file.
    """
    entries = parse_json(read_text(path), f"'{path}': not JSON")
    if not isinstance(entries, dict) or not {"kind", "parameters", "materials"} & set(entries):
        raise InputError(f"'{path}': not the JSON of a result")
    if not isinstance(entries.setdefault("kind", "fit"), str):
        raise InputError(f"'{path}': not the JSON of a result; its kind is no text")
    return entries


def read_result(path: str | Path) -> Result:
    """The result in a JSON file; raises InputError for an incomplete file."""
    entries = read_json(path)
    if entries["kind"] not in BY_RESULT:
        raise InputError(
            f"'{path}' is the JSON of a result of kind '{entries['kind']}'; those that are read "
            f"are {', '.join(BY_RESULT.values())}"
        )
    with whole(path):
        return named(KINDS[BY_RESULT[entries["kind"]]].made_by).of_entries(entries)


def whole(path: str | Path):
    """Context manager: what the JSON of a result lacks is an InputError."""
    return complete(f"'{path}': {BY_RESULT.get(read_json(path)['kind'], ANOTHER)} that")
