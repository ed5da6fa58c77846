"""In-band values of clear air against LOWTRAN7's own, relative errors in percent."""

import numpy as np

from docs.studies.air import errors
from docs.studies.cases.comparison import Comparison


def compare() -> Comparison:
    """All geometries and airs of the table of the tests, each error in percent of its value."""
    percent = 100 * np.concatenate([*errors().values()])
    return Comparison("Clear air, LOWTRAN7", "%", percent, 0 * percent, reach=1.0)
