"""What the first render of an estimate shows."""

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.inversion.least_squares.estimate import check_seen
from tests.inversion.blocks import block, kelvin, unknown


def test_every_unknown_needs_data():
    """Facets and unknowns with a prior may do without."""
    columns = np.zeros((2, 3, 3))
    columns[1, 2, 0] = 1e-9  # one value of one randomisation
    seen = block(np.ones((2, 3)), columns, np.ones(3), gain=3)
    facet = kelvin("f", kind="facet", facet=0)
    gain = unknown("gain [a]", kind="gain")
    check_seen([unknown("a"), facet, unknown("c", prior=(0.3, 0.1)), gain], [seen])
    with pytest.raises(InputError, match="'c' is an unknown without any data"):
        check_seen([unknown("a"), facet, unknown("c"), gain], [seen])
