"""Tables of an inverse problem beside its measurements: unknowns, goal and render."""

from dataclasses import dataclass, field

from mi_lcair.declared import check_fields, within
from mi_lcair.errors import InputError, check_known

NUMBERS = ("intensity", "contrast")  # what a goal may be about, W/sr
PER = ("band", "state", "data")  # what an unknown may have a value of its own for


@dataclass(frozen=True)
class UnknownEntry:
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
        What has a value of its own: "band", "state", "data"; [] for one value in all data. By
        default temperatures have one for each state, materials and emissivities one for each band,
        and radiances one for each band and state. Motions have one for each image.
    correlation_m : float, optional
        For the facets of a group: distance in metres over which their temperatures are alike. The
        standard deviation about the mean is that of `prior`.
    correlation_um : float, optional
        The same for "MATERIAL.spectrum", in micrometres of wavelength.
    """

    start: float | None = None
    lower: float | None = None
    upper: float | None = None
    prior: tuple[float, ...] | None = None
    per: tuple[str, ...] | None = None
    correlation_m: float | None = field(default=None, metadata=within(is_positive=True))
    correlation_um: float | None = field(default=None, metadata=within(is_positive=True))

    def __post_init__(self):
        check_fields(self)
        check_prior(self.prior, "prior")
        check_known("word of per", PER, *(self.per or ()))
        if None not in (self.lower, self.upper) and not self.lower < self.upper:
            raise InputError(f"lower = {self.lower:g} is not below upper = {self.upper:g}")


@dataclass(frozen=True)
class Goal:
    """Table [goal]: what the unknowns are to achieve, in place of measurements.

    Attributes
    ----------
    quantity : str
        "intensity" of the target [W/sr], or "contrast" [W/sr]: the intensity less that of the
        background which the target hides.
    scene : str
        Bundled scene or Mitsuba XML file.
    parameters : dict
        The scene's $-parameters.
    value : float
        Wanted value.
    at_most : bool
        Whether smaller magnitudes than `value` satisfy too.
    background_K : float, optional
        Apparent temperature of the background, for a contrast.
    azimuth_deg, elevation_deg : tuple of float
        Aspects over which the rms deviation from the value is made small: all pairs.
    starts : int
        Number of first guesses: the scene's values, and random ones within the bounds.
    """

    quantity: str
    scene: str
    parameters: dict = field(default_factory=dict)
    value: float = 0.0
    at_most: bool = False
    background_K: float | None = field(default=None, metadata=within(is_positive=True))
    azimuth_deg: tuple[float, ...] = (0.0,)
    elevation_deg: tuple[float, ...] = (0.0,)
    starts: int = field(default=1, metadata=within(lower=1, upper=100))

    def __post_init__(self):
        check_fields(self)
        check_known("quantity", NUMBERS, self.quantity)
        if (self.background_K is not None) != (self.quantity == "contrast"):
            raise InputError("background_K goes with quantity = 'contrast', and is needed there")
        if self.at_most and not self.value > 0:
            raise InputError(f"value = {self.value:g}; must be positive with at_most")

    @property
    def aspects(self) -> tuple[tuple[float, float], ...]:
        """All pairs of azimuth and elevation, degrees."""
        return tuple((a, e) for e in self.elevation_deg for a in self.azimuth_deg)


@dataclass(frozen=True)
class RenderSettings:
    """Table [render].

    Attributes
    ----------
    spp : int, optional
        Samples per pixel (those of the scene). For the aspects of a trend or a goal, the number of
        paths divided by 64 x 64 (16).
    seed : int
        Seed of the random numbers.
    randomisations : int
        Independent renders whose products are unbiased.
    iterations : int
        Largest number of renders of each image, from each first guess.
    starts : int
        Number of first guesses for measurements: those of the unknowns, and random ones within the
        bounds. The solution with the smallest chi-square is kept.
    scale_errors : bool
        Whether the stated noise is only right up to a factor. The errors are then those of the
        noise that makes chi-square as large as its degrees of freedom.
    """

    spp: int | None = field(default=None, metadata=within(lower=2, upper=2**31))
    seed: int = field(default=0, metadata=within(lower=0, upper=2**32 - 1))
    randomisations: int = field(default=4, metadata=within(lower=2, upper=64))
    iterations: int = field(default=20, metadata=within(lower=1, upper=1000))
    starts: int = field(default=1, metadata=within(lower=1, upper=100))
    scale_errors: bool = False

    def __post_init__(self):
        check_fields(self)


def check_prior(prior, key: str) -> None:
    """Raise InputError unless a prior is None or a mean and a positive standard deviation."""
    if prior is None:
        return
    if len(prior) != 2:
        raise InputError(f"{key} = {list(prior)}; must be [mean, sigma]")
    if not prior[1] > 0:
        raise InputError(
            f"{key} = {list(prior)}: sigma is {prior[1]:g}; must be positive. Set a parameter that "
            "is known exactly in the scene instead"
        )
