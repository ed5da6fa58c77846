"""Uncertainty budgets of the landing scenario, and budgets against their own Monte Carlo.

    python -m docs.studies.budget [PAGE]

The script writes docs/validation/budget.md from budget.template.md, and its pictures. It takes
about twenty minutes.
"""

import sys
import tomllib
from pathlib import Path

import numpy as np

import mi_lcair
from docs.studies.page import label, write_page
from mi_lcair.api.scenes import parameters
from mi_lcair.detection.scenario import Scenario
from mi_lcair.estimate import in_unit
from mi_lcair.knowing.budgets.budget import Budget

STATED = Path(__file__).parents[1] / "validation" / "budget" / "landing.toml"
LANDING = Path(__file__).parents[1] / "validation" / "landing.md"
CASES = [(position, band) for position in (1, 2, 3) for band in ("MWIR", "LWIR")]
RESOLUTION = 128  # the budgets trace 64 paths for each of 128 x 128 pixels
DRAWN = [(3, "MWIR"), (3, "LWIR")]  # cases with a tornado chart
# Rows of docs/validation/landing.md that change one quantity of a budget, and the change
BY_HAND = {
    "skin 310 K instead of 300 K": ("self.temperature", 10),
    "exhaust plumes 550 K instead of 500 K": ("plume.temperature", 50),
    "turbines 850 K instead of 800 K": ("hot_parts.temperature", 50),
    "terrain 292.5 K instead of 302.5 K": ("terrain.temperature", -10),
}
DRAWS = 200
# Scenes whose budget is compared with a Monte Carlo: parameters, and the material of the target
COMPARED = [
    ("cylinder_ir_range", {"finish": "gloss_black", "band": "LWIR"}, "gloss_black"),
    ("cylinder_ir_range", {"finish": "bare_aluminum", "band": "MWIR"}, "bare_aluminum"),
    ("a340_landing", {"position": 3, "band": "LWIR"}, "bare_aluminum"),
    ("a340_landing", {"position": 1, "band": "MWIR"}, "bare_aluminum"),
]
OF_MATERIALS = {
    "gloss_black": {"epsilon": 0.01, "rho_d": 0.0001, "b": 0.015, "e": 0.0005},
    "bare_aluminum": {"epsilon": 0.015, "rho_d": 0.005, "b": 0.015, "e": 0.0005},
}
OF_AIRLINER = {
    "self.temperature": 2.0,
    "plume.temperature": 15.0,
    "hot_parts.temperature": 20.0,
    "terrain.temperature": 3.0,
    "sky.radiance": "10 %",
}


# Results whose contrast may change its sign, which are compared with draws
SIGNED = [(position, of) for position in (2, 3) for of in ("snr", "detection_range")]
SIGNED_DRAWS, NEI = 1000, 2e-4  # NEI in W m^-2, with which the airliner is detected at 1 km


def scenario(position: int, band: str, **more) -> Scenario:
    own = {"sensor.band": band, "render.resolution": RESOLUTION, "render.max_bounces": "[4]"}
    return Scenario.read(f"a340_landing/position_{position}", **own | more)


def shares(budgets: dict[tuple, Budget]) -> str:
    """The rows of the table of shares: quantities by their largest share, and the totals."""
    by_case = {
        case: {row.quantity: row.share for row in budget.rows} for case, budget in budgets.items()
    }
    names = sorted(
        next(iter(by_case.values())),
        key=lambda name: -max(found[name] for found in by_case.values()),
    )
    percent = lambda share: f"{100 * share:.2g} %" if share >= 5e-4 else "-"
    lines = [
        f"| {name} | " + " | ".join(percent(found[name]) for found in by_case.values()) + " |"
        for name in names
    ]
    relative = [f"{100 * b.sigma / abs(b.value):.2g} %" for b in budgets.values()]
    return "\n".join([*lines, "| **standard uncertainty** | " + " | ".join(relative) + " |"])


def by_hand() -> dict[str, list[str]]:
    """The changes in the table of the page `landing`, by assumption, in the order of CASES."""
    rows = [line.strip("| \n").split(" | ") for line in LANDING.read_text().splitlines()]
    return {cells[0].strip(): cells[1:] for cells in rows if cells[0].strip() in BY_HAND}


def beside_by_hand(budgets: dict[tuple, Budget]) -> str:
    """Rows: change of the contrast on the page `landing`, and that by a budget's derivative."""
    found, lines = by_hand(), []
    for name, (quantity, change) in BY_HAND.items():
        cells = []
        for case, stated in zip(CASES, found[name], strict=True):
            budget = budgets[case]
            row = next(row for row in budget.rows if row.quantity == quantity)
            linear = row.sensitivity * change / budget.value
            cells.append(f"{stated.strip()} ({100 * linear:+.2g} %)")
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def failures(budgets: dict[tuple, Budget]) -> str:
    """The checks that failed, one line each."""
    lines = [
        f"- position {position}, {band}: {check.sentence(budget.unit)}."
        for (position, band), budget in budgets.items()
        for check in budget.checks
        if not check.holds
    ]
    return "\n".join(lines) or "- none."


def largest(budget: Budget) -> str:
    """The three largest rows of a budget."""
    return ", ".join(f"{row.quantity} ({100 * row.share:.2g} %)" for row in budget.rows[:3])


def compared() -> str:
    """Rows: budgets against their own Monte Carlo."""
    lines = []
    for name, own, material in COMPARED:
        scene = mi_lcair.load(name, resolution=64, **own)
        sigma = {f"{material}.{key}": value for key, value in OF_MATERIALS[material].items()}
        if name == "a340_landing":
            sigma |= OF_AIRLINER
        else:
            sigma |= {key: 1.5 for key in parameters(scene) if key.startswith("self@")}
            sigma |= {"walls.temperature": 1.0}
        plain = mi_lcair.budget(scene, {"sigma": sigma})
        drawn = mi_lcair.budget(scene, {"sigma": sigma}, draws=DRAWS).monte_carlo
        linear = plain.sigma_of_quantities
        total = sum(row.share for row in plain.rows)
        lines.append(
            f"| {label(name, own)} | {len(sigma)} | {plain.value:.5g} | {linear:.4g} | "
            f"{drawn.sigma:.4g} ± {drawn.sigma_error:.2g} | "
            f"{100 * (linear / drawn.sigma - 1):+.1f} % | {100 * total:.6g} % | "
            f"{plain.renders} | {drawn.outside} |"
        )
    return "\n".join(lines)


def signed() -> str:
    """Rows: results whose contrast may change its sign, by the second order and by draws."""
    stated = tomllib.loads(STATED.read_text(encoding="utf-8"))
    # Draws of a material would be rendered
    stated["sigma"] = {k: v for k, v in stated["sigma"].items() if "aluminum" not in k}
    lines = []
    for position, of in SIGNED:
        what = scenario(position, "LWIR", **{"sensor.nei": NEI, "render.resolution": 32})
        found = mi_lcair.budget(what, stated, of=of, draws=SIGNED_DRAWS)
        curved, drawn = found.second_order, found.monte_carlo.results
        (low, high), ends = curved.interval, np.quantile(drawn, (0.025, 0.975))
        inside = np.mean((drawn >= low) & (drawn <= high))
        value = in_unit(f"{found.value:.4g}", found.unit)
        lines.append(
            f"| {position} | {of} | {value} | {curved.sigma:.3g} | {drawn.std():.3g} | "
            f"{low:.4g} to {high:.4g} | {ends[0]:.4g} to {ends[1]:.4g} | "
            f"{100 * inside:.1f} % | {100 * curved.other_sign:.1f} % |"
        )
    return "\n".join(lines)


def main(page: Path) -> None:
    """Write the page and its pictures."""
    folder = page.with_suffix("")
    folder.mkdir(parents=True, exist_ok=True)
    budgets = {}
    for case in CASES:
        budgets[case] = mi_lcair.budget(scenario(*case), STATED)
        if case in DRAWN:
            budgets[case].plot(folder / "position_{}_{}.png".format(*case))
    write_page(
        page,
        "budget",
        resolution=str(RESOLUTION),
        shares=shares(budgets),
        largest="\n".join(
            f"- position {position}, {band}: {largest(budget)}."
            for (position, band), budget in budgets.items()
        ),
        by_hand=beside_by_hand(budgets),
        failures=failures(budgets),
        draws=str(DRAWS),
        compared=compared(),
        signed_draws=f"{SIGNED_DRAWS:,}",
        nei=f"{NEI:g}",
        signed=signed(),
    )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/validation/budget.md"))
