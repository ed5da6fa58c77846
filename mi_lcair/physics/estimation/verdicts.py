"""What is said about estimated values and about the residuals that they leave."""

from enum import StrEnum

SIGNIFICANCE = 0.001  # probability of a false alarm of a test of chi-square
# Width of a 95 % interval, relative to the range that was possible before the measurement, from
# which the data say nothing about a value
UNDETERMINED = 0.5
OVERSTATED = "the data scatter less than their sigma says"


class Verdict(StrEnum):
    """The verdicts on an estimated value, as users read them.

    The names in braces are filled in by `sentence`.
    """

    DETERMINED = "determined"
    WEAK = "weakly determined: interval {span}"
    AT_BOUND = "at its bound {bound}: interval {span}"
    WIDE = "not determined by these data: anything in {span} fits"
    ONE_SIDED = "not determined by these data: {what}"
    MISSED = "not determined by these data: the model misses {what}"
    HIDDEN = "not determined: the noise of the render hides its effect; raise spp of [render]"
    UNFINISHED = "not converged: the value still moves, and its error may be too small"
    # Values that were chosen to reach a goal
    CHOSEN = "chosen"
    CHOSEN_AMONG = "chosen, but {span} does nearly as well"
    FREE = "free: anything in {span} does as well"

    @staticmethod
    def of(width: float, possible: float, is_at_bound: bool, is_precise: bool) -> "Verdict":
        """The verdict that follows from the interval of a value.

        Parameters
        ----------
        width
            Width of the 95 % interval.
        possible
            Width of the range that was possible before the measurement.
        is_at_bound
            Whether the value lies at a bound.
        is_precise
            Whether the interval is as narrow as it should be.
        """
        if width >= UNDETERMINED * possible:
            return Verdict.WIDE
        if is_at_bound:
            return Verdict.AT_BOUND
        return Verdict.DETERMINED if is_precise else Verdict.WEAK

    def sentence(self, span: str = "", bound: str | None = "", what: str = "") -> str:
        """The verdict as a sentence.

        Parameters
        ----------
        span
            The 95 % interval.
        bound
            The bound at which the value lies.
        what
            What the model misses, or what the data say instead.
        """
        return self.value.format(span=span, bound=bound, what=what)

    @property
    def of_goal(self) -> "Verdict":
        """The verdict on a value that was chosen to reach a goal."""
        return OF_GOALS.get(self, self)

    @staticmethod
    def has_interval(sentence: str) -> bool:
        """Whether a sentence says that the data determine a value, well or weakly."""
        return sentence.startswith((Verdict.DETERMINED, Verdict.WEAK.partition(":")[0]))


OF_GOALS = {
    Verdict.DETERMINED: Verdict.CHOSEN,
    Verdict.WEAK: Verdict.CHOSEN_AMONG,
    Verdict.WIDE: Verdict.FREE,
}


def chi_square_text(chi_square: float, freedom: float, p_value: float, scatter: float = 0.0) -> str:
    """A reduced chi-square in words, with the scatter that a render's noise gives to it, if any."""
    value = f"{chi_square:.3g} +- {scatter:.2g}" if scatter else f"{chi_square:.3g}"
    return f"{value} for each of {freedom:.4g} degrees of freedom, p = {p_value:.2g}"
