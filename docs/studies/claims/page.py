"""The page docs/validation/claims.md."""

from collections import Counter
from math import isfinite

from docs.studies.claims.claims import SHARE, Claim
from docs.studies.claims.coverage import Row, defects, is_tolerance, rows
from docs.studies.page import write_page


def line(row: Row) -> str:
    """A row of the page's tables; a tolerance has the shares of large errors."""
    worst = row.worst
    scene = f"{worst.kind}, scene {worst.number} of {worst.seed}"
    error = f"{worst.error:+.2g}, " if isfinite(worst.error) else ""  # of a truth of 0
    where = f"{scene}, {error}{worst.excess:.3g} times"
    cells = [row.name, str(row.claims), str(row.scenes), f"{row.held:.1%}"]
    cells.append(f"{row.lower:.1%} to {row.upper:.1%}")
    if is_tolerance(row.name):
        cells += [f"{share:.2%}" for share in row.beyond]
    return "| " + " | ".join([*cells, where]) + " |"


def by_kind(found: list[Claim]) -> str:
    """Coverage of intervals and share of tolerances that hold, by kind of scene."""
    lines = []
    for kind in sorted({claim.kind for claim in found}):
        own = [claim for claim in found if claim.kind == kind]
        cells = [kind, str(len({(claim.seed, claim.number) for claim in own}))]
        for prefix in ("interval", "tolerance", "channel"):
            part = [claim for claim in own if claim.name.startswith(prefix)]
            held = sum(claim.held for claim in part)
            cells.append(f"{held / len(part):.1%} of {len(part)}" if part else "")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def runs(found: list[Claim]) -> str:
    """The seeds in words, each with its number of scenes."""
    scenes = sorted({(claim.seed, claim.number) for claim in found})
    counts = Counter(seed for seed, _ in scenes)
    return ", ".join(f"{count} scenes of seed {seed}" for seed, count in counts.items())


def of_repeats(repeated: list[Claim]) -> dict[str, str]:
    """The page's fields on runs with repeats: their size, the tolerances and the intervals."""
    scenes = {(claim.seed, claim.number) for claim in repeated}
    by_name = {row.name: row for row in rows(repeated)}
    stopped, intervals = by_name.get("interval, stopped"), "none"
    if stopped is not None:
        limits = f"{stopped.lower:.1%} to {stopped.upper:.1%}"
        intervals = f"{stopped.held:.1%} of {stopped.claims} ({limits})"
    reached = [line(row) for row in by_name.values() if is_tolerance(row.name)]
    return {
        "repeated_runs": f"{len(scenes)} scenes: {runs(repeated)}",
        "repeated_intervals": intervals,
        "repeated": "\n".join(reached),
    }


def write(path: str, found: list[Claim], repeated: list[Claim], paired: list[Claim]) -> None:
    """Write the page from claims. repeated: those of runs with repeats. paired: those of pairs."""
    all_rows = rows(found)
    tolerances = [row for row in all_rows if is_tolerance(row.name)]
    intervals = [row for row in all_rows if not is_tolerance(row.name)]
    worst = max((row.worst for row in tolerances), key=lambda claim: claim.excess, default=None)
    failed = defects([*found, *repeated, *paired], by_kind=False)
    listed = [f"- {name}: {text}." for (name, _), text in sorted(failed.items())]
    write_page(
        path,
        "claims",
        scenes=len({(claim.seed, claim.number) for claim in found}),
        runs=runs(found),
        claims=len(found),
        share=f"{SHARE:.0%}",
        intervals="\n".join(map(line, intervals)),
        tolerances="\n".join(map(line, tolerances)),
        kinds=by_kind(found),
        **of_repeats(repeated),
        pairs="\n".join(map(line, rows(paired))),
        paired_runs=runs(paired),
        worst="" if worst is None else f"scene {worst.number} of seed {worst.seed}, {worst.kind}",
        worst_excess=0 if worst is None else worst.excess,
        defects="\n".join(listed) or "None.",
    )
