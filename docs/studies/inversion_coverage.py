"""Measure how often the 95 % intervals of `mi-lcair invert` hold the truth, case by case.

    python -m docs.studies.inversion_coverage [DRAWS [CASE ...]]

The cases are problems with known answers: temperatures from far first guesses, an emissivity with a
prior, reflectances that are wrong by an amount that `model_sigma` states, pixels that nobody said
are bad, the counts of a camera behind air, a wall whose reflectance is unknown too, and facets half
of which no pixel sees.
The script prints a row for each case: the share of intervals that hold the truth, the largest
deviation in stated errors, and how many draws converged.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import mi_lcair
from mi_lcair.inversion.data.images import noise_of_netd
from mi_lcair.inversion.smoothness import matern
from mi_lcair.rendering.facets.table import FacetTable
from tests.inversion import corner, plate
from tests.sensitivity import waist

DRAWS = 10
STARTS = (200.0, 300.0, 700.0, 1500.0)  # K
LID = Path(__file__).parents[1] / "validation" / "inversion" / "lid.xml"
EMISSIVITY = 0.92
ERROR = 0.02  # relative error of the emissivity of each strip
WALL = 0.02  # reflectance of the wall whose temperature is unknown too
LENGTH = 0.5  # metres over which facets are alike
BAD = 10  # bad pixels of 1,024


def starts(folder: Path, draws: int):
    """Yield solutions and the truth: six temperatures, each draw from one of STARTS."""
    path = corner.write_scene(folder)
    image = corner.clean(path)
    for draw in range(draws):
        start = STARTS[draw % len(STARTS)]
        yield solved(corner.problem(folder, path, image, start, draw, spp=64)), corner.KELVIN


def emissivity(folder: Path, draws: int):
    """Yield solutions and the truth: a lid's temperature and its emissivity, known to 0.02."""
    parameters = {"resolution": 24, "epsilon": EMISSIVITY, "lid_K": 300}
    scene = mi_lcair.load(LID, **parameters)
    image = mi_lcair.render(scene, spp=2**13, seed=99, split=None).channels["Y"].astype(float)
    sigma = noise_of_netd(scene.band, image, corner.NETD_MK)
    for draw in range(draws):
        random = np.random.default_rng((draw, 5))
        np.save(folder / "lid.npy", random.normal(image, sigma))
        entry = {"scene": str(LID), "parameters": parameters, "image": str(folder / "lid.npy")}
        unknowns = {
            "lid.temperature": {"start": (299.0, 301.0, 290.0)[draw % 3]},
            "paint.epsilon": {"prior": [float(random.normal(EMISSIVITY, 0.02)), 0.02]},
        }
        noise = {"quantity": "radiance", "netd_mK": corner.NETD_MK}
        tree = {"data": [entry | noise], "unknowns": unknowns, "render": {"seed": draw}}
        yield solved(tree), (300.0, EMISSIVITY)


def model(folder: Path, draws: int):
    """Yield solutions and the truth: emissivities that are wrong by ERROR, as model_sigma says."""
    path = corner.write_scene(folder)
    for draw in range(draws):
        error = np.random.default_rng((draw, 7)).normal(size=len(corner.KELVIN))
        image = corner.clean(path, **corner.reflectances(1 - 0.7 * (1 + ERROR * error)))
        tree = corner.problem(folder, path, image, 300.0, draw, spp=64)
        tree["data"][0]["model_sigma"] = f"{ERROR:.0%}"
        yield solved(tree), corner.KELVIN


def pixels(folder: Path, draws: int):
    """Yield solutions and the truth: BAD dead, hot and saturated pixels, whose list is printed."""
    path = corner.write_scene(folder)
    image = corner.clean(path, size=32)
    for draw in range(draws):
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


def camera(folder: Path, draws: int):
    """Yield solutions and the truth: six temperatures from the counts of a camera's frames."""
    scenario = corner.write_scenario(folder, "midlat_summer")
    image = mi_lcair.image(scenario, frames=draws, spp=2**13)
    for draw, counts in enumerate(image.counts):
        np.save(folder / "counts.npy", counts)
        entry = {"scene": scenario, "image": str(folder / "counts.npy"), "quantity": "counts"}
        unknowns = {name: {"start": 310.0} for name in corner.NAMES}
        render = {"seed": 100 + draw, "spp": 64}
        yield solved({"data": [entry], "unknowns": unknowns, "render": render}), corner.KELVIN


def wall(folder: Path, draws: int):
    """Yield solutions and the truth: temperature and small reflectance of one strip, from afar."""
    path = corner.write_scene(folder)
    image = corner.clean(path, R5=WALL)
    for draw in range(draws):
        tree = corner.problem(folder, path, image, 300.0, draw, spp=64)
        tree["data"][0]["parameters"] = {"R5": (0.3, 0.05, 0.6)[draw % 3]}
        tree["unknowns"] = {
            "s5.temperature": {"start": (320.0, 345.0, 300.0)[draw % 3]},
            "paint5.reflectance": {},
        }
        yield solved(tree), (corner.KELVIN[5], WALL)


def valley(folder: Path, draws: int):
    """Yield solutions and the truth: temperature and reflectance of a plate that fills the image.

    One band cannot separate them. The first guesses lie on both sides of the valley.
    """
    plate.write_scene(folder)
    for draw in range(draws):
        random = np.random.default_rng((draw, 11))
        start = {"T": random.uniform(280, 360), "R": random.uniform(0.05, 0.9)}
        datum = plate.datum(folder, "plate", draw, start=start)
        yield solved({"data": [datum], "unknowns": plate.UNKNOWNS}), (310.0, 0.3)


def smooth(folder: Path, draws: int):
    """Yield solutions and the truth: 400 facets that are alike over 0.5 m, from one noisy view.

    The errors of the facets are printed for the same problem with and without `correlation_m`.
    """
    facets, temperature = 400, {"prior": [300.0, 10.0]}
    start = np.full(facets, 300.0)
    table = FacetTable(mi_lcair.load(waist.write_scene(folder, start, views=1)))
    centre = table.centre[table.group == "body"]
    distance = np.linalg.norm(centre[:, None] - centre, axis=-1)
    root = np.linalg.cholesky(matern(distance, LENGTH) + 1e-6 * np.eye(facets))
    for draw in range(draws):
        random = np.random.default_rng((draw, 13))
        truth = 300 + 10 * root @ random.normal(size=facets)
        scene = mi_lcair.load(waist.write_scene(folder, truth, size=48, views=1))
        image = mi_lcair.render(scene, spp=2**11, seed=99, split=None).channels["Y"].astype(float)
        np.save(folder / "view.npy", random.normal(image, noise_of_netd(scene.band, image, 2000)))
        path = str(waist.write_scene(folder, start, size=48, views=1))
        entry = {"scene": path, "image": str(folder / "view.npy"), "quantity": "radiance"}
        tree = {"data": [entry | {"netd_mK": 2000}], "render": {"spp": 64, "seed": draw}}
        alone = solved(tree | {"unknowns": {"body.facets": temperature}})
        alike = {"body.facets": temperature | {"correlation_m": LENGTH}}
        solution = solved(tree | {"unknowns": alike})
        is_seen = np.array([a.standard_error for a in alone.answers]) < 9.9
        for name, result in (("without", alone), ("with", solution)):
            error = np.array([a.value for a in result.answers]) - truth
            z = np.abs(error) / [a.standard_error for a in result.answers]
            for what, part in (("seen", is_seen), ("unseen", ~is_seen)):
                rms, held = np.sqrt(np.mean(error[part] ** 2)), np.mean(z[part] < 1.96)
                print(
                    f"smooth: {name} correlation_m {part.sum()} facets {what}: rms error {rms:.2f} "
                    f"K, {held:.0%} of intervals hold the truth",
                    flush=True,
                )
        yield solution, truth


CASES = {
    case.__name__: case
    for case in (starts, emissivity, model, pixels, camera, wall, valley, smooth)
}


def solved(tree: dict):
    return mi_lcair.invert(tree, advise=False)


def main(draws: str = str(DRAWS), *names: str) -> None:
    """Print a row for each case."""
    for name in names or CASES:
        deviations, held, converged, wrong, renders = [], [], 0, 0, 0
        with tempfile.TemporaryDirectory() as folder:
            for solution, truth in CASES[name](Path(folder), int(draws)):
                answers = solution.answers[: len(truth)]
                z = np.array([(a.value - T) / a.standard_error for a, T in zip(answers, truth)])
                deviations.append(z)
                held += [a.lower <= T <= a.upper for a, T in zip(answers, truth)]
                renders = max(renders, solution.renders)
                converged += solution.converged
                wrong += sum(a.is_determined and abs(own) > 4 for a, own in zip(answers, z))
        z = np.abs(deviations)
        print(
            f"{name}: {np.mean(held):.1%} of {z.size} intervals hold the truth, largest "
            f"deviation {z.max():.2f} errors, scatter {np.std(deviations):.2f}, {converged} of "
            f"{len(z)} converged in at most {renders} renders, {wrong} determined "
            "and more than 4 errors off",
            flush=True,
        )


if __name__ == "__main__":
    main(*sys.argv[1:])
