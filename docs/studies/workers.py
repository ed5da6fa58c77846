"""Measure what workers cost, and whether sweeps that are killed end with the same bytes.

    python -m docs.studies.workers [ROUNDS [KILLS]]

A sweep, an image and the draws of a budget are done in turn by this process with all its threads
and by 2, 1 and 4 processes. Sweeps are killed, and so is one of three workers. The script writes
docs/validation/workers.md. With 3 rounds, and 20 sweeps that are killed, it takes five minutes
on two idle cores.
"""

import os
import pickle
import random
import resource
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from threading import Timer

import drjit
import numpy as np

import mi_lcair
from docs.studies.page import write_page
from mi_lcair import tasks

PAGE = Path("docs/validation/workers.md")
COUNTS = (2, 1, 4)  # workers
GIGABIT = 125e6  # bytes a second of the network on paper
SCHEDULER_S = 1e-3  # time of Dask's scheduler for a task, as its manual says, s
MANY = 100  # workers on paper
SIGMA = {"sigma": {"diffuse.emissivity": 0.01}}
KILLS = 20


def sweep(views: int = 1280) -> None:
    conditions = {"azimuth_deg": np.linspace(0, 360, views, endpoint=False).tolist()}
    base = {"scene": "cylinder_ir_range"}
    sampling = {"spp": 4, "resolution": 32}
    mi_lcair.sweep({"base": base, "conditions": conditions, "sampling": sampling})


def image(spp: int = 512) -> None:
    mi_lcair.render("cylinder_ir_range", spp=spp, parameters={"resolution": 128})


def draws(count: int = 48) -> None:
    scene = mi_lcair.load("two_plates", resolution=64)
    mi_lcair.budget(scene, SIGMA, spp=64, draws=count)


# What is measured, and a small part of it that compiles its kernels
WORK = {"sweep": (sweep, 512), "image": (image, 128), "draws of a budget": (draws, 16)}


def processor_s() -> float:
    """Processor time of this process so far, s."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def of_workers() -> float:
    """Processor time of all workers so far, s."""
    return sum(tasks.PRESENT.get().connected().run(processor_s).values())


def run(work, on_workers: bool) -> tuple[float, float, float]:
    """Time, and processor time of this process and of the workers, s, of one run."""
    before = of_workers() if on_workers else 0.0
    own, start = processor_s(), time.perf_counter()
    work()
    seconds, own = time.perf_counter() - start, processor_s() - own
    return seconds, own, of_workers() - before if on_workers else 0.0


@contextmanager
def alone():
    """Context manager in which tasks run in this process although there are workers."""
    token = tasks.PRESENT.set(None)
    try:
        yield
    finally:
        tasks.PRESENT.reset(token)


def sizes(work) -> tuple[int, float, float]:
    """Number of tasks of some work, and the mean bytes of a task and of its result."""
    import cloudpickle

    sent, computed = [], tasks.Cluster.computed

    def counted(cluster, some):
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


def measured(count: int, rounds: int) -> dict[str, list]:
    """Pairs of runs in this process and on workers, by the name of the work."""
    pairs = {name: [] for name in WORK}
    with mi_lcair.workers(count):
        for work, part in WORK.values():
            work(part)
            with alone():
                work(part)
        for _ in range(rounds):
            for name, (work, _) in WORK.items():
                with alone():
                    here = run(work, False)
                pairs[name].append((here, run(work, True)))
                print(count, name, *pairs[name][-1], flush=True)
    return pairs


def row(name: str, count: int, pairs: list) -> str:
    """The row of a table: medians of times and of efficiencies, and the range of the latter."""
    here, there = (np.median(runs, axis=0) for runs in zip(*pairs))
    efficiencies = (
        [(a[1] + a[2]) / (b[1] + b[2]) for a, b in pairs],
        [a[0] / b[0] for a, b in pairs],
    )
    cells = [f"{median(e):.2f} ({min(e):.2f} to {max(e):.2f})" for e in efficiencies]
    times = f"{here[0]:.3g} | {there[0]:.3g} | {here[1]:.3g} | {there[1]:.3g} | {there[2]:.3g}"
    return f"| {name} | {count} | {times} | {cells[0]} | {cells[1]} |"


SWEEP = """[base]
scene = "cylinder_ir_range"
[conditions]
azimuth_deg = { from = 0, to = 359.9, step = 0.1 }
[sampling]
spp = 1
resolution = 8
"""


def made(folder: Path) -> bytes:
    """The table of SWEEP, of which a folder may hold effective areas already."""
    path = folder.with_suffix(".nc")
    mi_lcair.sweep(folder.with_name("sweep.toml"), areas=folder).save(path)
    return path.read_bytes()


def killed(kills: int, seed: int = 1) -> tuple[int, int]:
    """Numbers of sweeps that ended with the bytes of one that was not killed, and that had begun.

    Each is killed once, at a random moment, and goes on.
    """
    same, begun, moments = 0, 0, random.Random(seed)
    with TemporaryDirectory() as name:
        conditions = Path(name) / "sweep.toml"
        conditions.write_text(SWEEP)

        def command(folder):
            code = f"from docs.studies.workers import made, Path; made(Path({str(folder)!r}))"
            return [sys.executable, "-c", code]

        start = time.perf_counter()
        subprocess.run(command(Path(name) / "whole"), check=True)
        seconds = time.perf_counter() - start
        whole = conditions.with_name("whole.nc").read_bytes()
        for number in range(kills):
            folder = Path(name) / f"killed{number}"
            with subprocess.Popen(command(folder)) as process:
                time.sleep(moments.uniform(0.3, 1) * seconds)
                process.send_signal(signal.SIGKILL)
            begun += folder.exists()
            same += made(folder) == whole
    return same, begun


def with_a_dead_worker(rounds: int, seed: int = 2) -> int:
    """Number of sweeps with the bytes of one in this process, though one of 3 workers is killed."""
    same, moments = 0, random.Random(seed)
    with TemporaryDirectory() as name:
        conditions = Path(name) / "sweep.toml"
        conditions.write_text(SWEEP)
        whole = made(Path(name) / "whole")
        for number in range(rounds):
            with mi_lcair.workers(3):
                pids = tasks.PRESENT.get().connected().run(os.getpid)
                pid = moments.choice(list(pids.values()))
                Timer(moments.uniform(0, 3), os.kill, (pid, signal.SIGKILL)).start()
                same += made(Path(name) / f"dead{number}") == whole
    return same


def main(rounds: int = 3, kills: int = KILLS) -> None:
    same, begun = killed(kills)
    print(f"{same} of {kills} killed sweeps with the same bytes, {begun} had begun", flush=True)
    same_of_three = with_a_dead_worker(rounds)
    print(f"{same_of_three} of {rounds} with a dead worker", flush=True)
    size = {}
    with mi_lcair.workers(2):
        for name, (work, _) in WORK.items():
            size[name] = sizes(work)
    pairs = {count: measured(count, rounds) for count in COUNTS}
    rows = [row(name, count, pairs[count][name]) for name in WORK for count in sorted(COUNTS)]
    paper = []
    for name in WORK:
        number, task, result = size[name]
        own, far = (median(there[k] for _, there in pairs[2][name]) / number for k in (1, 2))
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
        counts=", ".join(map(str, sorted(COUNTS))),
        cores=os.cpu_count(),
        threads=drjit.thread_count(),
        load=f"{os.getloadavg()[2]:.1f}",
        many=MANY,
        kills=kills,
        same=same,
        begun=begun,
        same_of_three=same_of_three,
    )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
