"""The README's render, signature, trend, fit and derivative on a GPU, compared with the processor.

Run from the root of the repository: python -m benchmarks.gpu [REPORT.md]

The GPU is one of Apple on macOS (metal_ad_mono), and else one of NVIDIA (cuda_ad_mono). The report
begins with the machine and the versions, so that it can be sent as it is.

Each variant of Mitsuba runs in a process of its own. The table has the numbers of both, how far
they are apart, and the times of a second run, after the compile. Both variants have the same random
numbers, so that their results differ by rounding only. A fit and the tables of reflection models
are computed on the processor in any variant. A task that fails in a variant says why in its row.
"""

import json
import platform
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np

import mi_lcair
from benchmarks.timing import seconds
from mi_lcair.files import replacing

PROCESSOR = "llvm_ad_mono"
GPU = "metal_ad_mono" if sys.platform == "darwin" else "cuda_ad_mono"
SCENE, PARAMETERS = "cylinder_ir_range", ["self.temperature", "bare_aluminum.e"]
AZIMUTHS, STARTS = range(0, 360, 30), 8
PAINT = Path(__file__).parents[1] / "scenes" / "examples" / "paint.csv"
NO_GPU = f"no GPU here: {GPU} cannot start; nothing was run"


def tasks(size: int) -> dict:
    """Functions of a seed that return (values, standard errors), by name.

    size: pixels along a side of the image. The numbers of paths follow from it.
    """
    scene = mi_lcair.load(SCENE, resolution=size)
    paths = 64 * size**2

    def render(seed):
        result = mi_lcair.render(scene, spp=64, seed=seed)
        return [result.mean], [result.mean_error]

    def signature(seed):
        target = mi_lcair.signature(scene, spp=64, seed=seed).target
        return [target.intensity], [target.standard_error]

    def trend(seed):
        result = mi_lcair.trend(scene, AZIMUTHS, spp=64, seed=seed)
        columns = result.columns()
        return columns["intensity_W_sr"], columns["standard_error_W_sr"]

    def fit(seed):
        result = mi_lcair.fit(PAINT, model="microfacet", starts=STARTS, seed=seed)
        return list(result.parameters.values()), list(result.standard_error.values())

    def derivative(seed):
        result = mi_lcair.sensitivities(scene, PARAMETERS, paths=paths, seed=seed)
        return result.derivative, result.error[1:]

    return {task.__name__: task for task in (render, signature, trend, fit, derivative)}


def run(variant: str, size: int) -> dict[str, dict]:
    """Values, errors and times [s] of the tasks in a variant, or what went wrong, by name."""
    import mitsuba

    mitsuba.set_variant(variant)
    results = {}
    for name, task in tasks(size).items():
        try:
            # The first run compiles
            values, errors = (np.array(part, dtype=float).tolist() for part in task(1))
            time = seconds(task, 1)
            results[name] = {"values": values, "errors": errors, "seconds": time}
        except Exception as error:  # the row of the table says it
            results[name] = {"failed": f"{type(error).__name__}: {error}".splitlines()[0]}
    return results


def row(name: str, processor: dict, gpu: dict) -> str:
    """A task's row of the table."""
    failed = [
        f"{variant}: {result['failed']}"
        for variant, result in ((PROCESSOR, processor), (GPU, gpu))
        if "failed" in result
    ]
    if failed:
        return f"| {name} | {'; '.join(failed)} | | | | | |"
    one, two, errors = (
        np.array(values) for values in (processor["values"], gpu["values"], processor["errors"])
    )
    apart = np.max(np.abs(two - one) / np.maximum(np.abs(one), 1e-30))
    in_errors = np.max(np.abs(two - one) / np.maximum(errors, 1e-30))
    times = processor["seconds"], gpu["seconds"]
    cells = [f"{one[0]:.6g}", f"{apart:.1e}", f"{in_errors:.2g}"]
    cells += [f"{1e3 * time:.0f} ms" for time in times] + [f"{times[0] / times[1]:.1f}"]
    return f"| {name} | {' | '.join(cells)} |"


def table(processor: dict, gpu: dict) -> str:
    """The table as Markdown."""
    head = (
        "| task | first value | largest relative difference | in standard errors | processor | GPU "
        "| ratio |\n|---|---|---|---|---|---|---|"
    )
    return "\n".join([head, *(row(name, processor[name], gpu[name]) for name in processor)]) + "\n"


def machine() -> str:
    """The machine and the versions, in a line."""
    packages = ("mi_lcair", "mitsuba", "drjit", "numpy")
    versions = ", ".join(f"{package} {version(package)}" for package in packages)
    return f"{GPU} on {platform.platform()}, Python {platform.python_version()}, {versions}\n\n"


def measured(variant: str, size: int) -> dict:
    """`run` in a process of its own; its exceptions end this one, too."""
    command = [sys.executable, "-m", "benchmarks.gpu", variant, str(size)]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    return json.loads(done.stdout.splitlines()[-1])


def main(arguments: list[str]) -> None:
    """Print the report, or write it to a file."""
    import mitsuba

    if arguments and arguments[0] in (PROCESSOR, GPU):
        print(json.dumps(run(arguments[0], int(arguments[1]))))
        return
    try:
        mitsuba.set_variant(GPU)
    except ImportError:
        sys.exit(NO_GPU)
    text = machine() + table(*(measured(variant, 64) for variant in (PROCESSOR, GPU)))
    if arguments:
        with replacing(arguments[0]) as partial:
            partial.write_text(text, encoding="utf-8")
    print(text, end="")


if __name__ == "__main__":
    main(sys.argv[1:])
