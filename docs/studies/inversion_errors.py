"""Measure whether the errors that `mi-lcair invert` states are true, on the problems of its page.

    python -m docs.studies.inversion_errors [RENDERS [DRAWS]]

There are DRAWS draws of the camera's noise for each of RENDERS seeds of the render. The script
prints, for each unknown, the share of 95 % intervals that hold the true value, the mean deviation
and the scatter, both in stated errors. It takes about a quarter of an hour.
"""

import sys
import tomllib
from dataclasses import replace

import numpy as np

from docs.studies.inversion import FOLDER, NETD_MK, STRIPES, TRUE, TWO_SKIES, clean
from mi_lcair.inversion.data.images import noise_of_netd
from mi_lcair.inversion.data.loader import Loader
from mi_lcair.inversion.least_squares.estimate import estimate
from mi_lcair.inversion.problem import InverseProblem
from mi_lcair.inversion.unknowns import unknowns

RENDERS, DRAWS = 25, 4
IN_TWO_BANDS = "two bands"


def problems():
    """Yield (name, tables of the problem) of the stripes, the two skies and the two bands."""
    for path in (STRIPES, TWO_SKIES):
        tree = tomllib.loads(path.read_text(encoding="utf-8"))
        for entry in tree["data"]:
            entry["image"] = str(FOLDER / entry["image"])
            if (FOLDER / entry["scene"]).exists():
                entry["scene"] = str(FOLDER / entry["scene"])
        yield path.stem, tree
    first = {key: value for key, value in tree["data"][0].items() if key != "state"}
    second = first | {"name": "MWIR", "parameters": {"band": "MWIR"}}
    tree["data"] = [first, second]
    tree["unknowns"]["paint.reflectance"]["per"] = []
    yield IN_TWO_BANDS, tree


def truth(one) -> float:
    """The true value of an unknown: of a stripe its name says it."""
    kelvin = one.name.partition("@")[2].removesuffix(".temperature")
    return float(kelvin) if kelvin else TRUE[one.name]


def deviations(name: str, tree: dict, renders: int, draws: int):
    """Deviations from the truth in stated errors, (renders x draws, N), and the unknowns."""
    result = []
    for seed in range(renders):
        problem = InverseProblem.of(tree | {"render": {"seed": 2000 + seed}})
        loader = Loader()
        data = [loader.datum(place, k, set()) for k, place in enumerate(problem.data)]
        sought = unknowns(problem.unknowns, {}, [datum.where for datum in data], len(data))
        images = [clean(datum.scene, f"{name} {datum.number}")[datum.counts] for datum in data]
        for draw in range(draws):
            random = np.random.default_rng((seed, draw, 1))
            noisy = [
                replace(datum, measured=random.normal(image, noise_of_netd(band, image, NETD_MK)))
                for datum, image, band in zip(data, images, (d.scene.band for d in data))
            ]
            state = estimate(sought, noisy, problem.render, None)
            error = np.sqrt(np.diag(state.covariance))
            result.append((state.x - [truth(one) for one in sought]) / error)
    return np.array(result), sought


def main(renders=RENDERS, draws=DRAWS):
    """Print a row for each unknown of each problem."""
    for name, tree in problems():
        z, sought = deviations(name, tree, renders, draws)
        for one, own in zip(sought, z.T):
            print(
                f"{name}: {one.label}: {np.mean(np.abs(own) < 1.96):.0%} of {len(own)} intervals, "
                f"mean {own.mean():+.2f}, scatter {own.std():.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]))
