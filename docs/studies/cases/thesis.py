"""The two intensities for which the thesis names analytical values (Harkiss 2007, A.1 and A.2).

Reference: view factors in closed form, 22.0755 W/sr of two perpendicular plates and 13.6134 W/sr of
the open box.
"""

import numpy as np

import mi_lcair
from docs.studies.cases.comparison import Comparison

EXACT = {"two_plates": 22.0755, "open_box": 13.6134}


def compare() -> Comparison:
    """Signatures with their 95 % intervals."""
    results = [mi_lcair.signature(name, tolerance=0.001).target for name in EXACT]
    values = np.array([result.intensity for result in results])
    half = np.array([result.half_width for result in results])
    return Comparison(
        "Thesis, two plates and open box", "W/sr", values, [*EXACT.values()], half, 0.05
    )
