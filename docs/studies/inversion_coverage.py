"""Measure how often the 95 % intervals of `mi-lcair invert` hold the truth, case by case.

    python -m docs.studies.inversion_coverage [CASE[=DRAWS] ... | page] [workers=N | dask=ADDRESS]

The cases are problems with known answers, see `CASES`. The script adds what it measures to
docs/validation/inversion/coverage.json and writes docs/validation/inversion_coverage.md from all
that is there. All cases take about an hour, so that each of them may be measured separately, and
CASE=+20 adds 20 draws to those that are there. With `page` the script measures nothing.
"""

import json
import sys
import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from scipy import stats

import mi_lcair
from docs.studies.page import write_page
from mi_lcair.files import replacing
from mi_lcair.knowing.inversion.data.readings import noise_of_netd
from mi_lcair.knowing.inversion.least_squares.newton import matern
from mi_lcair.rendering.facets import FacetTable
from mi_lcair.tasks import in_order
from tests.derivatives import waist
from tests.knowing.inversion import ball, corner, plate

PAGE = Path("docs/validation/inversion_coverage.md")
MEASURED = Path("docs/validation/inversion/coverage.json")
STARTS = (200.0, 300.0, 700.0, 1500.0)  # K
LID = Path(__file__).parents[1] / "validation" / "inversion" / "lid.xml"
EMISSIVITY = 0.92
ERROR = 0.02  # relative error of the radiance or of the emissivity of each strip
KNOWN = 0.1  # standard deviation of the prior of a reflectance
WALL = 0.02  # reflectance of the wall whose temperature is unknown too
LENGTH = 0.5  # metres over which facets are alike
BAD = 10  # bad pixels of 1,024
WIDTHS = (0.004, 0.01, 0.03)  # parameter `e` of gloss black
STRIPES, COLUMNS = 3.0, 2.0  # standard deviations of noise that rows and columns share, in NETD
SHIFT = 0.1  # metres


def starts(folder: Path, draws: range, spp: int = 64):
    """Yield solutions and the truth: six temperatures, each draw from one of STARTS."""
    path = corner.write_scene(folder)
    image = corner.clean(path, 128 * spp)
    for draw in draws:
        start = STARTS[draw % len(STARTS)]
        yield solved(corner.problem(folder, path, image, start, draw, spp=spp)), corner.KELVIN


def finer(folder: Path, draws: range):
    """Yield solutions and the truth: the same with eight times as many paths."""
    yield from starts(folder, draws, 512)


def emissivity(folder: Path, draws: range):
    """Yield solutions and the truth: a lid's temperature and its emissivity, known to 0.02."""
    parameters = {"resolution": 24, "epsilon": EMISSIVITY, "lid_K": 300}
    scene = mi_lcair.load(LID, **parameters)
    image = mi_lcair.render(scene, spp=2**13, seed=99).channels["Y"].astype(float)
    sigma = noise_of_netd(scene.band, image, corner.NETD_MK)
    for draw in draws:
        random = np.random.default_rng((draw, 5))
        np.save(folder / "lid.npy", random.normal(image, sigma))
        entry = {"scene": str(LID), "parameters": parameters, "image": str(folder / "lid.npy")}
        unknowns = {
            "lid.temperature": {"start": (299.0, 301.0, 290.0)[draw % 3]},
            "paint.epsilon": {"prior": [float(random.normal(EMISSIVITY, 0.02)), 0.02]},
        }
        noise = {"quantity": "radiance", "netd_mK": corner.NETD_MK, **corner.EXACT}
        tree = {"data": [entry | noise], "unknowns": unknowns, "render": {"seed": draw}}
        yield solved(tree), (300.0, EMISSIVITY)


def model(folder: Path, draws: range):
    """Yield solutions and the truth: radiances that are wrong by ERROR, as model_sigma says.

    Those of a strip are wrong together, and those of each pixel by themselves.
    """
    path = corner.write_scene(folder)
    scene = mi_lcair.load(path)
    channels = mi_lcair.render(scene, spp=2**13, seed=99, parts=True).channels
    strips = np.array([channels[f"seen.s{k}.Y"] for k in range(len(corner.KELVIN))], float)
    for draw in draws:
        random = np.random.default_rng((draw, 7))
        image = np.tensordot(1 + ERROR * random.normal(size=len(strips)), strips, 1)
        image *= 1 + ERROR * random.normal(size=image.shape)
        tree = corner.problem(folder, path, image, 300.0, draw, spp=64)
        tree["data"][0]["model_sigma"] = f"{ERROR:.0%}"
        yield solved(tree), corner.KELVIN


def materials(folder: Path, draws: range):
    """Yield solutions and the truth: emissivities that are wrong by ERROR, with that model_sigma.

    What a strip emits less it reflects more, so that its radiance is less wrong.
    """
    path = corner.write_scene(folder)
    for draw in draws:
        image = with_other_emissivities(path, draw)
        tree = corner.problem(folder, path, image, 300.0, draw, spp=64)
        tree["data"][0]["model_sigma"] = f"{ERROR:.0%}"
        yield solved(tree), corner.KELVIN


def with_other_emissivities(path: str, draw: int) -> np.ndarray:
    """The corner's image with emissivities that are wrong by ERROR."""
    error = np.random.default_rng((draw, 7)).normal(size=len(corner.KELVIN))
    return corner.clean(path, **corner.reflectances(1 - 0.7 * (1 + ERROR * error)))


def error_of_radiance(draws: range = range(8)) -> float:
    """Rms relative error of the radiance in the images of `materials`."""
    with tempfile.TemporaryDirectory() as folder:
        path = corner.write_scene(Path(folder))
        right = corner.clean(path)
        images = [with_other_emissivities(path, draw) for draw in draws]
    return float(np.sqrt(np.mean((np.array(images) / right - 1) ** 2)))


def pixels(folder: Path, draws: range):
    """Yield solutions and the truth: BAD dead, hot and saturated pixels, whose list is printed."""
    path = corner.write_scene(folder)
    image = corner.clean(path, size=32)
    for draw in draws:
        tree = corner.problem(folder, path, image, 300.0, draw, spp=64)
        tree["data"][0]["parameters"] = {"size": 32}
        values, random = np.load(tree["data"][0]["image"]), np.random.default_rng((draw, 9))
        bad = random.choice(values.size, BAD, replace=False)
        values.flat[bad] = random.choice([0.0, 70.0, 1e4], BAD)
        np.save(tree["data"][0]["image"], values)
        solution = solved(tree)
        listed = {row * 32 + column for row, column in solution.data[0].bad_pixels}
        right = len(listed & set(bad.tolist()))
        print(f"pixels: {len(listed)} listed, {right} of them right, of {BAD}", flush=True)
        yield solution, corner.KELVIN


def camera(folder: Path, draws: range):
    """Yield solutions and the truth: six temperatures from the counts of a camera's frames."""
    scenario = corner.write_scenario(folder, "midlat_summer")
    image = mi_lcair.image(scenario, frames=draws.stop, spp=2**13)
    for draw in draws:
        np.save(folder / "counts.npy", image.counts[draw])
        entry = {
            "scene": scenario,
            "image": str(folder / "counts.npy"),
            "quantity": "counts",
        } | corner.EXACT
        unknowns = {name: {"start": 310.0} for name in corner.NAMES}
        render = {"seed": 100 + draw, "spp": 64}
        yield solved({"data": [entry], "unknowns": unknowns, "render": render}), corner.KELVIN


def wall(folder: Path, draws: range):
    """Yield solutions and the truth: temperature and small reflectance of one strip, from afar."""
    path = corner.write_scene(folder)
    image = corner.clean(path, R5=WALL)
    for draw in draws:
        tree = corner.problem(folder, path, image, 300.0, draw, spp=64)
        tree["data"][0]["parameters"] = {"R5": (0.3, 0.05, 0.6)[draw % 3]}
        tree["unknowns"] = {
            "s5.temperature": {"start": (320.0, 345.0, 300.0)[draw % 3]},
            "paint5.reflectance": {},
        }
        yield solved(tree), (corner.KELVIN[5], WALL)


def valley(folder: Path, draws: range, sigma: float | None = None):
    """Yield solutions and the truth: temperature and reflectance of a plate that fills the image.

    One band cannot separate them. The first guesses lie on both sides of the valley. sigma: error
    of the prior of the reflectance, which then ends the valley.
    """
    plate.write_scene(folder)
    for draw in draws:
        random = np.random.default_rng((draw, 11))
        start = {"T": random.uniform(280, 360), "R": random.uniform(0.05, 0.9)}
        datum = plate.datum(folder, "plate", draw, start=start)
        known = {"prior": [float(random.normal(0.3, sigma)), sigma]} if sigma else {}
        unknowns = plate.UNKNOWNS | {"paint.reflectance": known}
        yield solved({"data": [datum], "unknowns": unknowns}), (310.0, 0.3)


def curved(folder: Path, draws: range):
    """Yield solutions and the truth: the same with a reflectance that a prior knows to KNOWN."""
    yield from valley(folder, draws, KNOWN)


def lobe(folder: Path, draws: range):
    """Yield solutions and the truth: the width of the lobe of gloss black, which mirrors a ball."""
    for number, e in enumerate(WIDTHS):
        path = ball.write_scene(folder, e)
        image = corner.clean(path, 4096)
        for draw in [draw for draw in draws if draw % len(WIDTHS) == number]:
            yield solved(ball.problem(folder, path, image, (0.6, 1.5)[draw % 2] * e, draw)), (e,)


def stripes(folder: Path, draws: range):
    """Yield solutions and the truth: six temperatures behind noise that rows and columns share."""
    path = corner.write_scene(folder)
    image = corner.clean(path)
    for draw in draws:
        tree = corner.problem(folder, path, image, 300.0, draw, spp=64)
        noisy, random = np.load(tree["data"][0]["image"]), np.random.default_rng((draw, 15))
        sigma = noise_of_netd(mi_lcair.load(path).band, image, corner.NETD_MK).mean()
        noisy += sigma * STRIPES * random.normal(size=(len(image), 1))
        np.save(tree["data"][0]["image"], noisy + sigma * COLUMNS * random.normal(size=len(image)))
        tree["data"][0] |= {"row_noise": STRIPES, "column_noise": COLUMNS}
        yield solved(tree), corner.KELVIN


def wrong(folder: Path, draws: range):
    """Yield solutions and the truth: images of another scene than the stated one.

    They are flipped, seen from 0.1 m beside, or of a neighbour with another reflectance.
    """
    path = corner.write_scene(folder)
    text = Path(path).read_text(encoding="utf-8")
    shifted = folder / "shifted.xml"
    shifted.write_text(text.replace("0, 0, 0", f"{SHIFT}, 0, 0"), encoding="utf-8")
    images = (
        np.flip(corner.clean(path), axis=1),
        corner.clean(shifted),
        corner.clean(path, R0=0.4),
    )
    for draw in draws:
        yield solved(corner.problem(folder, path, images[draw % 3], 300.0, draw)), corner.KELVIN


def two_skies(folder: Path, draws: range):
    """Yield solutions and the truth: the plate under two skies, which separate its unknowns."""
    plate.write_scene(folder)
    for draw in draws:
        seeds = 2 * draw, 2 * draw + 1
        data = [plate.datum(folder, f"{S}", k, f"{S}", S=S) for S, k in zip((290, 310), seeds)]
        unknowns = {"plate.temperature": {"per": []}, "paint.reflectance": {}}
        yield solved({"data": data, "unknowns": unknowns}), (310.0, 0.3)


def facets(folder: Path, draws: range, is_seen: bool):
    """Yield solutions and the truth of 400 facets that are alike over 0.5 m, from one noisy view.

    They are those facets that a pixel sees, or the others. For the former, the ratio of the rms
    error without `correlation_m` to that with it is printed.
    """
    count, temperature = 400, {"prior": [300.0, 10.0]}
    start = np.full(count, 300.0)
    table = FacetTable(mi_lcair.load(waist.write_scene(folder, start, views=1)))
    centre = table.centre[table.group == "body"]
    distance = np.linalg.norm(centre[:, None] - centre, axis=-1)
    root = np.linalg.cholesky(matern(distance, LENGTH) + 1e-6 * np.eye(count))
    for draw in draws:
        random = np.random.default_rng((draw, 13))
        truth = 300 + 10 * root @ random.normal(size=count)
        scene = mi_lcair.load(waist.write_scene(folder, truth, size=48, views=1))
        image = mi_lcair.render(scene, spp=2**11, seed=99).channels["Y"].astype(float)
        np.save(folder / "view.npy", random.normal(image, noise_of_netd(scene.band, image, 2000)))
        path = str(waist.write_scene(folder, start, size=48, views=1))
        entry = {"scene": path, "image": str(folder / "view.npy"), "quantity": "radiance"}
        tree = {
            "data": [entry | {"netd_mK": 2000} | corner.EXACT],
            "render": {"spp": 64, "seed": draw},
        }
        alone = solved(tree | {"unknowns": {"body.facets": temperature}})
        alike = {"body.facets": temperature | {"correlation_m": LENGTH}}
        solution = solved(tree | {"unknowns": alike})
        part = (np.array([a.standard_error for a in alone.answers]) < 9.9) == is_seen
        errors = [
            np.std(np.array([a.value for a in result.answers])[part] - truth[part])
            for result in (alone, solution)
        ]
        print(f"rms error of facets without and with correlation_m: {errors}", flush=True)
        answers = [answer for answer, counts in zip(solution.answers, part) if counts]
        yield replace(solution, answers=answers), truth[part]


def seen(folder: Path, draws: range):
    """Yield solutions and the truth: facets that a pixel sees, see `facets`."""
    yield from facets(folder, draws, True)


def unseen(folder: Path, draws: range):
    """Yield solutions and the truth: facets that no pixel sees, see `facets`."""
    yield from facets(folder, draws, False)


CASES = {  # functions and numbers of draws
    starts: 50,
    finer: 50,
    emissivity: 50,
    wall: 100,
    valley: 100,
    curved: 100,
    two_skies: 100,
    camera: 30,
    lobe: 30,
    pixels: 30,
    stripes: 50,
    model: 50,
    materials: 50,
    wrong: 30,
    seen: 4,
    unseen: 4,
}


def solved(tree: dict):
    return mi_lcair.invert(tree, advise=False)


def measured(solutions) -> dict:
    """What the solutions of one case say about the truth."""
    deviations, held, determined, result = [], [], [], {"converged": 0, "renders": 0, "missed": 0}
    for solution, truth in solutions:
        answers = solution.answers[: len(truth)]
        deviations.append([(a.value - T) / a.standard_error for a, T in zip(answers, truth)])
        held += [a.lower <= T <= a.upper for a, T in zip(answers, truth)]
        determined.append([a.is_determined for a in answers])
        result["renders"] = max(result["renders"], solution.renders)
        result["converged"] += solution.converged
        result["missed"] += solution.p_value is not None and solution.p_value < 1e-3
    z, is_determined = (np.concatenate(of) for of in (deviations, determined))
    return result | {
        "draws": len(deviations),
        "intervals": len(held),
        "held": int(np.sum(held)),
        "scatter": float(np.std(z)),
        "determined": int(is_determined.sum()),
        "false": int(np.sum(is_determined & (np.abs(z) > 4))),
    }


def row(name: str, of: dict) -> str:
    """A row of the page. The 95 % interval of the share takes intervals as independent."""
    low, high = stats.binomtest(of["held"], of["intervals"]).proportion_ci(method="exact")
    return (
        f"| {name} | {of['draws']} | {of['intervals']} | {of['held'] / of['intervals']:.1%} "
        f"({low:.1%} to {high:.1%}) | {of['scatter']:.2f} | {of['converged']} in "
        f"{of['renders']} | {of['missed']} | {of['determined']} | {of['false']} |"
    )


def together(of: dict, more: dict) -> dict:
    """What two series of draws of a case say, each about the same truth."""
    both = {key: of[key] + more[key] for key in more}
    squares = sum(part["intervals"] * part["scatter"] ** 2 for part in (of, more))
    scatter = float(np.sqrt(squares / both["intervals"]))
    return both | {"renders": max(of["renders"], more["renders"]), "scatter": scatter}


def of_case(case, draws: range) -> tuple[str, dict]:
    """Name of a case, and what its solutions say."""
    with tempfile.TemporaryDirectory() as folder:
        return case.__name__, measured(case(Path(folder), draws))


def main(*arguments: str) -> None:
    """Measure cases, and write the page. workers=N or dask=ADDRESS measures them at once."""
    known = json.loads(MEASURED.read_text(encoding="utf-8")) if MEASURED.exists() else {}
    wanted = dict(argument.partition("=")[::2] for argument in arguments)
    workers, dask = wanted.pop("workers", None), wanted.pop("dask", None)
    cases = {case: n for case, n in CASES.items() if not wanted or case.__name__ in wanted}
    tasks = []
    for case, most in cases.items():
        count = wanted.get(case.__name__) or str(most)
        first = known[case.__name__]["draws"] if count.startswith("+") else 0
        tasks.append(partial(of_case, case, range(first, first + int(count))))
    with mi_lcair.workers(workers and int(workers), dask):
        for name, of in in_order(tasks):
            adds = wanted.get(name, "").startswith("+")
            known[name] = together(known[name], of) if adds else of
            if name == "materials":
                known["error_of_radiance"] = error_of_radiance()
            print(row(name, of), flush=True)
            with replacing(MEASURED) as part:
                part.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
    names = [case.__name__ for case in CASES if case.__name__ in known]
    write_page(
        PAGE,
        "inversion_coverage",
        rows="\n".join(row(n, known[n]) for n in names),
        error=f"{ERROR:.0%}",
        changed=f"{known['error_of_radiance']:.1%}",
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
