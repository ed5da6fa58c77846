"""Cases of a test of which some belong to the suite and all to `-m study`."""

import pytest


def some_of(cases, every: int) -> list:
    """Parameters for `pytest.mark.parametrize`; the first of each `every` ones is in the suite."""
    return [
        case if k % every == 0 else pytest.param(*_values(case), marks=pytest.mark.study)
        for k, case in enumerate(cases)
    ]


def _values(case) -> tuple:
    return case if type(case) is tuple else (case,)
