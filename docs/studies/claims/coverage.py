"""Shares of claims that hold, with their own confidence intervals, and what counts as a defect."""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.stats import beta

from docs.studies.claims.claims import Claim

LEVEL = 0.95  # of the intervals that are claimed, and of those of the shares
AT_LEAST = 0.90  # share of claims that must hold
FALSE = (1.0, 1.5, 3.0)  # errors of a tolerance that was reached, in tolerances
FAR = 30.0  # error over what was stated that chance does not give: Student's t of 70 or more
SURE = 1e-4  # probability that a share which is good enough is taken for a defect


def is_tolerance(name: str) -> bool:
    return name.startswith("tolerance")


@dataclass(frozen=True)
class Row:
    """What became of the claims of one name and kind.

    claims, scenes: numbers of claims and of scenes that made them. held: share of the claims that
    hold. lower, upper: its 95 % interval. beyond: shares of the claims whose error is beyond FALSE
    times what was stated. worst: the claim with the largest error in what was stated.
    """

    name: str
    kind: str
    claims: int
    scenes: int
    held: float
    lower: float
    upper: float
    beyond: tuple[float, ...]
    worst: Claim


def interval(held: np.ndarray, scenes: np.ndarray, level: float = LEVEL) -> tuple[float, float]:
    """Interval of the share of claims that hold (C. J. Clopper and E. S. Pearson, 1934).

    The claims of one scene fail together. They count as so many independent ones as the scatter
    between scenes says (design effect of a ratio of cluster totals).

    Parameters
    ----------
    held : ndarray of bool, shape (N,)
    scenes : ndarray, shape (N,)
        Number of the scene of each claim.
    """
    n, p = len(held), held.mean()
    _, number = np.unique(scenes, return_inverse=True)
    clusters = number.max() + 1
    effect = 1.0
    if clusters > 1 and 0 < p < 1:
        residuals = np.bincount(number, held - p)
        effect = clusters / (clusters - 1) * (residuals**2).sum() / (n * p * (1 - p))
    elif n > clusters:
        effect = n / clusters
    n_effective = n / max(effect, 1.0)
    k, tail = p * n_effective, (1 - level) / 2
    lower = beta.ppf(tail, k, n_effective - k + 1) if k > 0 else 0.0
    upper = beta.ppf(1 - tail, k + 1, n_effective - k) if k < n_effective else 1.0
    return float(lower), float(upper)


def row(name: str, kind: str, claims: list[Claim], level: float = LEVEL) -> Row:
    held = np.array([claim.held for claim in claims])
    excess = np.array([claim.excess for claim in claims])
    scenes = np.array([hash((claim.seed, claim.number)) for claim in claims])
    lower, upper = interval(held, scenes, level)
    return Row(
        name=name,
        kind=kind,
        claims=len(claims),
        scenes=len(np.unique(scenes)),
        held=float(held.mean()),
        lower=lower,
        upper=upper,
        beyond=tuple(float((excess > times).mean()) for times in FALSE),
        worst=claims[int(np.argmax(excess))],
    )


def rows(claims: Iterable[Claim], by_kind: bool = False, level: float = LEVEL) -> list[Row]:
    """A row for each name of a claim, or for each name and kind of scene."""
    groups = defaultdict(list)
    for claim in claims:
        groups[claim.name, claim.kind if by_kind else ""].append(claim)
    return [row(*key, groups[key], level) for key in sorted(groups)]


def defects(claims: Iterable[Claim], by_kind: bool = True) -> dict[tuple[str, str], str]:
    """Names of claims that do not hold, and kinds of scenes, each with its number.

    These are intervals whose coverage is below AT_LEAST beyond chance or that are missed by more
    than FAR times, tolerances that are missed by more than three times, pairs that differ, and
    faults.
    """
    result = {}
    for entry in rows(claims, by_kind, level=1 - 2 * SURE):
        limit = FALSE[-1] if is_tolerance(entry.name) else FAR
        is_false = entry.worst.excess > (1 if entry.name.startswith("pair") else limit)
        if entry.upper < AT_LEAST or is_false or entry.name.startswith("fault"):
            result[entry.name, entry.kind] = (
                f"{entry.claims - round(entry.held * entry.claims)} of {entry.claims} false, "
                f"worst {entry.worst.excess:.3g} times ({entry.worst.kind}, "
                f"--seed {entry.worst.seed} --first {entry.worst.number})"
            )
    return result
