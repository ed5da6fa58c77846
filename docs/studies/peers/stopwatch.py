"""Time one script of this folder, in any environment, and print its numbers as JSON.

    PYTHON stopwatch.py SCRIPT CASE SEEDS EFFORT [EFFORT ...]

It imports nothing but the standard library, because each tool has its own environment. A script has
a function run(case, effort, seed), which returns a value and its standard error or None by name.
Times are of the processor, with all threads and child processes [s].
"""

import importlib
import json
import os
import sys
from statistics import median
from time import process_time


def processor_time() -> float:
    """Processor time of this process and of its children since their start [s]."""
    return process_time() + sum(os.times()[2:4])


def main(script: str, case: str, seeds: str, *efforts: str) -> None:
    """Print the time of the first call, from the start of Python, and the runs."""
    run = importlib.import_module(script).run
    run(case, int(efforts[0]), 1)
    first, runs = processor_time(), []
    for effort in map(int, efforts):
        run(case, effort, 1)  # what depends on the size is prepared
        results, times = [], []
        for seed in range(1, int(seeds) + 1):
            began = process_time()
            results.append(run(case, effort, 100 * seed))  # neighbouring seeds may share numbers
            times.append(process_time() - began)
        runs.append({"effort": effort, "seconds": median(times), "results": results})
    print(json.dumps({"first": first, "runs": runs}))


if __name__ == "__main__":
    main(*sys.argv[1:])
