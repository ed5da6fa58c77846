"""Sections of the solution of an inverse problem."""

from mi_lcair.inversion.answers import UNTESTED, in_words
from mi_lcair.results.sections import Facts, Lines, Remarks, Section, Table

MOST_ROWS = 40  # unknowns in the table; of more, the facets are summed up
MOST_LINES = 5  # sentences of advice


def sections(solution) -> list[Section]:
    """The fit, the unknowns, the directions that the data cannot tell apart, and advice."""
    sought = [answer for answer in solution.answers if answer.is_sought]
    facets = [answer for answer in sought if answer.kind == "facet"]
    if summed := len(sought) > MOST_ROWS and facets:
        sought = [answer for answer in sought if answer.kind != "facet"]
    carried = [answer for answer in solution.answers if not answer.is_sought]
    columns = ["value", "standard error"]
    parts = [Facts(data(solution)), Table(["unknown", *columns, "verdict"], list(map(row, sought)))]
    if summed:
        columns_of_facets = ["facets", "number", "temperatures", "standard errors"]
        parts.append(Table(columns_of_facets, list(rows_of_facets(facets))))
    if carried:
        parts.append(Table(["carried along", *columns, "verdict"], list(map(row, carried))))
    for title, sentences in (
        ("the data cannot tell apart", solution.directions),
        ("what would help", solution.advice),
    ):
        if sentences:
            parts.append(Lines(title, [sentence.words for sentence in sentences[:MOST_LINES]]))
    return [Section("Solution", [*parts, Remarks(solution.remarks)])]


def data(solution) -> list[tuple[str, str]]:
    """Rows about the problem, how well each datum is fitted, and chi-square."""
    rows = [("problem", solution.problem)]
    for fitted in solution.data:
        state = f", {fitted.state}" if fitted.state else ""
        rows.append((fitted.name, f"{fitted.scene}, {fitted.band}{state}: {residual(fitted)}"))
    if solution.p_value is not None:
        rows.append(("chi-square", in_words(*(getattr(solution, name) for name in UNTESTED))))
    return [*rows, ("renders", f"{solution.renders} of each")]


def residual(fitted) -> str:
    """How well a datum is fitted, in words."""
    rms, size = fitted.residual_rms_sigmas, fitted.size
    count = f"{fitted.points} of {size} values" if fitted.points < size else f"{size} values"
    return f"{count}, rms residual {rms:.3g} standard deviations of measurement and render together"


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
