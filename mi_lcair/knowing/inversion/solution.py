"""The solution of an inverse problem: what it holds, and what its file says."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from mi_lcair.errors import check_known
from mi_lcair.knowing.inversion.advice import Advice
from mi_lcair.knowing.inversion.answers import UNTESTED, Answer, Direction, in_words
from mi_lcair.knowing.inversion.least_squares.solve import Step
from mi_lcair.physics.estimation.verdicts import correlation
from mi_lcair.rendering.parameters.values import KIND
from mi_lcair.results import Result, built, entry
from mi_lcair.sections import Lines, Table

SHOWN = 2  # unknowns in the summary
MOST_ROWS = 40  # unknowns in the table; of more, the facets are summed up
MOST_LINES = 5  # sentences of advice


@dataclass(frozen=True)
class Fitted:
    """A datum after the solution.

    Attributes
    ----------
    name, scene, band, state : str
        As in the problem.
    parameters : dict of str to str
        The scene's $-parameters.
    values : dict of str to float
        Estimated parameters of the scene by name.
    kinds : dict of str to str
        Kinds of these parameters.
    facets : dict of str to dict of int to float
        Estimated temperatures [K] by group and facet.
    points, size : int
        Number of values that count, and of all.
    residual_rms_sigmas : float
        Rms residual, in standard deviations.
    measured, predicted, residual : ndarray or None
        Measured and predicted values [W m^-2 sr^-1 or W/sr], and their difference in standard
        deviations of measurement and render: (H, W) with NaN for pixels that do not count, or (n,).
        None for the image of a solution that was read from its file, which has no pixels.
    aspects : list of tuple of float
        Azimuth and elevation of each value of a trend; empty for others.
    quantity : str
        What was measured, with its unit.
    bad_pixels : list of tuple of int
        Row and column of pixels of an image that were left out because of their residual.
    """

    name: str
    scene: str
    band: str
    state: str
    parameters: dict[str, str]
    values: dict[str, float]
    kinds: dict[str, str]
    facets: dict[str, dict[int, float]]
    points: int
    size: int
    residual_rms_sigmas: float
    measured: np.ndarray | None = None
    predicted: np.ndarray | None = None
    residual: np.ndarray | None = None
    aspects: list = field(default_factory=list)
    quantity: str = "radiance (W m^-2 sr^-1)"
    bad_pixels: list = field(default_factory=list)

    @property
    def residual_words(self) -> str:
        """How well the datum is fitted, in words."""
        size = f"{self.size} values"
        count = f"{self.points} of {size}" if self.points < self.size else size
        return (
            f"{count}, rms residual {self.residual_rms_sigmas:.3g} standard deviations of "
            "measurement and render together"
        )

    @property
    def is_image(self) -> bool:
        return self.measured is None or self.measured.ndim == 2

    def as_dict(self) -> dict:
        """Entries of the solution's file, in which images have no pixels."""
        of_numbers = ("measured", "predicted", "residual", "aspects")
        left_out = of_numbers if self.is_image else ("bad_pixels",)
        return {name: value for name, value in vars(self).items() if name not in left_out}


@dataclass(frozen=True, repr=False)
class Solution(Result):
    """The solution of an inverse problem.

    Attributes
    ----------
    problem : str
        Name of the problem.
    answers : list of Answer
        The unknowns, those that are sought first.
    covariance : ndarray, shape (N, N)
        Covariance of the values.
    directions : list of Direction
        Pairs of unknowns that the data hardly separate.
    advice : list of Advice
        What further measurements would bring, the most useful first.
    chi_square, chi_square_scatter, degrees_of_freedom, p_value
        See `answers.chi_square`. p_value is None without degrees of freedom, and for a goal.
    render_share : ndarray, shape (N,)
        Part of each variance that comes from the noise of the render.
    data : list of Fitted
    materials : dict
        Estimated materials by name and band, as in the report of a fit.
    remarks : list of str
    renders : int
        Number of renders of each datum.
    converged : bool
    trace : list of Step
        Values that the iteration tried: the length of the step that is left, chi-square, renders
        and paths.
    seconds : float
    """

    problem: str
    answers: list[Answer] = entry()
    covariance: np.ndarray = entry()
    directions: list[Direction]
    advice: list[Advice]
    chi_square: float
    chi_square_scatter: float
    degrees_of_freedom: float
    p_value: float | None
    render_share: np.ndarray = entry()
    data: list[Fitted]
    materials: dict
    remarks: list[str]
    renders: int
    converged: bool
    seconds: float = entry("time_s")
    trace: list[Step] = field(default_factory=list)

    kind = KIND
    heading = "Solution"
    drawn_by = "mi_lcair.show.pictures.solution:figure"

    def __getitem__(self, label: str) -> Answer:
        """The answer for the unknown with this label."""
        by_label = {answer.label: answer for answer in self.answers}
        check_known("unknown of the solution", by_label, label)
        return by_label[label]

    @property
    def correlation(self) -> np.ndarray:
        """Correlations (N, N) of the errors."""
        return correlation(self.covariance)

    def summary(self) -> str:
        """One line with the first unknowns, their standard errors and units."""
        shown = [
            f"{answer.label} = {answer.value:.6g} +- {answer.standard_error:.2g} "
            f"{answer.unit.removesuffix('1')}".rstrip()
            for answer in self.answers[:SHOWN]
        ]
        rest = len(self.answers) - len(shown)
        more = f" and {rest} more" if rest else ""
        return f"solution of {Path(self.problem).name}: {', '.join(shown)}{more} (standard errors)"

    def facts(self) -> Iterator[Any]:
        """The fit, the unknowns, the directions that the data cannot tell apart, and advice."""
        yield "problem", self.problem
        for fitted in self.data:
            state = f", {fitted.state}" if fitted.state else ""
            yield fitted.name, f"{fitted.scene}, {fitted.band}{state}: {fitted.residual_words}"
        if self.p_value is not None:
            yield "chi-square", in_words(*(getattr(self, name) for name in UNTESTED))
        yield "renders", f"{self.renders} of each"
        sought = [answer for answer in self.answers if answer.is_sought]
        facets = [answer for answer in sought if answer.kind == "facet"]
        if summed := len(sought) > MOST_ROWS and facets:
            sought = [answer for answer in sought if answer.kind != "facet"]
        carried = [answer for answer in self.answers if not answer.is_sought]
        columns = ["value", "standard error", "verdict"]
        yield Table(["unknown", *columns], list(map(row, sought)))
        if summed:
            columns_of_facets = ["facets", "number", "temperatures", "standard errors"]
            yield Table(columns_of_facets, list(rows_of_facets(facets)))
        if carried:
            yield Table(["carried along", *columns], list(map(row, carried)))
        for title, sentences in (
            ("the data cannot tell apart", self.directions),
            ("what would help", self.advice),
        ):
            if sentences:
                yield Lines(title, [sentence.words for sentence in sentences[:MOST_LINES]])

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each unknown; value, standard_error, lower and upper are in its `unit`."""
        answers = self.answers
        return {
            "unknown": np.array([answer.label for answer in answers]),
            "unit": np.array([answer.unit for answer in answers]),
            **{
                name: np.array([getattr(answer, name) for answer in answers], float)
                for name in ("value", "standard_error", "lower", "upper")
            },
            "render_share": np.array(self.render_share, float),
            "is_sought": np.array([answer.is_sought for answer in answers]),
            "verdict": np.array([answer.verdict for answer in answers]),
        }

    def entries(self) -> dict:
        """The content of the solution's file."""
        unknowns = [
            vars(answer) | {"render_share": share}
            for answer, share in zip(self.answers, self.render_share)
        ]
        correlation = self.correlation.round(6)
        return super().entries() | {"unknowns": unknowns, "correlation": correlation}

    @classmethod
    def of_entries(cls, entries: dict) -> "Solution":
        """The solution whose file has these entries. The file has no pixels of images."""
        unknowns = entries["unknowns"]
        errors = np.array([unknown["standard_error"] for unknown in unknowns], float)
        more = {
            "answers": unknowns,
            "covariance": np.array(entries["correlation"]) * np.outer(errors, errors),
            "render_share": [unknown["render_share"] for unknown in unknowns],
            "seconds": entries["time_s"],
        }
        return built(cls, entries | more)


def row(answer) -> list[str]:
    """Cells of the table of unknowns."""
    unit = answer.unit.removesuffix("1")
    digits = f"{answer.value:.7g}" if answer.unit == "K" else f"{answer.value:.5g}"
    return [
        answer.label, f"{digits} {unit}".rstrip(), f"{answer.standard_error:.2g}", answer.verdict,
    ]  # fmt: skip


def rows_of_facets(facets):
    """Yield rows that sum up many facets: number, temperatures and errors by verdict."""
    by_verdict = {}
    for answer in facets:
        by_verdict.setdefault(answer.verdict.partition(":")[0], []).append(answer)
    for verdict, answers in by_verdict.items():
        values = [answer.value for answer in answers]
        errors = [answer.standard_error for answer in answers]
        yield [
            verdict,
            len(answers),
            f"{min(values):.5g} to {max(values):.5g} K",
            f"{min(errors):.2g} to {max(errors):.2g} K",
        ]
