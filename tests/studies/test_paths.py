"""The study of paths to an error: paths from curves of errors."""

import pytest

from docs.studies.paths import Curve


def test_independent_paths_follow_the_square_root():
    """An error of 0.1 at 100 paths, and 0.01 at 10000, is 0.001 at 10^6."""
    assert Curve({100: 0.1, 10000: 0.01}).paths_to(0.001, independent=True) == pytest.approx(1e6)


def test_lattice_paths_are_interpolated():
    """The error is inversely proportional to the paths from 100 to 1000."""
    curve = Curve({10: 0.01, 100: 0.1, 1000: 0.01})
    assert curve.paths_to(0.02, independent=False) == pytest.approx(500)
    assert curve.paths_to(0.2, independent=False) == 10
    assert curve.paths_to(0.005, independent=False) is None
