"""Control variate of path replay: less noise in derivatives with respect to narrow lobes.

Replay multiplies the radiance after a reflection by the score of the sampled direction, which is
the relative derivative of the BSDF. The mean of f / pdf over the directions is HDR. With a constant
c, the term c (HDR - f / pdf) therefore has a derivative whose mean is 0. Where c is the mean
incoming radiance, it removes the noise of scores that cancel in the mean, as in
`plugins.recorders.columns`.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mi_lcair.plugins.bsdfs.plume import is_plume
from mi_lcair.plugins.columns.tables import (
    CELLS,
    ColumnTables,
    incoming_radiance,
    kind_of,
    pilot_launch,
)
from mi_lcair.plugins.derivatives import nodes
from mi_lcair.plugins.recorders.channels import Channels


@dataclass(frozen=True)
class Control:
    """The constants c of the control variate.

    tables: numbers of the controlled surfaces, and their mean incoming radiances. columns, rows:
    size of the film in pixels.
    """

    tables: ColumnTables
    columns: int
    rows: int

    def cells(self, paths: int) -> mi.UInt32:
        """Cell of the film in which each path of a render begins, by pixels row by row."""
        pixels = self.columns * self.rows
        pixel = dr.arange(mi.UInt32, paths) // max(paths // pixels, 1)
        x, y = pixel % self.columns, pixel // self.columns
        cell = (y * CELLS // self.rows) * CELLS + x * CELLS // self.columns
        return dr.minimum(cell, CELLS * CELLS - 1)

    def incoming(self, bsdf, bounce, cell) -> mi.Float:
        """Mean incoming radiance of surfaces [W m^-2 sr^-1]; 0 for those without control."""
        number = self.tables.surface_number(bsdf)
        place = dr.select(bounce == 0, cell, CELLS * CELLS + number)
        return dr.gather(mi.Float, self.tables.incoming, place, number > 0)


def has_scores(bsdf) -> bool:
    """Whether scores of a BSDF that is known are noisy: a diffuse one has the weight HDR."""
    kind = kind_of(bsdf)
    if kind is None or is_plume(bsdf) or kind.lobe == "diffuse":
        return False
    return kind.model != "grey" or bsdf.least_share > 0


def control_of(tracer, differentiated, sensor, seed: int) -> Control | None:
    """The control variate for the gradients that are enabled; None if no surface needs it.

    tracer: the `PathTracer`, whose pilot measures the incoming radiance. It has its own numbers.
    differentiated: the BSDFs that have gradients.
    """
    surfaces = [b for b in differentiated if has_scores(b)]
    if not surfaces:
        return None
    tables = ColumnTables.of_surfaces(nodes(tracer.scene), surfaces)
    channels = Channels(None, tables=tables)
    # The numbers of the pilot must not be those of the render
    arriving = tracer.trace(sensor, pilot_launch(seed ^ 0x5EED, 1), channels).channels
    film = sensor.film()
    border = 2 * film.rfilter().border_size() if film.sample_border() else 0
    columns, rows = np.array(film.crop_size()) + border
    incoming = incoming_radiance(arriving, len(surfaces))
    return Control(tables.with_incoming(incoming), int(columns), int(rows))
