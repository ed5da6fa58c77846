"""Write the page docs/validation/plan.md: whether plans keep their tolerance and whether they save
time.

    python -m docs.studies.plan [PAGE]

Every number on the page is computed here. For each bundled scene there are REPETITIONS plans for
the intensity, with all simplifications tried, and as many that try only what can save time in one
render. Each is carried out with another seed and compared with an exact answer or with a long run
at full fidelity. Times are those of planned runs and of full fidelity, which take turns in one
process. Each begins without kernels, so that they include all compiles. That of a plan includes its
probes. The text is plan.template.md, whose {fields} are filled in. The script takes about ten
minutes.
"""

import os
import subprocess
import sys
import time
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import mi_lcair
from docs.studies.page import label, write_page
from mi_lcair.benchmark.propagation import exact
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.planning.probe import Settings
from mi_lcair.planning.reference import PROBED_BOUNCES
from mi_lcair.startup.kernel_cache import VARIABLE

REPETITIONS, TOLERANCE, PIXEL_TOLERANCE = 12, 0.01, 0.01
TIMES = 3  # times that each run is timed; the median counts
SCENES = [
    ("two_plates", {}),
    ("open_box", {}),
    ("cavity", {"opening": 8}),
    ("cavity", {"opening": 80}),
    ("furnace", {}),
    ("furnace", {"material": "gloss_black"}),
    ("cylinder_ir_range", {}),
    ("cylinder_ir_range", {"finish": "gloss_black", "band": "MWIR"}),
    ("a340_landing", {"position": 3, "band": "LWIR"}),
]
# Scenes with a plan for each pixel: those with materials for which a lower rung may suffice.
PAID = [case for case in SCENES if case[0] in ("furnace", "cylinder_ir_range", "a340_landing")]
# Resolution of the image in a plan for each pixel. Other scenes keep their own.
RESOLUTION = {"cylinder_ir_range": 384, "a340_landing": 384}


def full_fidelity(scene):
    """Return settings with the full BRDF and at least PROBED_BOUNCES reflections."""
    own = Settings.of(scene)
    return Settings(
        lobe=dict.fromkeys(own.lobe, "brdf"),
        max_bounces=max(own.max_bounces, PROBED_BOUNCES),
        emitter_sampling=own.emitter_sampling,
    )


def reference(scene, name, parameters, area):
    """Return the reference intensity of the target and its standard error [W/sr]."""
    L = lambda T: float(in_band_radiance(band(scene.band), T))
    if name == "two_plates":
        return exact.two_plates_intensity(L(800)), 0.0
    if name == "open_box":
        return exact.open_box_intensity(L(800), L(300)), 0.0
    if name == "furnace":
        return L(300) * area, 0.0
    with full_fidelity(scene).applied(scene):
        result = mi_lcair.signature(scene, spp=max(64, 2**22 // pixels(scene)), seed=999)
    return result.target.intensity, result.target.standard_error


def pixels(scene):
    return int(np.prod(scene.sensor(0).film().crop_size()))


def short(plan):
    """Return the settings of a plan in one line."""
    lobes = ", ".join(f"{material or 'unnamed'} {lobe}" for material, lobe in plan.lobe.items())
    closure = "" if plan.closure == "none" else f", {plan.closure}"
    sampling = ", emitter sampling" if plan.emitter_sampling else ""
    return f"{lobes + '; ' if lobes else ''}N = {plan.max_bounces}{closure}{sampling}"


def held(name, parameters):
    """Return a scene's row of the table of intensities, and how many of them are inside."""
    scene = mi_lcair.load(name, **parameters)
    area = mi_lcair.signature(scene, spp=2).window_area
    expected, error = reference(scene, name, parameters, area)
    cells, counts = [], []
    for renders in (inf, 1):
        errors, plans = [], []
        for seed in range(REPETITIONS):
            plan = mi_lcair.plan(scene, TOLERANCE, seed=seed, renders=renders)
            with plan.applied(scene):
                result = mi_lcair.signature(scene, tolerance=plan.noise_tolerance, seed=1000 + seed)
            errors.append(result.target.intensity / expected - 1)
            plans.append(plan)
        texts = [short(plan) for plan in plans]
        counts.append(int(np.sum(np.abs(errors) <= TOLERANCE)))
        bias, rms = np.median([plan.bias for plan in plans]), np.sqrt(np.mean(np.square(errors)))
        cells.append(
            f"{max(texts, key=texts.count)} | {bias:.2%} | {rms:.3%} "
            f"| {counts[-1]} of {REPETITIONS}"
        )
    stated = f" +- {error / expected:.2%}" if error else ", exact"
    row = f"| {label(name, parameters)} | {expected:.6g} W/sr{stated} | {' | '.join(cells)} |"
    return row, counts


def forget_kernels():
    """Remove all kernels from memory and from the folder that `main` names."""
    import drjit as dr

    dr.flush_kernel_cache()
    for file in Path(os.environ[VARIABLE]).iterdir():
        file.unlink()


def clocked(function, compiled):
    """Return the duration of a call [s] and its result; `compiled` keeps the kernels."""
    if not compiled:
        forget_kernels()
    start = time.perf_counter()
    result = function()
    return time.perf_counter() - start, result


def compared(scene, render, tolerance, each_pixel, compiled=False):
    """Return median times of planned runs and of full fidelity [s], and the last of each.

    They take turns. The last planned run comes with its plan.
    """

    def planned(seed):
        plan = mi_lcair.plan(scene, tolerance, each_pixel, seed=seed)
        with plan.applied(scene):
            return plan, render(scene, tolerance=plan.noise_tolerance, seed=seed)

    def full(seed):
        with full_fidelity(scene).applied(scene):
            return render(scene, tolerance=tolerance, seed=seed)

    times = {planned: [], full: []}
    for seed in range(TIMES):
        for function, of_function in times.items():
            seconds, result = clocked(lambda: function(seed), compiled)
            of_function.append(seconds)
            if function is planned:
                plan, run = result
            else:
                whole = result
    return np.median(times[planned]), np.median(times[full]), plan, run, whole


def paid(name, parameters):
    """Return a scene's row of the table of plans for each pixel, and the factor."""
    parameters = parameters | ({"resolution": RESOLUTION[name]} if name in RESOLUTION else {})
    scene = mi_lcair.load(name, **parameters)
    seconds, full_seconds, plan, run, full = compared(
        scene, mi_lcair.render, PIXEL_TOLERANCE, each_pixel=True
    )
    mark = lambda result: f"{result.spp}{'' if result.reached else ' (not reached)'}"
    factor = full_seconds / seconds
    return (
        f"| {label(name, parameters)} | {short(plan)} | {plan.bias:.2%} | {mark(run)} "
        f"| {plan.probe_seconds:.2f} | {seconds:.2f} | {mark(full)} | {full_seconds:.2f} "
        f"| {factor:.2f} |"
    ), factor


def paid_intensity(name, parameters):
    """Return a scene's row of the table of the times of intensities, and the factor."""
    scene = mi_lcair.load(name, **parameters)
    results = [
        compared(scene, mi_lcair.signature, TOLERANCE, each_pixel=False, compiled=compiled)
        for compiled in (False, True)
    ]
    cells = [
        f"{seconds:.3f} | {full_seconds:.3f} | {full_seconds / seconds:.2f}"
        for seconds, full_seconds, *_ in results
    ]
    seconds, full_seconds, plan, run, full = results[0]
    return (
        f"| {label(name, parameters)} | {short(plan)} | {run.paths} | {full.paths} "
        f"| {' | '.join(cells)} |"
    ), full_seconds / seconds


def main(page):
    """Write the page, in a process whose kernels are kept in a folder of its own."""
    with TemporaryDirectory() as folder:
        subprocess.run(
            [
                sys.executable,
                "-c",
                "import sys, docs.studies.plan as s; s.write(sys.argv[1])",
                page,
            ],
            env=os.environ | {VARIABLE: folder},
            check=True,
        )


def write(page):
    """Write the page; the environment names a folder of kernels that may be emptied."""
    from tqdm import tqdm

    def table(function, cases):
        rows, values = [], []
        for case in tqdm(cases):
            row, value = function(*case)
            rows.append(row)
            values.append(value)
            print(row, flush=True)
        return "\n".join(rows), values

    paid_rows, factors = table(paid, PAID)
    intensity_rows, intensity_factors = table(paid_intensity, SCENES)
    held_rows, inside = table(held, SCENES)
    write_page(
        page,
        "plan",
        tolerance=TOLERANCE,
        pixel_tolerance=PIXEL_TOLERANCE,
        repetitions=REPETITIONS,
        times=TIMES,
        bounces=PROBED_BOUNCES,
        held=held_rows,
        paid=paid_rows,
        intensities=intensity_rows,
        least=min(factors),
        twice=sum(factor >= 2 for factor in factors),
        images=len(factors),
        least_intensity=min(intensity_factors),
        most_intensity=max(intensity_factors),
        inside=sum(with_all for with_all, _ in inside),
        inside_once=sum(once for _, once in inside),
        runs=REPETITIONS * len(inside),
    )


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "docs/validation/plan.md")
