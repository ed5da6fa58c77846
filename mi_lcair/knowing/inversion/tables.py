"""Tables of an inverse problem beside its measurements: unknowns, goal and render."""

from dataclasses import dataclass
from typing import Any, Literal

from mi_lcair.declared import Described, Rule, entry, rule


def prior_of(key: str) -> Rule:
    """The rule that a prior, if it is given, is a mean and a positive standard deviation."""

    def message(table: Any) -> str | None:
        prior = getattr(table, key)
        if prior is None or prior[1] > 0:
            return None
        return (
            f"{key} = {list(prior)}: sigma is {prior[1]:g}; must be positive. Set a parameter that "
            "is known exactly in the scene instead"
        )

    return Rule(message)


OF_AN_UNKNOWN = (
    prior_of("prior"),
    rule(
        lambda t: None in (t.lower, t.upper) or t.lower < t.upper,
        "lower = {t.lower:g} is not below upper = {t.upper:g}",
    ),
)
OF_A_GOAL = (
    rule(
        lambda t: (t.background_K is not None) == (t.quantity == "contrast"),
        "background_K is needed with quantity = 'contrast', and only then",
    ),
    rule(
        lambda t: t.value > 0 or not t.at_most,
        "value = {t.value:g}; must be positive with at_most",
    ),
)


@dataclass(frozen=True)
class UnknownEntry(Described, rules=OF_AN_UNKNOWN):
    """Entry of [unknowns] or [nuisance].

    Attributes
    ----------
    start : float, optional
        First guess; by default the scene's value.
    lower, upper : float, optional
        Bounds; by default those of the model.
    prior : tuple of float, optional
        Mean and standard deviation that are known beforehand.
    per : tuple of str, optional
        The unknown has a separate value for each of these: "band", "state", "data"; [] means one
        value in all data. By default temperatures have a value for each state, materials and
        emissivities for each band, radiances for each band and state, and motions for each image.
        Control points have one value in all data.
    correlation_m : float, optional
        For the facets of a group: correlation length of their temperatures, m. `prior` gives the
        standard deviation about the mean. For control points: that of their displacements.
    correlation_um : float, optional
        The same for "MATERIAL.spectrum", in micrometres of wavelength.
    """

    start: float | None = None
    lower: float | None = None
    upper: float | None = None
    prior: tuple[float, float] | None = None
    per: tuple[Literal["band", "state", "data"], ...] | None = None
    correlation_m: float | None = entry(None, is_positive=True)
    correlation_um: float | None = entry(None, is_positive=True)


@dataclass(frozen=True)
class Goal(Described, where="[goal]", rules=OF_A_GOAL):
    """Table [goal]: what the unknowns are to achieve, in place of measurements.

    Attributes
    ----------
    quantity : str
        "intensity" of the target [W/sr], or "contrast" [W/sr]: the intensity minus that of the
        background behind the target.
    scene : str
        Bundled scene or Mitsuba XML file.
    parameters : dict
        The scene's $-parameters.
    value : float
        Wanted value.
    at_most : bool
        Whether smaller magnitudes than `value` are also accepted.
    background_K : float, optional
        Apparent temperature of the background, for a contrast.
    azimuth_deg, elevation_deg : tuple of float
        Directions of view for which the rms deviation from the value is minimised: all pairs of
        azimuth and elevation.
    starts : int
        Number of first guesses: the scene's values, and random values within the bounds.
    """

    quantity: Literal["intensity", "contrast"]
    scene: str = entry(is_file=True)
    parameters: dict = entry(dict, is_file=True)
    value: float = 0.0
    at_most: bool = False
    background_K: float | None = entry(None, is_positive=True)
    azimuth_deg: tuple[float, ...] = (0.0,)
    elevation_deg: tuple[float, ...] = (0.0,)
    starts: int = entry(1, lower=1, upper=100)

    @property
    def aspects(self) -> tuple[tuple[float, float], ...]:
        """All pairs of azimuth and elevation, degrees."""
        return tuple((a, e) for e in self.elevation_deg for a in self.azimuth_deg)


@dataclass(frozen=True)
class RenderSettings(Described, where="[render]"):
    """Table [render].

    Attributes
    ----------
    spp : int, optional
        Samples per pixel (default: the number in the scene). For the directions of a trend or a
        goal, the number of paths divided by 64 x 64 (16).
    seed : int
        Seed of the random numbers.
    randomisations : int
        Independent renders whose products are unbiased.
    iterations : int
        Largest number of renders of each image, from each first guess.
    starts : int
        Number of first guesses for measurements: those of the unknowns, and random values within
        the bounds. The solution with the smallest chi-square is kept.
    scale_errors : bool
        Whether the given noise is only known up to a factor. The errors then assume the noise for
        which chi-square is equal to its degrees of freedom.
    """

    spp: int | None = entry(None, lower=2, upper=2**31)
    seed: int = entry(0, lower=0, upper=2**32 - 1)
    randomisations: int = entry(4, lower=2, upper=64)
    iterations: int = entry(20, lower=1, upper=1000)
    starts: int = entry(1, lower=1, upper=100)
    scale_errors: bool = False
