"""What is known of facets of a group, or nodes of a spectrum, together: near ones are alike."""

import numpy as np

from mi_lcair.errors import InputError
from mi_lcair.inversion.unknowns import Unknown, base_name

MOST_FACETS = 2000  # facets with a correlation, whose equations are dense
NUGGET = 1e-6  # share of the variance that each facet has for itself, so that inverses exist


def matern(distance: np.ndarray, length: float) -> np.ndarray:
    """Correlation of values at a distance for a correlation length, in the same unit.

    Matern's with the parameter 3/2, whose fields have one derivative (Rasmussen and Williams 2006,
    Eq. 4.17).
    """
    scaled = np.sqrt(3) * distance / length
    return (1 + scaled) * np.exp(-scaled)


def precision(unknowns: list[Unknown], sigma: np.ndarray) -> np.ndarray | None:
    """Inverse covariance (N, N) that is known beforehand; None without correlated facets.

    Facets of one group and state correlate by the straight distance of their centres. sigma:
    standard deviations (N,). Raises InputError for too many facets.
    """
    groups = {}
    for k, unknown in enumerate(unknowns):
        if unknown.correlation_m:
            groups.setdefault((base_name(unknown), unknown.data, unknown.correlation_m), []).append(
                k
            )
    if not groups:
        return None
    if len(unknowns) > MOST_FACETS:
        raise InputError(
            f"correlation_m with {len(unknowns)} unknowns; it needs at most {MOST_FACETS}: take a "
            "coarser model, or leave it out"
        )
    result = np.diag(sigma**-2.0)
    for (_, _, length), numbers in groups.items():
        centre = np.array([unknowns[k].centre for k in numbers])
        distance = np.linalg.norm(centre[:, None] - centre, axis=-1)
        correlation = (matern(distance, length) + NUGGET * np.eye(len(numbers))) / (1 + NUGGET)
        of_group = np.outer(sigma[numbers], sigma[numbers]) * correlation
        result[np.ix_(numbers, numbers)] = np.linalg.inv(of_group)
    return result
