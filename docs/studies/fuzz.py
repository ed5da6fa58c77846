"""Run a long fuzz of every kind of input file.

    python -m docs.studies.fuzz [MUTANTS] [SEED] [KIND...]

MUTANTS is their number for each kind of file, 1000 by default. The default SEED is 0, and without
KIND all kinds are run. The script prints the outcomes of each kind. It keeps every mutant that was
handled wrongly in fuzz_failures/.
"""

import sys
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.fuzz.kinds import KINDS
from tests.fuzz.mutants import Worker, campaign

FAILURES = Path("fuzz_failures")


def main(count: int = 1000, seed: int = 0, chosen: tuple[str, ...] = ()) -> int:
    """Run the campaigns and return the number of mutants that were handled wrongly."""
    wrong = 0
    for kind in KINDS:
        if chosen and kind.name not in chosen:
            continue
        outcomes = Counter()
        with TemporaryDirectory() as folder, Worker() as worker:
            for number, (content, verdict) in enumerate(
                campaign(kind, Path(folder), count, seed, worker)
            ):
                outcomes[verdict.outcome] += 1
                if not verdict.is_right:
                    FAILURES.mkdir(exist_ok=True)
                    kept = FAILURES / f"{kind.name}_{seed}_{number}{kind.suffix}"
                    kept.write_bytes(content)
                    print(f"{kept}: {verdict.outcome}: {verdict.message[:300]}", flush=True)
        wrong += outcomes.total() - outcomes["accepted"] - outcomes["refused"]
        print(f"{kind.name}: {dict(outcomes)}", flush=True)
    return wrong


if __name__ == "__main__":
    numbers = [int(word) for word in sys.argv[1:3]]
    sys.exit(min(1, main(*numbers, chosen=tuple(sys.argv[3:]))))
