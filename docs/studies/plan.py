"""Do plans hold what they promise, and do they pay? The page docs/plan.md; every number on it is
computed here.

    python -m docs.studies.plan [PAGE]

For each bundled scene: REPETITIONS plans for the intensity, each carried out with another seed,
against an exact answer or a long run at full fidelity; and one plan for each pixel, its time,
probes and their compile included, beside that of full fidelity at the same error, its compile
included. Takes about six minutes.
"""

import sys
import time
from pathlib import Path

import numpy as np

import mi_lcair
from mi_lcair.benchmark.propagation import exact
from mi_lcair.files import replacing
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.planning.plan import PROBED_BOUNCES
from mi_lcair.planning.probe import Settings
from mi_lcair.rendering.settings import changed

REPETITIONS, TOLERANCE, PIXEL_TOLERANCE = 12, 0.01, 0.01
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
PAID = [
    case for case in SCENES if case[0] in ("furnace", "cylinder_ir_range", "a340_landing")
]  # where a lower rung suffices
RESOLUTION = {
    "cylinder_ir_range": 384,
    "a340_landing": 384,
}  # of the plan for each pixel; the others have their own

TEXT = """# Plans: what they promise and whether they pay

`mi-lcair plan SCENE --tolerance 1%` finds how little model a scene needs. This page checks plans for the bundled scenes;
`python -m docs.studies.plan` writes it.

## The intensity, to {tolerance:.0%}

{repetitions} plans of different seeds for each scene, each carried out with another seed. "Inside" is how many intensities lie within
{tolerance:.0%} of the reference: an exact answer, or a run of the whole BRDF with {bounces} reflections whose standard error is stated.

| scene | reference | plan (most frequent) | inside | rms error | predicted (95 %) |
|---|---|---|---|---|---|
{held}

In all {inside} of {runs} are inside.

## Each pixel, to {pixel_tolerance:.0%}

For the scenes with materials that a lower rung may stand for: seconds for an image whose rms error over the pixels is {pixel_tolerance:.0%} of its mean: as planned, probes and every compile
included, and at full fidelity (the whole BRDF, the scene's own reflections and emitter sampling) to the same error, its compile
included. Kernels are not taken from the memory of the process, but may lie on the disk.

| scene | plan | spp | probes (s) | run (s) | full fidelity: spp | (s) | factor |
|---|---|---|---|---|---|---|---|
{paid}

Probes cost some seconds whatever the scene, most of them to compile: a plan pays where the image takes longer than that.
"""


def label(name, parameters):
    return " ".join([name, *(f"{key}={value}" for key, value in parameters.items())])


def full_fidelity(scene):
    own = Settings.of(scene)
    return Settings(
        lobe=dict.fromkeys(own.lobe, "brdf"),
        max_bounces=max(own.max_bounces, PROBED_BOUNCES),
        emitter_sampling=own.emitter_sampling,
    )


def reference(scene, name, parameters, area):
    """(intensity of the target, its standard error)."""
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


def short(found):
    lobes = ", ".join(f"{material or 'unnamed'} {lobe}" for material, lobe in found.lobe.items())
    return f"{lobes + '; ' if lobes else ''}N = {found.max_bounces}{', tail' if found.closure == 'tail' else ''}{', emitter sampling' if found.emitter_sampling else ''}"


def held(name, parameters):
    scene = mi_lcair.load(name, **parameters)
    area = mi_lcair.signature(scene, spp=2).window_area
    expected, error = reference(scene, name, parameters, area)
    errors, plans = [], []
    for seed in range(REPETITIONS):
        found = mi_lcair.plan(scene, TOLERANCE, seed=seed)
        with found.applied(scene):
            errors.append(
                mi_lcair.signature(scene, spp=found.spp, seed=1000 + seed).target.intensity
                / expected
                - 1
            )
        plans.append(found)
    texts = [short(found) for found in plans]
    inside = int(np.sum(np.abs(errors) <= TOLERANCE))
    row = (
        f"| {label(name, parameters)} | {expected:.6g} W/sr{f' +- {error / expected:.2%}' if error else ', exact'} | {max(texts, key=texts.count)} | "
        f"{inside} of {REPETITIONS} | {np.sqrt(np.mean(np.square(errors))):.3%} | {np.median([found.predicted_error for found in plans]):.2%} |"
    )
    return row, inside


def paid(name, parameters):
    parameters = parameters | ({"resolution": RESOLUTION[name]} if name in RESOLUTION else {})
    scene = mi_lcair.load(name, **parameters)
    start = time.perf_counter()
    found = mi_lcair.plan(scene, PIXEL_TOLERANCE, each_pixel=True)
    probes = time.perf_counter() - start
    with found.applied(scene):
        run = mi_lcair.render(scene, spp=found.spp, seed=1)
    with changed(scene, lobe="brdf", closure="none", ambient_temperature=None):
        full = mi_lcair.render(scene, tolerance=PIXEL_TOLERANCE, seed=1)
    return (
        f"| {label(name, parameters)} | {short(found)} | {found.spp} | {probes:.1f} | {run.seconds:.1f} | {full.spp}{'' if full.reached else ' (not reached)'} | "
        f"{full.seconds:.1f} | {full.seconds / (probes + run.seconds):.2f} |"
    )


def main(page):
    import drjit as dr
    from tqdm import tqdm

    rows, paid_rows = [], []
    for case in tqdm(SCENES):
        rows.append(held(*case))
        print(rows[-1])
    for case in tqdm(PAID):
        dr.flush_kernel_cache()
        paid_rows.append(paid(*case))
        print(paid_rows[-1], flush=True)
    with replacing(page) as partial:
        partial.write_text(
            TEXT.format(
                tolerance=TOLERANCE,
                pixel_tolerance=PIXEL_TOLERANCE,
                repetitions=REPETITIONS,
                bounces=PROBED_BOUNCES,
                held="\n".join(row for row, _ in rows),
                paid="\n".join(paid_rows),
                inside=sum(n for _, n in rows),
                runs=REPETITIONS * len(rows),
            ),
            encoding="utf-8",
        )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/plan.md"))
