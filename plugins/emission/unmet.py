"""Bound of the radiance of sources that no path has hit, which the paths' scatter cannot show."""

from dataclasses import dataclass

import numpy as np

# A part of an emitter that is expected to be drawn this often is drawn with a probability of 95 %
FEW_DRAWS = 3.0
SIMILAR = 2.0  # ratio of the radiances of facets of an emitter that stand for each other


@dataclass(frozen=True)
class UnmetSources:
    """Upper bound of the radiance of sources that no path has hit.

    always: radiance of the brightest source that a path meets by chance alone [W m^-2 sr^-1].
    probability, radiance: the parts of emitters that are drawn, by rising probability of a draw,
    and the largest radiance of each part and of those before it [W m^-2 sr^-1].
    """

    always: float
    probability: np.ndarray
    radiance: np.ndarray

    def bound(self, draws: np.ndarray) -> np.ndarray:
        """The bound after these numbers of draws [W m^-2 sr^-1].

        A part of an emitter that is drawn less than FEW_DRAWS times on average is met by chance,
        as if it were not drawn at all. What is drawn more often shows in `Sums.chance`, be it
        hidden or not.
        """
        rare = FEW_DRAWS / np.maximum(draws, 1e-30)
        count = np.searchsorted(self.probability, rare)
        return np.maximum(self.always, np.append(0.0, self.radiance)[count])


def parts_of_emitters(radiances: list, probabilities: list) -> tuple[np.ndarray, np.ndarray]:
    """Probability and radiance for `UnmetSources`.

    A part of an emitter are all its facets from a certain radiance on. Facets of up to SIMILAR
    times its radiance less count as drawn instead of them.

    Parameters
    ----------
    radiances, probabilities : list of ndarray
        For each emitter, the radiance of its facets [W m^-2 sr^-1] and the probability of a draw.
    """
    parts = [(np.empty(0), np.empty(0))]
    for radiance, probability in zip(radiances, probabilities):
        order = np.argsort(-radiance, kind="stable")
        falling = radiance[order]
        similar = np.searchsorted(-falling, -falling / SIMILAR, side="right")
        parts.append((np.cumsum(probability[order])[similar - 1], falling))
    probability, radiance = map(np.concatenate, zip(*parts))
    order = np.argsort(probability, kind="stable")
    return probability[order], np.maximum.accumulate(radiance[order])
