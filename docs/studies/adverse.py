"""Is "tolerance reached" true where few paths meet what matters? The page
docs/validation/adverse.md; every number on it is computed here.

    python -m docs.studies.adverse [PAGE]

Each of the scenes of tests/stability/adverse_scenes.py is rendered to a tolerance SEEDS times, with
and without emitter sampling, and planned and carried out as often. Takes about half an hour.
"""

import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from tqdm import tqdm

import mi_lcair
from docs.studies.page import write_page
from mi_lcair.errors import InputError
from mi_lcair.rendering.scene import Scene
from tests.stability.adverse_scenes import ADVERSE, Adverse

SEEDS, TOLERANCE, MAX_SPP, PLAN_TOLERANCE = 20, 0.5, 2**15, 0.1
STANDARD_ERRORS = 3  # how far a mean may lie from the truth


@dataclass(frozen=True)
class Outcome:
    """One render: whether the tolerance was reached, the error of its mean as a fraction of the
    truth, that error over the stated one, and samples per pixel.
    """

    reached: bool
    error: float
    deviation: float
    spp: int

    @property
    def is_wrong(self) -> bool:
        return self.reached and abs(self.deviation) > STANDARD_ERRORS


def rendered(adverse: Adverse, scene: Scene, tolerance: float, max_spp: int, seed: int) -> Outcome:
    result = mi_lcair.render(scene, tolerance=tolerance, max_spp=max_spp, seed=seed, split=None)
    pixels = result.channels["Y"].size
    stated = np.hypot(
        result.rms_error * result.mean / np.sqrt(pixels), adverse.error * adverse.mean
    )
    difference = result.mean - adverse.mean
    return Outcome(result.reached, difference / adverse.mean, difference / stated, result.spp)


def planned(adverse: Adverse, scene: Scene, tolerance: float, seed: int) -> bool | None:
    """Whether a plan, carried out with another seed, is within its tolerance; None if it was
    refused, or if the render did not reach the rest of the tolerance.
    """
    try:
        found = mi_lcair.plan(scene, tolerance, seed=seed)
    except InputError:
        return None
    with found.applied(scene):
        result = mi_lcair.signature(scene, tolerance=found.noise_tolerance, seed=1000 + seed)
    if not result.reached:
        return None
    mean = result.target.intensity / result.window_area
    return abs(mean / adverse.mean - 1) <= tolerance + adverse.error


def row(name: str, emitter_sampling: bool) -> tuple[str, int, int]:
    adverse = ADVERSE[name]
    with TemporaryDirectory() as folder:
        scene = adverse.load(Path(folder), emitter_sampling)
        renders = [rendered(adverse, scene, TOLERANCE, MAX_SPP, seed) for seed in range(SEEDS)]
        plans = [planned(adverse, scene, PLAN_TOLERANCE, seed) for seed in range(SEEDS)]
    reached = [outcome for outcome in renders if outcome.reached]
    wrong = sum(outcome.is_wrong for outcome in renders)
    largest = max((abs(outcome.error) for outcome in reached), default=None)
    refused, inside = plans.count(None), plans.count(True)
    text = (
        f"| {name} | {'on' if emitter_sampling else 'off'} | {len(reached)} | {wrong} | "
        f"{'' if largest is None else f'{largest:.2%}'} | "
        f"{np.median([outcome.spp for outcome in renders]):.0f} | {SEEDS} | {refused} | {inside} |"
    )
    return text, wrong, SEEDS - refused - inside


def main(page):
    rows = []
    for name in tqdm(ADVERSE):
        for emitter_sampling in (False, True):
            rows.append(row(name, emitter_sampling))
            print(rows[-1][0], flush=True)
    verdict = (
        f"The most wrong claims in a row: {max(wrong for _, wrong, _ in rows)} of {SEEDS}. "
        "The most plans outside their tolerance: "
        f"{max(outside for *_, outside in rows)} of {SEEDS}."
    )
    write_page(
        page,
        "adverse",
        seeds=SEEDS,
        tolerance=TOLERANCE,
        max_spp=MAX_SPP,
        errors=STANDARD_ERRORS,
        plan=PLAN_TOLERANCE,
        rows="\n".join(text for text, *_ in rows),
        verdict=verdict,
    )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/validation/adverse.md"))
