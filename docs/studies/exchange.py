"""Compare conductors between facets with closed forms and with radiosity, and count intervals.

    python -m docs.studies.exchange [PAGE]
    python -m docs.studies.exchange bowl [PATHS]

The script writes docs/validation/exchange.md from exchange.template.md in about three minutes.
`bowl` prints time and memory of a bowl of 100,000 facets with PATHS paths of each facet.
"""

import resource
import sys
from pathlib import Path
from time import process_time

import mitsuba as mi
import numpy as np
from tqdm import tqdm

import mi_lcair
from docs.studies.page import write_page
from mi_lcair.rendering.statistics import student_factor
from tests.heating.radiosity import exchange_of_cube
from tests.heating.scenes import cube_of, emits, grey, mirror_box, scene_of, spheres, square

PAGE = Path("docs/validation/exchange.md")
RAYS = {"plates": 2**18, "sphere": 2**20, "cube": 2**21}  # paths of each facet
SEEDS, RAYS_OF_INTERVALS = 40, 256
RUNS = 8  # randomisations
FACES = np.array([0.1, 0.3, 0.5, 0.7, 0.9, 0.2])  # emissivities of the faces of a grey cube
ROUGHNESS = (0.005, 0.1, 0.3, 0.6)


def plates(e1: float, e2: float) -> float:
    """GR of infinite plates of 4 m^2."""
    return 4 / (1 / e1 + 1 / e2 - 1)


def in_sphere(e1: float, e2: float, ratio: float) -> float:
    """GR of a sphere of radius 1 m in another; ratio: of their areas, or 1 for a mirror."""
    return 4 * np.pi / (1 / e1 + (1 / e2 - 1) * ratio)


def grey_cube(emissivities) -> np.ndarray:
    """GR of the pairs of faces, (15,), in the limit of small patches."""
    coarse, fine = (exchange_of_cube(emissivities, cells) for cells in (6, 12))
    return (fine + (fine - coarse) / 2.1)[np.triu_indices(6, 1)]


def cases() -> dict:
    """Scenes with the conductors of the pairs of their facets."""
    plate_rows = {
        f"plates between mirrors, emissivities {a} and {b}": (mirror_box(a, b), [plates(a, b)])
        for a, b in ((0.9, 0.9), (0.5, 0.2), (0.1, 0.1))
    }
    mirror = grey(0.3, lobe="mirror")
    return {name: (scene_of(**shapes), exact) for name, (shapes, exact) in plate_rows.items()} | {
        "concentric diffuse spheres": (
            spheres(grey(0.5), grey(0.3)),
            [in_sphere(0.5, 0.3, 1 / 4)],
        ),
        "sphere inside a specular sphere": (spheres(grey(0.5), mirror), [in_sphere(0.5, 0.3, 1)]),
        "black cube, 15 pairs of faces": (scene_of(**cube_of(np.ones(6))), grey_cube(np.ones(6))),
        "grey cube, 15 pairs of unlike faces": (scene_of(**cube_of(FACES)), grey_cube(FACES)),
    }


def pairs_of(conductors) -> np.ndarray:
    """GR of the pairs of facets, (pairs,)."""
    between = conductors.between.toarray()
    return between[np.triu_indices(len(between), 1)]


def row(name: str, scene, exact) -> str:
    """The largest difference from the exact conductors, and the coverage of the intervals."""
    rays = next(rays for kind, rays in RAYS.items() if kind in name)
    traced = mi_lcair.exchange(scene, paths=rays).traced
    difference = np.abs(pairs_of(traced.mean) / exact - 1).max()
    error = (traced.standard_error(pairs_of) / exact).max()
    covers = []
    for seed in range(1, SEEDS + 1):
        traced = mi_lcair.exchange(scene, paths=RAYS_OF_INTERVALS, seed=seed).traced
        half = student_factor(RUNS - 1) * traced.standard_error(pairs_of)
        covers.append(np.abs(pairs_of(traced.mean) - exact) <= half)
    share = f"{np.mean(covers):.1%} of {np.size(covers)}"
    return f"| {name} | 2^{int(np.log2(rays))} | {difference:.1e} | {error:.1e} | {share} |"


def through_a_plate(surface: dict):
    """Two black squares that see each other only in a plate of this surface."""
    T = mi.ScalarTransform4f()
    near = T.translate([-1, 0, 0.6]).rotate([0, 1, 0], 120).scale([0.3, 1, 1])
    far = T.translate([1, 0, 0.3]).rotate([0, 1, 0], -100).scale([0.3, 1, 1])
    screen = T.translate([0, 0, 0.75]).rotate([0, 1, 0], 90).scale([0.6, 2, 1])
    return scene_of(
        plate=square(surface, emitter=emits("plate")),
        near=square(grey(1.0), near, emitter=emits("near")),
        far=square(grey(1.0), far, emitter=emits("far")),
        screen=square({"type": "twosided", "bsdf": grey(1.0)}, screen, emitter=emits("screen")),
    )


def asymmetry_row(name: str, surface: dict) -> str:
    """The difference of the two directions through a plate."""
    result = mi_lcair.exchange(through_a_plate(surface), paths=2**18)
    a, b = (result.facets.groups.index(group) for group in ("near", "far"))
    asymmetry = result.asymmetry
    return f"| {name} | {abs(asymmetry.relative[a, b]):.2%} | {abs(asymmetry.z[a, b]):.1f} |"


def airliner() -> dict:
    """Processor time and size of the exchange of the airliner, at 1024 paths of each facet."""
    scene = mi_lcair.load("a340_landing")
    mi_lcair.exchange(scene, paths=8)  # compiles the kernels
    began = process_time()
    result = mi_lcair.exchange(scene)
    seconds = process_time() - began
    pairs = result.pairs()
    relative = np.quantile(pairs["conductor_error_m2"] / pairs["conductor_m2"], [0.1, 0.9])
    total = result.columns()
    share = np.median(total["conductor_error_m2"] / np.maximum(total["conductor_m2"], 1e-30))
    return {
        "seconds": f"{seconds:.1f}",
        "facets": len(result.facets.number),
        "pairs": f"{len(pairs['facet']):,}".replace(",", " "),
        "low": f"{relative[0]:.0%}",
        "high": f"{relative[1]:.0%}",
        "of_facet": f"{share:.1%}",
    }


def slope() -> str:
    """Relative error of dGR/d(emissivity) of plates from two runs with one seed."""
    step = 1e-3
    low, high = (
        mi_lcair.exchange(scene_of(**mirror_box(e, 0.2)), paths=4096).conductors.between[0, 1]
        for e in (0.5 - step, 0.5 + step)
    )
    exact = plates(0.5, 0.2) ** 2 / (4 * 0.5**2)
    return f"{abs((high - low) / (2 * step) / exact - 1):.1e}"


def bowl(paths: int = 64, rings: int = 100, sectors: int = 500) -> str:
    """Time and memory of the exchange of a half sphere that is open at the top."""
    polar, around = (
        np.radians(np.linspace(90, 0, rings + 1)),
        np.linspace(0, 2 * np.pi, sectors + 1),
    )
    a, b = (grid.ravel() for grid in np.meshgrid(polar, around, indexing="ij"))
    points = np.stack([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), -np.cos(a)], axis=-1)
    corner = np.arange(len(points)).reshape(rings + 1, sectors + 1)
    here, right, below, beyond = corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]
    of_quads = [(here, right, below), (right, beyond, below)]
    faces = np.concatenate([np.stack(quad, axis=-1).reshape(-1, 3) for quad in of_quads])
    # At the pole the second triangles have no area
    faces = faces[:-sectors]
    properties = mi.Properties()
    properties["mesh_bsdf"], properties["mesh_emitter"] = map(mi.load_dict, (grey(0.9), emits()))
    mesh = mi.Mesh("bowl", len(points), len(faces), props=properties)
    values = mi.traverse(mesh)
    values["vertex_positions"], values["faces"] = mi.Float(points.ravel()), mi.UInt32(faces.ravel())
    values.update()
    scene, began = scene_of(bowl=mesh), process_time()
    result = mi_lcair.exchange(scene, paths=paths)
    gib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    return (
        f"{result.facets.area.size} facets, {paths} paths of each: {process_time() - began:.1f} s "
        f"of processor, {gib:.2f} GiB, {result.conductors.between.nnz // 2} pairs"
    )


def main(page=PAGE) -> None:
    surfaces = {
        f"Sandford-Robertson, e = {e:g}": {
            "type": "sandford_robertson",
            "epsilon": 0.2,
            "rho_d": 0.05,
            "b": 0.1,
            "e": e,
        }
        for e in ROUGHNESS
    }
    write_page(
        page,
        "exchange",
        seeds=SEEDS,
        rays_of_intervals=RAYS_OF_INTERVALS,
        rows="\n".join(row(name, *case) for name, case in tqdm(cases().items())),
        asymmetries="\n".join(asymmetry_row(*item) for item in surfaces.items()),
        slope=slope(),
        **airliner(),
    )


if __name__ == "__main__":
    if sys.argv[1:2] == ["bowl"]:
        print(bowl(*map(int, sys.argv[2:3])))
    else:
        main(*sys.argv[1:2])
