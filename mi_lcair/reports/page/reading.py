"""What a file or name is, and what a page shows of it."""

from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from mi_lcair import scenes
from mi_lcair.errors import InputError
from mi_lcair.files import parse_json, read_bytes, read_text
from mi_lcair.formats import tables
from mi_lcair.reports.page.page import Section
from mi_lcair.reports.page.sections import (
    facets_section,
    image_sections,
    intensity_section,
    known_band,
    spectrum_section,
    toward_sensor,
    trend_sections,
)
from mi_lcair.reports.page.tables import facts, heading, table, unpacked, words_of
from mi_lcair.signatures.trend_file import beside
from mi_lcair.signatures.trend_result import Trend
from mi_lcair.table import lines_of

TAKEN = (
    "report takes a radiance image (.exr), a signature's or a fit's .json, the .csv of a trend, of "
    "facets or of a spectrum, a scene (.xml, bundled name or the folder of an import) and a "
    "scenario (.toml or bundled name)"
)


@dataclass
class Request:
    """How the things on a page are made.

    Attributes
    ----------
    scene : Scene, mi.Scene, str, Path or None
        Scene whose model a facets table or a signature's JSON is shown on.
    parameters : dict of str to str
        $-parameters of scenes, or changes of a scenario's entries.
    sampling : dict
        spp, tolerance, max_spp, seed and sensor of renders, those that were given.
    plan : str or None
        "auto": plan the render of a scene.
    progress : callable or None
        Called with (samples per pixel done, expected).
    notes : list of str
        Remarks that reading has left.
    """

    scene: object = None
    parameters: dict = field(default_factory=dict)
    sampling: dict = field(default_factory=dict)
    plan: str | None = None
    progress: object = None
    notes: list = field(default_factory=list)


def kind_of(what: str) -> str:
    """Kind of a WHAT: image, json, csv, scenario or scene. Raises InputError for another one."""
    suffix = Path(what).suffix.lower()
    by_suffix = {
        ".exr": "image",
        ".json": "json",
        ".csv": "csv",
        ".toml": "scenario",
        ".xml": "scene",
    }
    if suffix in by_suffix:
        return by_suffix[suffix]
    if what in scenes.names() or scenes.in_folder(what):
        return "scene"
    if what in scenes.scenarios():
        return "scenario"
    names = ", ".join([*scenes.names(), *scenes.scenarios()])
    raise InputError(f"'{what}' is none of what a page shows: {TAKEN}; bundled: {names}")


def read(what: str, request: Request) -> tuple[str, list[Section]]:
    """Title and sections of a WHAT; scenes and scenarios are rendered.

    Raises InputError if it cannot be used.
    """
    return READERS[kind_of(what)](what, request)


def image(what: str, request: Request):
    """A radiance image, or what another program's EXR holds."""
    from mi_lcair.rendering.image import read_exr

    channels, header = read_exr(what)
    if not channels:
        raise InputError(f"'{what}': holds no channels; there is nothing to show")
    shapes = {pixels.shape for pixels in channels.values()}
    if len(shapes) > 1 or any(len(shape) != 2 for shape in shapes):
        raise InputError(
            f"'{what}': its channels differ in size; report shows channels of one size"
        )
    *sections, made = image_sections(channels, header)
    made.parts.insert(0, facts(of_file(what)))
    scene = header.get("scene")
    return f"{scene} ({Path(what).name})" if scene else Path(what).name, [*sections, made]


def json_file(what: str, request: Request):
    """A signature's or a fit's JSON."""
    text = read_text(what)
    entries = parse_json(text, f"'{what}': not JSON")
    kind = entries.get("kind") if isinstance(entries, dict) else None
    readers = {"signature": signature, "fit": fit}
    if kind not in readers:
        raise InputError(
            f"'{what}': neither a signature's JSON (`signature --json`) nor a fit's (`fit -o`); "
            f"{TAKEN}"
        )
    try:
        return readers[kind](what, entries, request)
    except (KeyError, IndexError, TypeError, AttributeError) as error:
        raise InputError(
            f"'{what}': an incomplete {kind} ({type(error).__name__}: {error}); make it anew"
        ) from None


def signature(what: str, entries: dict, request: Request):
    """A signature's JSON: tables, spectrum and facets, on the model of `request.scene`."""
    sections = [intensity_section(entries)]
    if "spectrum" in entries:
        sections.append(spectrum_section(columns_of(entries["spectrum"])))
    if "facets" in entries:
        sections.append(
            facets_on_model(what, columns_of(entries["facets"]), request, entries["band"])
        )
    if entries.get("effective_areas"):
        areas = entries["effective_areas"]
        heads = [heading(name) for name in areas[0]]
        rows = [list(row.values()) for row in areas]
        sections.append(Section("Effective areas", [table(heads, rows)]))
    made = [
        (words_of(key), value)
        for key, value in entries.items()
        if not isinstance(value, (dict, list)) and key not in ("kind", "time_s")
    ]
    sections.append(Section("How it was made", [facts([*of_file(what), *made])]))
    return f"Signature of {entries['scene_name']}", sections


def columns_of(lists: dict) -> dict[str, np.ndarray]:
    """Columns from the lists of JSON; null is NaN in a column of numbers."""
    columns = {}
    for name, values in lists.items():
        is_text = any(isinstance(value, str) for value in values)
        columns[name] = np.array(values, dtype=object if is_text else float)
    return columns


def fit(what: str, entries: dict, request: Request):
    """Fits of one surface, one for each band, with their data where these lie beside the file."""
    from mi_lcair.reports.page.fit_panel import fit_of_report, fit_sections

    reports, sections = list(entries.get("materials", {"": entries}).values()), []
    for report in reports:
        measurements, used = data_of(what, report)
        own = fit_sections(report, fit_of_report(report, used), measurements)
        own[-1].parts.insert(0, facts(of_file(what)))
        if len(reports) > 1:
            own = [Section(f"{part.title}, {report['band']} µm", part.parts) for part in own]
        sections += own
    return f"Fit of {reports[0]['name'] or Path(what).stem}", sections


def data_of(what: str, report: dict):
    """Measurements of a fit's report and the mask of fitted points, or (None, None).

    The file is sought beside the report and in the current folder. It must have the checksum that
    the report states.
    """
    from hashlib import sha256

    from mi_lcair.fitting.data import select
    from mi_lcair.fitting.scatterometer.reading import read as read_measurements

    source, settings = report["source"][0], report["settings"]
    for folder in (Path(what).parent, Path()):
        file = folder / Path(source["file"]).name
        if not file.is_file() or sha256(read_bytes(file)).hexdigest() != source["sha256"]:
            continue
        reading = report["reading"]
        # The report may say after the side how it was found
        side = reading["theta_r_positive"].split()[0]
        measurements = read_measurements(file, reading["quantity"], side)
        _, used, _ = select(
            measurements,
            settings["loss"],
            float(np.radians(settings["source_half_angle_deg"])),
            settings["max_angle_deg"],
            settings["min_brdf_per_sr"],
            1,
        )
        return measurements, used
    return None, None


def csv_file(what: str, request: Request):
    """The table of a trend, of facets or of a spectrum, as its columns say."""
    columns = tables.read_columns(what)
    kind = tables.kind_of(what, columns)
    if kind == tables.FACETS:
        return facets(what, columns, request)
    return trend(what) if kind == tables.TREND else spectrum(what, columns)


def made_rows(what: str) -> list[tuple[str, object]]:
    """How a CSV was made: its comments, and `made` of FILE.csv.json beside it, as rows."""
    rows = []
    for _, line in lines_of(read_text(what)):
        if line.lstrip().startswith("#"):
            key, colon, value = line.lstrip("# ").partition(": ")
            rows.append((key, value) if colon else ("remark", key))
    file = beside(Path(what))
    if file.is_file():
        try:
            rows += parse_json(read_text(file), str(file))["made"].items()
        except (ValueError, KeyError, TypeError, AttributeError):
            raise InputError(f"'{file}': does not state how '{what}' was made; remove it") from None
    return [(key, unpacked(value)) for key, value in rows]


def numeric(what: str, columns: dict, needed) -> dict[str, np.ndarray]:
    """The columns that hold numbers; raises InputError if one of `needed` does not."""
    numbers = {name: values for name, values in columns.items() if values.dtype.kind == "f"}
    for name in needed:
        if name not in numbers or not np.isfinite(numbers[name]).any():
            raise InputError(f"'{what}': column '{name}' must hold numbers")
    return numbers


def trend(what: str):
    """A trend's CSV."""
    read = Trend.read(what)
    made = dict(made_rows(what))
    band = read.band or str(made.get("band", "not stated beside the file"))
    sections = trend_sections(read.columns(), band)
    sections.append(Section("How it was made", [facts([*of_file(what), *made.items()])]))
    return f"Trend of {made['scene']}" if "scene" in made else f"Trend ({what})", sections


def spectrum(what: str, columns: dict):
    """A spectrum's CSV."""
    columns = numeric(what, columns, tables.KNOWN_BY[tables.SPECTRUM])
    made = [*of_file(what), *made_rows(what)]
    return f"Spectrum ({Path(what).name})", [
        spectrum_section(columns),
        Section("How it was made", [facts(made)]),
    ]


def facets(what: str, columns: dict, request: Request):
    """A facets table, on the model of `request.scene` if it is given."""
    numeric(what, columns, ("facet",))
    made = [*of_file(what), *made_rows(what)]
    if request.scene is not None:
        made += [("scene", getattr(request.scene, "name", request.scene))]
        made += request.parameters.items()
    section = facets_on_model(what, columns, request)
    return f"Facets ({Path(what).name})", [section, Section("How it was made", [facts(made)])]


def facets_on_model(what: str, columns: dict, request: Request, band: str = "") -> Section:
    """The section of a facets table, on the model of `request.scene` if it is given.

    band: name of the band of the radiances; by default that of the scene.
    """
    if request.scene is None:
        request.notes.append(f"{what}: give --scene SCENE to show the facets on its model")
        return facets_section(columns, band=known_band(band) if band else None)
    from mi_lcair.rendering.facets.table import FacetTable
    from mi_lcair.rendering.scene import scene_of

    scene = scene_of(request.scene, request.parameters)
    of_scene = FacetTable(scene)
    model = of_scene.triangles, of_scene.triangle_facet
    toward = toward_sensor(scene, request.sampling.get("sensor", 0))
    try:
        return facets_section(columns, model, toward, scene.band)
    except InputError as error:
        raise InputError(f"'{what}': {error}") from None


def of_file(what: str) -> list[tuple[str, str]]:
    """Name, date and size of a file, as rows of a table."""
    status = Path(what).stat()
    date = datetime.fromtimestamp(int(status.st_mtime), UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
    return [("file", str(what)), ("written", date), ("size", f"{status.st_size} bytes")]


def scene(what: str, request: Request):
    """A scene, which is rendered."""
    from mi_lcair.reports.page.rendering import of_scene

    return of_scene(what, request)


def scenario(what: str, request: Request):
    """A scenario, whose target is rendered through the air."""
    from mi_lcair.reports.page.rendering import of_scenario

    return of_scenario(what, request)


READERS = {
    "image": image,
    "json": json_file,
    "csv": csv_file,
    "scene": scene,
    "scenario": scenario,
}
