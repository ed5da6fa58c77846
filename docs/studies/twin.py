"""Measure how often the intervals of a twin hold the truth, and its forecasts.

    python -m docs.studies.twin [CASE[=DRAWS] ...]

The cases are in `CASES`. What is measured is added to docs/validation/twin/measured.json.
"""

import json
import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np

import mi_lcair
from mi_lcair.files import replacing
from tests.knowing.twin import box_day

MEASURED = Path("docs/validation/twin/measured.json")


def coverage(folder: Path, draw: int) -> dict:
    """The box of five groups with twelve unknowns, and a camera of unknown gain and offsets."""
    problem, truth, _ = box_day.draw(folder, draw)
    began = time.process_time()
    found = mi_lcair.invert(problem, advise=False)
    return judged(found, truth) | {"processor_s": time.process_time() - began}


def judged(found, truth: dict) -> dict:
    """Which intervals hold, which verdicts are wrong, and the distances in standard errors."""
    values = np.array([truth[name] for name in found.names])
    error = np.maximum(found.upper - found.lower, 1e-300) / 3.92
    distance = (found.value - values) / error
    sure = [verdict.startswith("determined") for verdict in found.verdicts]
    return {
        "inside": ((found.lower <= values) & (values <= found.upper)).tolist(),
        "determined": sure,
        "false": [bool(s and abs(d) > 3) for s, d in zip(sure, distance)],
        "distance": distance.round(3).tolist(),
        "p_value": found.p_value,
        "names": found.names,
    }


CASES = {"coverage": (coverage, 200)}


def main() -> None:
    """Measure the cases that are named, or all."""
    wanted = [text.partition("=") for text in sys.argv[1:]] or [(name, "", "") for name in CASES]
    for name, _, count in wanted:
        case, usual = CASES[name]
        content = json.loads(MEASURED.read_text()) if MEASURED.exists() else {}
        done = content.get(name, [])
        for draw in range(len(done), int(count or usual)):
            with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
                warnings.simplefilter("ignore")
                done.append(case(Path(folder), draw))
            print(name, draw, json.dumps(done[-1])[:300], flush=True)
            MEASURED.parent.mkdir(parents=True, exist_ok=True)
            with replacing(MEASURED) as partial:
                partial.write_text(json.dumps(content | {name: done}, indent=None))


if __name__ == "__main__":
    main()
