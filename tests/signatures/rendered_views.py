"""Intensities toward many views, with the errors of all their parts."""

from types import SimpleNamespace

import numpy as np

from mi_lcair.rendering.measurands import Measurands
from mi_lcair.signatures.view_areas import totals_of_views


def render_views(scene, views, resolution, sampling):
    """parts: values and standard errors by name, (2, V) [W/sr, m^2], and what their totals know."""
    total, areas = totals_of_views(scene, views, resolution, sampling, Measurands.of("model"))
    parts = {n: np.array([total.mean(n), total.standard_error(n)]) * areas for n in total.sums}
    return SimpleNamespace(
        parts=parts,
        half_width=total.half_width("target") * areas,
        paths=total.traced,
        excess=total.excess,
    )
