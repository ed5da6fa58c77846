"""Titles and sections of files that the commands wrote."""

from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from mi_lcair import formats
from mi_lcair.charts import facets_section
from mi_lcair.errors import InputError, errors_of, option
from mi_lcair.extras import named
from mi_lcair.files import read_bytes, read_text
from mi_lcair.fitting.report import fit_of_report, sections_of_report
from mi_lcair.physics.bands import Band, known_band
from mi_lcair.rendering.images.render import image_sections
from mi_lcair.results import columns_of, extremes
from mi_lcair.sections import Facts, LongTable, Remarks, Section, unpacked
from mi_lcair.show import kinds
from mi_lcair.show.page.model_panel import rows_by_facet
from mi_lcair.signatures.effective_areas import spectrum_section
from mi_lcair.signatures.trend import Trend, made_of
from mi_lcair.table import lines_of

MADE = "How it was made"


@dataclass(frozen=True)
class SceneModel:
    """The model of a scene, on which a table of facets is shown.

    name: of the scene. parameters: its $-parameters. triangles, triangle_facet: corners (T, 3, 3)
    [m], and the facet of each triangle. toward: direction toward the sensor. band: of the scene.
    """

    name: str
    parameters: dict[str, str]
    triangles: np.ndarray
    triangle_facet: np.ndarray
    toward: np.ndarray
    band: Band


def read(what: str, kind: str, model: SceneModel | None = None) -> tuple[str, list[Section]]:
    """Title and sections of a file.

    what: its path. kind: its kind, which has a page. model: on which facets are shown.

    Raises InputError if it cannot be used.
    """
    show = named(f"{__name__}:{kinds.KINDS[kind].page}")
    is_json = kinds.KINDS[kind].json or kind == kinds.ANOTHER
    with kinds.whole(what) if is_json else nullcontext():
        title, sections = show(what, model)
    sections[-1].parts.insert(0, Facts(of_file(what)))
    return title, sections


def image(what: str, model):
    """A radiance image, or what another program's EXR holds."""
    from mi_lcair.rendering.images.files import read_exr

    channels, header = read_exr(what)
    if not channels:
        raise InputError(f"'{what}': has no channels; there is nothing to show")
    shapes = {pixels.shape for pixels in channels.values()}
    if len(shapes) > 1 or any(len(shape) != 2 for shape in shapes):
        raise InputError(
            f"'{what}': its channels differ in size; report shows channels of one size"
        )
    scene, name = header.get("scene"), Path(what).name
    return f"{scene} ({name})" if scene else name, image_sections(channels, header)


def result(what: str, model):
    """The JSON of a result."""
    read_result = kinds.read_result(what)
    return read_result.page_title(), read_result.page()


def entries(what: str, model):
    """The JSON of a result of any kind: its entries, and lists of one length as a table."""
    content, facts, tables = kinds.read_json(what), [], {}
    for name, value in leaves(content):
        if isinstance(value, list) and len(value) > 1:
            tables.setdefault(len(value), {})[name] = np.array(list(map(cell, value)))
        else:
            facts.append((name, cell(value)))
    tables = [LongTable(columns) for columns in tables.values()]
    title = f"{content['kind'].capitalize()} ({Path(what).name})"
    return title, [Section("Entries", [Facts(facts), *tables]), made_section([])]


def leaves(tree, front: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the entries of a tree that are no objects, by dotted name; rows become columns."""
    for name, value in tree.items():
        if isinstance(value, list) and value and all(isinstance(row, dict) for row in value):
            value = {key: [row.get(key) for row in value] for key in value[0]}
        if isinstance(value, dict) and value:
            yield from leaves(value, f"{front}{name}.")
        else:
            yield f"{front}{name}", value


def cell(value):
    """A number, or anything else as text."""
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return value if is_number else "" if value is None else str(unpacked(value))


def signature(what: str, model):
    """A signature's JSON: tables, spectrum and facets."""
    made = kinds.read_result(what)
    facets = []
    if "facets" in made.given:
        band, columns = known_band(made.given["band"]), columns_of(made.given["facets"])
        facets = [facets_on_model(what, columns, model, band)]
    return made.page_title(), made.page(others=facets)


def facet_model(what: str, model):
    """A model file: its figures, and the facets to turn and to hover."""
    from mi_lcair import models3d

    read_model = models3d.read(Path(what))
    corners = read_model.vertices[read_model.triangles], read_model.triangle_facet
    sections = [*read_model.sections(), facets_section(read_model.columns(), corners)]
    return f"Model ({Path(what).name})", [*sections, made_section([])]


def fit(what: str, model):
    """Fits of one surface, one for each band, with their data where these lie beside the file."""
    entries = kinds.read_json(what)
    reports, sections = list(entries.get("materials", {"": entries}).values()), []
    for report in reports:
        measurements, used = data_of(what, report)
        fitted = fit_of_report(report, used)
        of_band = sections_of_report(report, fitted, measurements)
        if len(reports) > 1:
            of_band = [
                Section(f"{section.title}, {report['band']} µm", section.parts, section.is_detail)
                for section in of_band
            ]
        sections += of_band
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


def trend(what: str, model):
    """The table of a trend."""
    stated, made = Trend.read(what), made_rows(what)
    title = f"Trend of {stated.scene_name}" if "scene" in dict(made) else f"Trend ({what})"
    return title, [*stated.sections(), made_section(made)]


def spectrum(what: str, model):
    """The table of a spectrum."""
    columns = numeric(what, formats.read_columns(what), kinds.KINDS[kinds.SPECTRUM].columns)
    sections = [spectrum_section(columns), made_section(made_rows(what))]
    return f"Spectrum ({Path(what).name})", sections


def results(what: str, model):
    """The table of a sweep or a flight."""
    columns = formats.read_columns(what)
    table = Section("Results", [extremes(columns), LongTable(columns)])
    return f"Results ({Path(what).name})", [table, made_section(made_rows(what))]


def facets(what: str, model):
    """A table of facets, on their model if it is given."""
    columns, made = formats.read_columns(what), made_rows(what)
    numeric(what, columns, ("facet",))
    if model is not None:
        made += [("scene", model.name), *model.parameters.items()]
    sections = [facets_on_model(what, columns, model), made_section(made)]
    return f"Facets ({Path(what).name})", sections


def facets_on_model(what: str, columns: dict, model: SceneModel | None, band=None) -> Section:
    """The section of a table of facets, on their model if it is given.

    band: Band of the radiances; by default that of the model's scene.
    """
    if model is None:
        section = facets_section(columns, band=band)
        remark = f"{what}: give {option('scene', 'SCENE')} to show the facets on its model"
        return Section(section.title, [*section.parts, Remarks([remark])])
    with errors_of(f"'{what}'"):
        rows_by_facet(columns["facet"], model.triangle_facet)
    return facets_section(
        columns, (model.triangles, model.triangle_facet), model.toward, model.band
    )


def made_rows(what: str) -> list[tuple[str, object]]:
    """How a table was made: its comments, and `made` of FILE.csv.json beside it, as rows."""
    rows = []
    for _, line in lines_of(read_text(what)) if what.lower().endswith(".csv") else ():
        if line.lstrip().startswith("#"):
            key, colon, value = line.lstrip("# ").partition(": ")
            rows.append((key, value) if colon else ("remark", key))
    rows += made_of(Path(what)).items()
    return [(key, unpacked(value)) for key, value in rows]


def numeric(what: str, columns: dict, needed) -> dict[str, np.ndarray]:
    """The columns that hold numbers; raises InputError if one of `needed` does not."""
    numbers = {name: values for name, values in columns.items() if values.dtype.kind == "f"}
    for name in needed:
        if name not in numbers or not np.isfinite(numbers[name]).any():
            raise InputError(f"'{what}': column '{name}' must contain numbers")
    return numbers


def of_file(what: str) -> list[tuple[str, str]]:
    """Name, date and size of a file, as rows of a table."""
    status = Path(what).stat()
    date = datetime.fromtimestamp(int(status.st_mtime), UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
    return [("file", str(what)), ("written", date), ("size", f"{status.st_size} bytes")]


def made_section(rows: list) -> Section:
    """The section about how a file was made."""
    return Section(MADE, [Facts(rows)], is_detail=True)
