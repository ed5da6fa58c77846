"""Measure what workers cost: processor time, time and bytes sent, for one process and for workers.

    python -m docs.studies.workers [ROUNDS]

A sweep, an image and the draws of a budget are done in this process with all its threads, and by 1,
2 and 4 processes. All give the same numbers. The rounds alternate between them, and the script
writes docs/validation/workers.md. It takes about a minute a round on two idle cores.
"""

import os
import pickle
import resource
import sys
import time
from pathlib import Path
from statistics import median

import drjit
import numpy as np

import mi_lcair
from docs.studies.page import write_page
from mi_lcair.startup import tasks

PAGE = Path("docs/validation/workers.md")
COUNTS = (0, 2, 1, 4)  # workers; 0 is this process alone
GIGABIT = 125e6  # bytes a second of the network on paper
SCHEDULER_S = 1e-3  # time of Dask's scheduler for a task, as its manual says, s
MANY = 100  # workers on paper
SIGMA = {"sigma": {"diffuse.emissivity": 0.01}}


def sweep():
    conditions = {"azimuth_deg": np.arange(0, 360, 0.5).tolist()}
    base = {"scene": "cylinder_ir_range"}
    sampling = {"spp": 4, "resolution": 32}
    made = mi_lcair.sweep({"base": base, "conditions": conditions, "sampling": sampling})
    return made.table["intensity_W_sr"]


def image():
    scene = mi_lcair.load("cylinder_ir_range", resolution=128)
    return mi_lcair.render(scene, spp=256).channels["Y"]


def draws():
    scene = mi_lcair.load("two_plates", resolution=64)
    return mi_lcair.budget(scene, SIGMA, spp=16, draws=16).monte_carlo.results


WORK = {"sweep": sweep, "image": image, "draws of a budget": draws}


def processor_s() -> float:
    """Processor time of this process so far, s."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def of_workers() -> float:
    """Processor time of all workers so far, s."""
    return sum(tasks.PRESENT.get().connected().run(processor_s).values())


def run(work, count: int) -> tuple[float, float, float]:
    """Time, and processor time of this process and of the workers, s, of one run."""
    before = of_workers() if count else 0.0
    own, start = processor_s(), time.perf_counter()
    work()
    seconds, own = time.perf_counter() - start, processor_s() - own
    return seconds, own, of_workers() - before if count else 0.0


def sizes(work) -> tuple[int, float, float]:
    """Number of tasks of some work, and the mean bytes of a task and of its result."""
    sent, computed = [], tasks.Cluster.computed

    def counted(cluster, some):
        import cloudpickle

        for number, result in computed(cluster, some):
            sent.append((len(cloudpickle.dumps(some[number])), len(pickle.dumps(result))))
            yield number, result

    tasks.Cluster.computed = counted
    try:
        work()
    finally:
        tasks.Cluster.computed = computed
    return len(sent), *np.mean(sent, axis=0).tolist()


def on_paper(task_s: float, own_s: float, sent: float) -> float:
    """Efficiency of MANY workers with many tasks each.

    task_s: processor time of a task on a worker. own_s: that of the sending process for a task.
    sent: bytes of a task and its result. The slowest of workers, sender, scheduler and network
    decides.
    """
    return task_s / MANY / max(task_s / MANY, own_s, SCHEDULER_S, sent / GIGABIT)


def main(rounds: int = 3) -> None:
    times = {(name, count): [] for name in WORK for count in COUNTS}
    size = {}
    for _ in range(rounds):
        for count in COUNTS:
            with mi_lcair.workers(count or None):
                for name, work in WORK.items():
                    if not times[name, count]:
                        size[name] = sizes(work) if count else run(work, count)  # compiles
                    times[name, count].append(run(work, count))
                    print(name, count, times[name, count][-1], flush=True)
    rows, paper = [], []
    for name in WORK:
        here = times[name, 0]
        for count in sorted(COUNTS):
            runs = times[name, count]
            walls = [a[0] / b[0] for a, b in zip(here, runs)]
            work = [(a[1] + a[2]) / (b[1] + b[2]) for a, b in zip(here, runs)]
            rows.append(
                f"| {name} | {count or 'this process'} | {median(r[0] for r in runs):.3g} | "
                f"{median(r[1] for r in runs):.3g} | {median(r[2] for r in runs):.3g} | "
                f"{median(work):.2f} | {median(walls):.2f} |"
            )
        number, task, result = size[name]
        own, far = (median(r[k] for r in times[name, 2]) / number for k in (1, 2))
        paper.append(
            f"| {name} | {number} | {task / 1e3:.3g} | {result / 1e3:.3g} | {far:.3g} | "
            f"{own:.3g} | {on_paper(far, own, task + result):.2f} |"
        )
    write_page(
        PAGE,
        "workers",
        rows="\n".join(rows),
        paper="\n".join(paper),
        rounds=rounds,
        cores=os.cpu_count(),
        threads=drjit.thread_count(),
        load=f"{os.getloadavg()[2]:.0f}",
        many=MANY,
    )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
