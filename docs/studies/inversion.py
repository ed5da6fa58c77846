"""What measurements say about a scene: temperatures, a reflectance, and a paint that hides a lid.

    python -m docs.studies.inversion [SECTION ... | page]

The script writes docs/validation/inversion.md from inversion.template.md, its pictures, and the
measurements in docs/validation/inversion. What it measures is kept in inversion/fields.json, so
that each of the sections `stripes`, `gloss_black`, `plate` and `paint` may be measured separately.
All of them take about ten minutes; with `page` the script measures nothing.
"""

import json
import sys
import tomllib
from pathlib import Path

import numpy as np

import mi_lcair
from docs.studies.lobe import width_deg
from docs.studies.page import write_page
from mi_lcair.api.scenes import parameters
from mi_lcair.files import replacing
from mi_lcair.fitting import fit
from mi_lcair.knowing.inversion.data.readings import noise_of_netd
from mi_lcair.physics.reflection.models import MODELS
from mi_lcair.rendering.parameters.values import changed
from mi_lcair.rendering.views import View, seen_from
from tests.fitting.synthetic import THESIS_SETS, scan_of
from tests.knowing.inversion.plate import XML

FOLDER = Path(__file__).parents[1] / "validation" / "inversion"
STRIPES, GLOSS_BLACK, PLATE, TWO_SKIES, PAINT = (
    FOLDER / f"{name}.toml" for name in ("stripes", "gloss_black", "plate", "two_skies", "paint")
)
NETD_MK = 50
DRAWS = 20
PAINT_SEEDS = 0, 1, 4  # of the draws from which all parameters of a paint are estimated
BRDF_NOISE = 0.05  # relative noise of the scans of the BRDF
TRUE = {"plate.temperature": 310.0, "paint.reflectance": 0.3}
# Standard deviations of the budget: the lid's temperature, the surroundings, and the paint
STATED = {
    "lid.temperature": 2.0,
    "sky.temperature": 5.0,
    "ground.temperature": 2.0,
    "paint.epsilon": 0.02,
    "paint.e": 0.02,
}
SHOWN = View(30.0, 40.0)  # aspect of the budget


def measure(problem: Path, draw: int) -> None:
    """Write the images of a problem: renders from other paths, with a camera's noise."""
    tree = tomllib.loads(problem.read_text(encoding="utf-8"))
    for number, entry in enumerate(tree["data"]):
        path = FOLDER / entry["scene"]
        scene = mi_lcair.load(path if path.exists() else entry["scene"], **entry["parameters"])
        image = clean(scene, f"{problem} {number}")
        sigma = noise_of_netd(scene.band, image, NETD_MK)
        noise = np.random.default_rng((draw, number)).standard_normal(image.shape)
        np.save(FOLDER / entry["image"], (image + sigma * noise).astype(np.float32))


def clean(scene, key: str, kept={}) -> np.ndarray:  # noqa: B006  images by key
    """The radiance without a camera's noise."""
    if key not in kept:
        result = mi_lcair.render(scene, spp=2048, seed=999)
        kept[key] = result.channels["Y"].astype(float)
    return kept[key]


def stripes() -> dict:
    """Fields of the page about the cylinder's stripes."""
    deviations, errors, renders = [], [], set()
    for draw in range(DRAWS):
        measure(STRIPES, DRAWS - 1 - draw)
        tree = tomllib.loads(STRIPES.read_text(encoding="utf-8"))
        tree["data"][0]["image"] = str(FOLDER / tree["data"][0]["image"])
        tree["render"] = {"seed": 1000 + draw}
        found = mi_lcair.invert(tree, advise=False)
        true = [
            float(one.name.partition("@")[2].removesuffix(".temperature")) for one in found.answers
        ]
        errors.append([one.standard_error for one in found.answers])
        deviations.append([one.value - T for one, T in zip(found.answers, true)])
        renders.add(found.renders)
    deviations, errors = np.array(deviations), np.array(errors)
    found.plot(FOLDER / "stripes.png")
    cover = (np.abs(deviations) < 1.96 * errors).mean(axis=0)
    bias = deviations.mean(axis=0) / errors.mean(axis=0)
    rows = "\n".join(
        f"| {one.name} | {one.value:.4f} | {1e3 * error:.1f} | {1e3 * rms:.1f} | {inside:.0%} | "
        f"{of:+.2f} |"
        for one, error, rms, inside, of in zip(
            found.answers, errors.mean(axis=0), deviations.std(axis=0), cover, bias
        )
    )
    return {
        "stripes": rows,
        "draws": DRAWS,
        "stripes_p": f"{found.p_value:.2f}",
        "stripes_seconds": f"{found.seconds:.1f}",
        "stripes_renders": max(renders),
        "all_inside": f"{(np.abs(deviations) < 1.96 * errors).mean():.1%}",
    }


def gloss_black() -> dict:
    """Fields of the page about all parameters of the cylinder's paint, and a fit of its BRDF."""
    values, errors, ends, unfinished = [], [], [], 0
    for draw in PAINT_SEEDS:
        measure(GLOSS_BLACK, draw)
        tree = tomllib.loads(GLOSS_BLACK.read_text(encoding="utf-8"))
        tree["data"][0]["image"] = str(FOLDER / tree["data"][0]["image"])
        tree["render"] |= {"seed": 1000 + draw}
        found = mi_lcair.invert(tree, advise=False)
        unfinished += not found.converged
        values.append([one.value for one in found.answers])
        errors.append([one.standard_error for one in found.answers])
        ends.append([(one.lower, one.upper) for one in found.answers])
    values, errors, ends = np.array(values), np.array(errors), np.array(ends)
    true = THESIS_SETS["gloss black LWIR"]
    scan = scan_of(MODELS["sandford_robertson"], true, step=0.5, noise=BRDF_NOISE)
    fitted = fit(scan, model="sandford_robertson", form="thesis", starts=4)
    inside = ((ends[..., 0] <= true) & (true <= ends[..., 1])).sum(axis=0)
    rows = "\n".join(
        f"| {name} | {truth:g} | {mean:.5g} | {error:.2g} | {scatter:.2g} | "
        f"{count} of {len(values)} | {fitted.standard_error[name]:.2g} |"
        for name, truth, mean, error, scatter, count in zip(
            fitted.parameters,
            true,
            values.mean(axis=0),
            np.median(errors, axis=0),
            values.std(axis=0, ddof=1),
            inside,
        )
    )
    return {
        "gloss_black": rows,
        "paint_draws": len(PAINT_SEEDS),
        "lobe_width": f"{width_deg(true[-1]):.2f}",
        "brdf_noise": f"{100 * BRDF_NOISE:g} %",
        "gloss_unfinished": unfinished,
    }


def plate() -> dict:
    """Fields of the page about a plate's temperature and reflectance."""
    (FOLDER / "plate.xml").write_text(XML + "\n", encoding="utf-8")
    for problem in (PLATE, TWO_SKIES):
        measure(problem, 1)
    one, two = mi_lcair.invert(PLATE), mi_lcair.invert(TWO_SKIES)
    two.plot(FOLDER / "two_skies.png")
    two_rows = "\n".join(
        f"| {answer.label} | {TRUE[answer.label]:g} | {answer.value:.6g} | "
        f"{answer.standard_error:.2g} | {answer.verdict} |"
        for answer in two.answers
    )
    return {
        "one_band": table(one),
        "directions": "\n".join(f"    {direction.words}" for direction in one.directions),
        "correlation": f"{one.correlation[0, 1]:.4f}",
        "advice": "\n".join(f"    {advice.words}" for advice in one.advice),
        "two_skies": two_rows,
        "two_skies_p": f"{two.p_value:.2f}",
    }


def paint() -> dict:
    """Fields of the page about the paint that hides the lid."""
    found = mi_lcair.invert(PAINT)
    fitted = found.data[0]
    rows = "\n".join(
        f"| {azimuth:g} | {elevation:g} | {value:+.3f} |"
        for (azimuth, elevation), value in zip(fitted.aspects, fitted.predicted)
    )
    scene = mi_lcair.load(FOLDER / "lid.xml")
    values = {one.name: one.value for one in found.answers}
    known = parameters(scene)
    with changed(scene, {name: np.clip(v, known[name].lower, 1) for name, v in values.items()}):
        budget = mi_lcair.budget(seen_from(scene, SHOWN, 64), {"sigma": STATED}, spp=32)
    parts = "\n".join(
        f"| {row.quantity} | {row.share:.1%} |" for row in budget.rows if row.share > 0.001
    )
    return {
        "paint": table(found),
        "paint_remark": found.remarks[0],
        "aspects": rows,
        "shown": f"azimuth {SHOWN.azimuth_deg:g} and elevation {SHOWN.elevation_deg:g} degrees",
        "budget_value": f"{budget.value:.4g}",
        "budget_sigma": f"{budget.sigma:.2g}",
        "budget": parts,
        "paint_seconds": f"{found.seconds:.0f}",
    }


def table(solution) -> str:
    """Rows of a table: label, value, standard error and verdict of each unknown."""
    return "\n".join(
        f"| {one.label} | {one.value:.5g} | {one.standard_error:.2g} | {one.verdict} |"
        for one in solution.answers
    )


SECTIONS = stripes, plate, paint, gloss_black


def main(*names):
    problems = {
        f"{path.stem}_toml": path.read_text(encoding="utf-8").strip()
        for path in (STRIPES, GLOSS_BLACK, PLATE, TWO_SKIES, PAINT)
    }
    kept = FOLDER / "fields.json"
    fields = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else {}
    for section in SECTIONS:
        if not names or section.__name__ in names:
            fields |= section() | {section.__name__ + "_measured": True}
            with replacing(kept) as partial:
                partial.write_text(json.dumps(fields, indent=1) + "\n", encoding="utf-8")
    if missing := [s.__name__ for s in SECTIONS if s.__name__ + "_measured" not in fields]:
        sys.exit(f"the page is written when these are measured, too: {', '.join(missing)}")
    write_page(FOLDER.with_suffix(".md"), "inversion", netd=NETD_MK, **problems, **fields)


if __name__ == "__main__":
    main(*sys.argv[1:])
