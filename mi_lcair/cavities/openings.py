"""The thesis's eight cavities: areas, Gouffé's emissivity, and what is rendered by reflections.

Table B.1 has the areas of the openings and walls, Fig 4.1 the apparent emissivities (section 4.1).
"""

from dataclasses import dataclass
from functools import partial
from math import pi

import numpy as np

from mi_lcair.benchmark.propagation import exact
from mi_lcair.cavities.gouffe import cavity_emissivity, gouffe
from mi_lcair.physics.blackbody import in_band_radiance
from mi_lcair.progress import stepper
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import load
from mi_lcair.rendering.window import Windows
from mi_lcair.startup.tasks import in_order

WALL_M2, SPHERE_M2 = 3.106, pi  # S and S0 of Table B.1
# Facets removed -> s [m^2] and s/S, as Table B.1 prints them
PRINTED = {
    2: (0.0244, 0.0079),
    4: (0.0487, 0.0157),
    8: (0.0963, 0.0310),
    16: (0.1926, 0.0620),
    24: (0.2820, 0.0910),
    36: (0.4240, 0.1366),
    60: (0.6540, 0.2110),
    80: (0.8749, 0.2810),
}
REFLECTIONS = (0, 1, 2, 3, 4)  # of the curves in Fig 4.1


@dataclass(frozen=True)
class Opening:
    """One of the thesis's cavities.

    Attributes
    ----------
    facets : int
        Facets removed.
    s, printed, ratio : float
        Area of the opening [m^2] and s/S as Table B.1 prints them, and s/S of the printed areas.
    contradicts : bool
        Whether the printed ratio is not that of the printed areas.
    share : float
        Share of the sphere's area that the opening covers.
    gouffe : float
        Emissivity by Gouffé's method, with the printed areas (Eq 3.10).
    exact : float
        Emissivity of the sphere for infinitely many reflections (Eq 3.12 with `share`).
    apparent, error : ndarray, shape (reflections,)
        Rendered emissivity after each of REFLECTIONS, and its standard error.
    """

    facets: int
    s: float
    printed: float
    ratio: float
    contradicts: bool
    share: float
    gouffe: float
    exact: float
    apparent: np.ndarray
    error: np.ndarray


def openings(paths: int, seed: int = 0, progress=None) -> list[Opening]:
    """The eight cavities, each rendered with a number of paths."""
    step, rows = stepper(progress, len(PRINTED)), []
    for row in in_order([partial(opening, facets, paths, seed) for facets in PRINTED]):
        rows.append(row)
        step()
    return rows


def opening(facets: int, paths: int, seed: int) -> Opening:
    """The cavity with so many facets removed."""
    s, printed = PRINTED[facets]
    scene = load("cavity", opening=facets)
    windows = Windows.whole(scene.sensor(0))
    totals = measure(scene, windows, Sampling(paths=paths, seed=seed), Measurands.of("image"))
    L = in_band_radiance(scene.band, 800.0)
    terms = [f"bounce.{k}" for k in REFLECTIONS]
    apparent = np.cumsum([totals.mean(name)[0] for name in terms]) / L
    deviations = np.cumsum([totals.deviations(name)[0] for name in terms], axis=0) / L
    share = exact.cavity_opening_fraction(facets)
    return Opening(
        facets=facets,
        s=s,
        printed=printed,
        ratio=s / WALL_M2,
        contradicts=f"{s / WALL_M2:.4f}" != f"{printed:.4f}",
        share=share,
        gouffe=gouffe(exact.GREY, s, WALL_M2, SPHERE_M2),
        exact=cavity_emissivity(exact.GREY, share, 1.0),
        apparent=apparent,
        error=np.sqrt(np.sum(deviations**2, axis=1)),
    )
