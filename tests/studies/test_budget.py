"""The study of budgets: what it reads from other pages, and its own uncertainties."""

import mitsuba as mi

from docs.studies import budget
from mi_lcair.knowing.budgets.budget import result_of
from mi_lcair.knowing.budgets.inputs import Inputs
from mi_lcair.knowing.budgets.uncertainties import Uncertainties

mi.set_variant("llvm_ad_mono")


def test_the_study_by_hand_has_the_same_cases():
    found = budget.by_hand()
    assert set(found) == set(budget.BY_HAND)
    assert all(len(cells) == len(budget.CASES) for cells in found.values())
    assert all(cell.strip().endswith("%") for cells in found.values() for cell in cells)


def test_the_uncertainties_fit_the_scenario():
    """All names in docs/validation/budget/landing.toml are known; nothing is rendered."""
    with result_of(budget.scenario(3, "LWIR"), {}) as number:
        inputs = Inputs.of(Uncertainties.read(budget.STATED), number.known, number.what)
    assert {"sky.radiance", "scenario.range_m", "bare_aluminum.e"} <= set(inputs.names)
    assert [
        quantity for quantity, _ in budget.BY_HAND.values() if quantity not in inputs.names
    ] == []
