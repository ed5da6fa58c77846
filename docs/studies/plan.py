"""Write the page docs/plan.md: whether plans keep their tolerance and whether they save time.

    python -m docs.studies.plan [PAGE]

Every number on the page is computed here. For each bundled scene there are REPETITIONS plans for
the intensity. Each is carried out with another seed and compared with an exact answer or with a
long run at full fidelity. For some scenes there is one plan for each pixel. Its time is compared
with that of full fidelity at the same error. Both times include compiles, and that of the plan
includes its probes. The text is plan.template.md, whose {fields} are filled in. The script takes
about six minutes.
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
# Scenes with a plan for each pixel: those with materials for which a lower rung may suffice.
PAID = [case for case in SCENES if case[0] in ("furnace", "cylinder_ir_range", "a340_landing")]
# Resolution of the image in a plan for each pixel. Other scenes keep their own.
RESOLUTION = {"cylinder_ir_range": 384, "a340_landing": 384}


def label(name, parameters):
    """Return the name of a scene with its parameters."""
    return " ".join([name, *(f"{key}={value}" for key, value in parameters.items())])


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
    tail = ", tail" if plan.closure == "tail" else ""
    sampling = ", emitter sampling" if plan.emitter_sampling else ""
    return f"{lobes + '; ' if lobes else ''}N = {plan.max_bounces}{tail}{sampling}"


def held(name, parameters):
    """Return a scene's row of the table of intensities, and how many of them are inside."""
    scene = mi_lcair.load(name, **parameters)
    area = mi_lcair.signature(scene, spp=2).window_area
    expected, error = reference(scene, name, parameters, area)
    errors, plans = [], []
    for seed in range(REPETITIONS):
        plan = mi_lcair.plan(scene, TOLERANCE, seed=seed)
        with plan.applied(scene):
            result = mi_lcair.signature(scene, spp=plan.spp, seed=1000 + seed)
        errors.append(result.target.intensity / expected - 1)
        plans.append(plan)
    texts = [short(plan) for plan in plans]
    inside = int(np.sum(np.abs(errors) <= TOLERANCE))
    stated = f" +- {error / expected:.2%}" if error else ", exact"
    predicted = np.median([plan.predicted_error for plan in plans])
    row = (
        f"| {label(name, parameters)} | {expected:.6g} W/sr{stated} "
        f"| {max(texts, key=texts.count)} | {inside} of {REPETITIONS} "
        f"| {np.sqrt(np.mean(np.square(errors))):.3%} | {predicted:.2%} |"
    )
    return row, inside


def paid(name, parameters):
    """Return a scene's row of the table of plans for each pixel."""
    parameters = parameters | ({"resolution": RESOLUTION[name]} if name in RESOLUTION else {})
    scene = mi_lcair.load(name, **parameters)
    start = time.perf_counter()
    plan = mi_lcair.plan(scene, PIXEL_TOLERANCE, each_pixel=True)
    probes = time.perf_counter() - start
    with plan.applied(scene):
        run = mi_lcair.render(scene, spp=plan.spp, seed=1)
    with changed(scene, lobe="brdf", closure="none", ambient_temperature=None):
        full = mi_lcair.render(scene, tolerance=PIXEL_TOLERANCE, seed=1)
    return (
        f"| {label(name, parameters)} | {short(plan)} | {plan.spp} | {probes:.1f} "
        f"| {run.seconds:.1f} | {full.spp}{'' if full.reached else ' (not reached)'} "
        f"| {full.seconds:.1f} | {full.seconds / (probes + run.seconds):.2f} |"
    )


def main(page):
    """Write the page."""
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
    template = Path(__file__).with_name("plan.template.md").read_text(encoding="utf-8")
    with replacing(page) as partial:
        partial.write_text(
            template.format(
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
