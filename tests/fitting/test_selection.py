"""Which variants are compared, and which of them is chosen."""

from dataclasses import replace

import numpy as np
import pytest

from mi_lcair.errors import InputError
from mi_lcair.fitting.selection import FittedVariant, Variant, choose, criterion, variants
from tests.fitting.synthetic import MODEL

WHOLE = Variant(MODEL, "thesis")
SIMPLE = Variant(MODEL, "thesis", MODEL.restrictions[0])


def fitted(variant, cost):
    return FittedVariant(variant, None, np.zeros(4), cost, 0.0, 1.0)


def test_variants_of_a_model():
    """Whole ones first; restrictions only if the form is open."""
    found = variants(MODEL.name, "auto")
    whole = len(MODEL.forms)
    assert [variant.restriction for variant in found[:whole]] == [None] * whole
    assert len(found) == whole * (1 + len(MODEL.restrictions))
    assert variants(MODEL.name, "thesis") == [WHOLE]
    assert {variant.model.name for variant in variants("auto", "auto")} > {MODEL.name}
    with pytest.raises(InputError, match="form 'thesi' is unknown; .* has thesis"):
        variants(MODEL.name, "thesi")


def test_restricted_coordinates():
    restriction = MODEL.restrictions[0]
    assert WHOLE.free.all() and SIMPLE.whole == WHOLE
    assert SIMPLE.free.tolist() == [k != restriction.coordinate for k in range(4)]
    u = np.full((2, 4), 0.3)
    expected = u.copy()
    expected[:, restriction.coordinate] = restriction.value
    np.testing.assert_array_equal(SIMPLE.restrict(u), expected)
    np.testing.assert_array_equal(WHOLE.restrict(u), u)
    assert (fitted(WHOLE, 1.0).size, fitted(SIMPLE, 1.0).size) == (4, 3)


def test_bayesian_information_criterion():
    """n ln(sum of squares / rows) + k ln n."""
    assert criterion(fitted(WHOLE, 25.0), 100, 40.0) == pytest.approx(
        40 * np.log(0.5) + 4 * np.log(40)
    )
    assert criterion(fitted(SIMPLE, 0.0), 100, 40.0) == pytest.approx(
        40 * np.log(1e-24) + 3 * np.log(40)
    )


def test_the_simplest_that_is_not_worse():
    """Within 2 of the best the fewest parameters count, then the criterion."""
    candidates = [fitted(WHOLE, 1.0), fitted(SIMPLE, 1.0), replace(fitted(SIMPLE, 1.0), cost=2.0)]
    assert choose(candidates, [10.0, 12.0, 12.5]) == 1
    assert choose(candidates, [10.0, 12.1, 12.5]) == 0
    assert choose(candidates, [10.0, 11.9, 11.5]) == 2
