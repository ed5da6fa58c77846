"""A problem with its data, whose scenes are loaded, and its unknowns."""

from mi_lcair.errors import InputError
from mi_lcair.inversion.data.datum import Datum
from mi_lcair.inversion.data.loader import Loader, goal_datum
from mi_lcair.inversion.problem import InverseProblem, parts
from mi_lcair.inversion.tables import Goal
from mi_lcair.inversion.unknowns import FACETS, Unknown, instruments, unknowns


def loaded(problem: InverseProblem) -> tuple[Loader, list[Datum], list[Datum], list[Unknown]]:
    """Loader, data, candidates and unknowns of a problem.

    Raises InputError if anything cannot be used, and for too few data.
    """
    loader, groups = Loader(problem.motions), facet_groups(problem)
    if problem.goal is not None:
        data = [goal_datum(problem.goal, problem.render, problem.motions)]
        proposed, everything = [], unknowns_of(problem, data)
        check_goal(everything, problem.goal)
    else:
        entries = enumerate([*problem.data, *problem.candidates])
        made = [loader.datum(entry, number, groups) for number, entry in entries]
        data, proposed = made[: len(problem.data)], made[len(problem.data) :]
        everything = [*unknowns_of(problem, data), *instruments(data)]
    check_counts(everything, data)
    return loader, data, proposed, everything


def facet_groups(problem: InverseProblem) -> set[str]:
    """Groups whose facets are unknown."""
    names = [parts(text)[0] for text in (*problem.unknowns, *problem.nuisance)]
    return {name.removesuffix(FACETS) for name in names if name.endswith(FACETS)}


def check_counts(everything: list[Unknown], data: list[Datum]) -> None:
    """Raise InputError for more unknowns without a prior than data."""
    free = sum(unknown.prior is None for unknown in everything)
    points = sum(len(datum.measured) for datum in data)
    if free > points:
        raise InputError(
            f"{free} unknowns without a prior, but only {points} measured "
            f"{'values' if points != 1 else 'value'}; measure more, or give priors"
        )


def check_goal(everything: list[Unknown], goal: Goal) -> None:
    """Raise InputError for a wanted contrast whose hidden background would change."""
    moving = [unknown.name for unknown in everything if unknown.kind == "motion"]
    if goal.background_K is not None and moving:
        raise InputError(
            f"'{moving[0]}' changes the area of the background that the target hides; a goal of a "
            "contrast takes no motions, one of an intensity does"
        )


def unknowns_of(problem: InverseProblem, data: list[Datum], more=()) -> list[Unknown]:
    """The unknowns of a problem's data, and of more data that may be measured."""
    places = [datum.where for datum in (*data, *more)]
    return unknowns(problem.unknowns, problem.nuisance, places, len(data))
