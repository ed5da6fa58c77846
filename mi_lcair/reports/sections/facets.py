"""Sections of a table of facets, on their model where it is known."""

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.results.result import summary_of
from mi_lcair.results.sections import Drawing, LongTable, Section

if TYPE_CHECKING:
    from mi_lcair.rendering.scene import Scene


def sections(facets, scene: "Scene | None" = None, sensor: int = 0) -> list[Section]:
    """FacetResults on their model.

    scene: the loaded scene they were made from. The model is seen at first from its sensor with the
    number `sensor`.
    """
    toward = None if scene is None else toward_sensor(scene, sensor)
    model = facets.triangles, facets.triangle_facet
    section = facets_section(facets.columns(), model, toward, known_band(facets.band))
    return [Section(section.title, [summary_of(facets), *section.parts])]


def facets_section(columns: dict[str, np.ndarray], model=None, toward=None, band=None) -> Section:
    """The facets: the model in space, if it is known, and a long table.

    model: triangles and their facets' numbers, as `model_panel` takes them. toward: direction
    toward the sensor. band: Band of the radiances, for the emissivity.
    """
    from mi_lcair.reports.page.model_panel import model_panel, with_emissivity

    columns = columns if band is None else with_emissivity(columns, band)
    drawing = [] if model is None else [Drawing(partial(model_panel, *model, columns, toward))]
    sort_by = "intensity_W_sr" if "intensity_W_sr" in columns else None
    return Section("Facets", [*drawing, LongTable(columns, sort_by)])


def known_band(name: str):
    """The Band of a name; None for one that was read from a file."""
    from mi_lcair.physics.bands import band

    try:
        return band(name)
    except InputError:
        return None


def toward_sensor(scene: "Scene", sensor: int = 0):
    """Direction from a scene toward its sensor, (3,)."""
    from mi_lcair.rendering.window import window

    return -window(scene.sensor(sensor))[3]
