"""Errors of a material in the form of a fit's report."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from mi_lcair.inversion.fitted import fitted, spread
from tests.inversion.blocks import block, kelvin, unknown


def test_spread_of_a_material():
    """Of four parameters two were estimated; the others have no error and no correlation."""
    covariance = np.array([[4.0, 9, 0.6], [9, 99, 9], [0.6, 9, 0.25]])
    found = spread("paint", ("a", "b", "c"), {"paint.c": 0, "paint.a": 2, "other.b": 1}, covariance)
    assert found["standard_error"] == {"a": 0.5, "b": 0.0, "c": 2.0}
    np.testing.assert_allclose(found["correlation"], [[1, 0, 0.6], [0, 1, 0], [0.6, 0, 1]])


class Measured:
    """A measured image of 2 x 2 pixels, of which three count."""

    label, aspects, quantity, background, is_image = "a", (), "radiance", 0.5, True
    entry = SimpleNamespace(state="hot")
    scene = SimpleNamespace(name="room", parameters={"T": "3"}, band=SimpleNamespace(name="LWIR"))
    where = SimpleNamespace(parameters={"lid.temperature": None})
    measured = np.array([3.0, 4.0, 5.0])

    def numbers(self, unknowns):
        return [0, 1, 2]

    def bad_pixels(self, block):
        return [(0, k) for k in np.flatnonzero(block.weight == 0)]

    def settings(self, unknowns, x):
        return {"lid.temperature": x[0]}

    def image(self, values):
        return np.append(values, np.nan).reshape(2, 2)


def test_a_datum_after_the_solution():
    """Predictions less the background, and residuals in standard deviations."""
    one = block([[2.0, 2, 2], [4, 4, 4]], np.zeros((2, 3, 3)), Measured.measured, 0.5)
    facets = [kelvin(f"f[{k}]", name="f", kind="facet", facet=k) for k in (4, 7)]
    x = np.array([320.0, 290.0, 295.0])
    found = fitted(Measured(), one, [kelvin("lid.temperature"), *facets, unknown("other")], x)
    assert found.facets == {"f": {4: 290.0, 7: 295.0}} and found.kinds == {
        "lid.temperature": "temperature"
    }
    np.testing.assert_array_equal(found.predicted, [[2.5, 2.5], [2.5, np.nan]])
    np.testing.assert_array_equal(found.measured, [[2.5, 3.5], [4.5, np.nan]])
    np.testing.assert_array_equal(found.residual, [[0, 2], [4, np.nan]])
    assert found.points == 3 and found.is_image and (found.band, found.state) == ("LWIR", "hot")
    left_out = replace(one, weight=np.array([4.0, 0.0, 4.0]))
    without_one = fitted(Measured(), left_out, [kelvin(), *facets, unknown()], x)
    np.testing.assert_array_equal(without_one.residual, [[0, np.nan], [4, np.nan]])
    assert without_one.points == 2 and without_one.bad_pixels == [(0, 1)]
    rms = found.entries()["residual_rms_sigmas"]
    np.testing.assert_allclose(rms, np.sqrt((0 + 4 + 16) / 3))
