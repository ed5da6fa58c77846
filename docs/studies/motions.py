"""Measure derivatives along motions: against closed forms, their intervals, and an airliner's.

    python -m docs.studies.motions [PAGE]

The script writes docs/validation/motions.md from motions.template.md. It takes about an hour.
"""

import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from statistics import median
from time import process_time

import numpy as np
from scipy.optimize import brentq
from scipy.spatial import ConvexHull
from scipy.stats import binomtest
from tqdm import tqdm

import mi_lcair
from docs.studies.page import label, write_page
from mi_lcair.derivatives.attached import AttachedPaths
from mi_lcair.derivatives.common_numbers import CommonNumbers
from mi_lcair.derivatives.motions.differences import ATTACHED, ON_FILM, Difference, starts_in
from mi_lcair.derivatives.shape import MovedMesh, standard_errors
from mi_lcair.derivatives.window import differences_of, mean_and_deviations
from mi_lcair.plugins.emission.triangles import Choice
from mi_lcair.rendering.measurands import Measurands
from mi_lcair.rendering.measure import measure
from mi_lcair.rendering.motions.motion import turned
from mi_lcair.rendering.motions.pose import declare, moved, set_motions
from mi_lcair.rendering.motions.table import motions_of
from mi_lcair.rendering.parameters.values import changed
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.statistics import student_factor
from mi_lcair.rendering.window import Windows, window_area
from tests.derivatives.motions.test_differences import (
    CUBE,
    GAP,
    HOT,
    VIEW,
    WALL,
    L,
    convex_hull,
    cube_intensity,
    facets_intensity,
    light_of_plate,
    mesh,
    plates,
    scene_of,
    tall_wall,
    view_of_wall,
)
from tests.derivatives.motions.test_registration import NOISE, SCENE, TRUTH, problem
from tests.derivatives.test_shape import bodies, derivatives

PAGE = Path(__file__).parents[1] / "validation" / "motions.md"
FEW, MANY = 2**12, 2**16  # paths of each of the two renders
SEEDS = {FEW: 100, MANY: 40}  # number of seeds by number of paths
H = 1e-4  # step of the differences of closed forms
MOTIONS = Path(__file__).parents[2] / "scenes" / "examples" / "motions.toml"
SCENES = [
    ("cylinder_ir_range", {}, "model.pitch_deg"),
    ("cylinder_ir_range", {}, "model.roll_deg"),
    ("a340_landing", {"position": 1}, "exhaust.radius"),
    ("a340_landing", {"position": 2}, "model.pitch_deg"),
    ("a340_landing", {"position": 2}, "exhaust.radius"),
    ("a340_landing", {"position": 2}, "plume.x_m"),
    ("a340_landing", {"position": 3, "band": "LWIR"}, "model.pitch_deg"),
]
PITCH = "model.pitch_deg"
TURNED = 1.0  # distance of the two attitudes in which the airliner is rendered on the film [deg]
SPP = 64
SIGMA = {"model.yaw_deg": 1.0, "exhaust.radius": 0.05}
DRAWS, DRAW_PATHS = 100, 2**18
CAVITY = 0.5, 0.2, 0.5  # radius of the sphere and of its opening [m], emissivity
OPENED = 0.05  # growth of the opening for a value of 1 [m]
APART = 0.1  # half the distance of two values between which vertices are taken to move evenly
SHAPE_PATHS, SHAPE_FEW, SHAPE_TRUTH = 2**17, 2**13, 2**19
SHAPE_SEEDS = 10
KINKS, KINK_DISTANCES = 40, (1e-3, 0.3)  # poses, and their distances from a kink [deg]
FRAMES = 30  # measured images that are registered


@dataclass(frozen=True)
class Case:
    """A scene, a motion, and the intensity as a function of its value [W/sr]."""

    label: str
    scene: Callable
    motion: str
    value: float
    intensity: Callable[[float], float]

    @property
    def exact(self) -> float:
        high, low = (self.intensity(self.value + h) for h in (H, -H))
        return (high - low) / (2 * H)


def cone() -> np.ndarray:
    """Rim and tip of a cone of 48 sides, (49, 3) [m]."""
    angle = np.arange(48) * 2 * np.pi / 48
    rim = np.stack([0 * angle - 0.3, 0.3 * np.cos(angle), 0.3 * np.sin(angle)], axis=1)
    return np.concatenate([rim, [[0.7, 0, 0]]])


def cases(folder: Path) -> list[Case]:
    """The closed forms. folder: for the files of own motions."""
    cube = lambda: scene_of(convex_hull("cube", CUBE))  # noqa: E731
    gap = lambda x: WALL * view_of_wall(0.2, 0.1, 0.2, -x)  # noqa: E731
    factor = np.cos(np.pi / 4) * 0.5 * WALL
    wall = lambda x: factor * view_of_wall(0.1, 0.2, 0.1 * (1 + x))  # noqa: E731
    return [
        Case("cube, yaw 30", cube, "cube.yaw_deg", 30.0, cube_intensity),
        Case("cube, size", cube, "cube.size", 1.0, lambda k: k**2 * cube_intensity(0)),
        Case(
            "cone of 48 sides, pitch 40.3",
            lambda: scene_of(convex_hull("cone", cone())),
            "cone.pitch_deg",
            40.3,
            lambda x: facets_intensity(cone(), "pitch_deg", x),
        ),
        Case(
            "two_plates, gap of 20 mm",
            lambda: mi_lcair.load("two_plates"),
            "plate.x_m",
            -0.02,
            gap,
        ),
        Case("open_box, wall's height", lambda: tall_wall(folder), "wall.height", 0.0, wall),
        *of_cylinder(),
        Case(
            "parallel plates, gap",
            plates,
            "plate.z_m",
            0.0,
            lambda x: light_of_plate(GAP + x),
        ),
        Case(
            "spherical cavity, opening",
            lambda: cavity(folder),
            "wall.opening",
            0.0,
            lambda x: light_of_cavity(CAVITY[1] + OPENED * x),
        ),
    ]


def cylinder(radius: float = 0.0, length: float = 0.0) -> np.ndarray:
    """Rims of a cylinder of 72 sides, (144, 3) [m], by changes of its radius and length."""
    angle = (np.arange(72) + 0.5) * 2 * np.pi / 72
    rim = 0.25 * (1 + radius) * np.stack([0 * angle, np.cos(angle), np.sin(angle)], axis=1)
    return np.concatenate([rim + [x * (1 + length), 0, 0] for x in (-0.5, 0.5)])


def turned_cylinder():
    scene = scene_of(convex_hull("cylinder", cylinder()))
    scales = {"cylinder.radius": [0, 1, 1], "cylinder.length": [1, 0, 0]}
    table = {name: {"groups": ["cylinder"], "scale": scale} for name, scale in scales.items()}
    declare(scene, motions_of(table))
    set_motions(scene, {"cylinder.pitch_deg": 40.3})
    return scene


def of_cylinder() -> list[Case]:
    def pitched(points):
        return facets_intensity(points, "pitch_deg", 40.3)

    name = "cylinder of 72 sides"
    return [
        Case(
            f"{name}, pitch 40.3",
            turned_cylinder,
            "cylinder.pitch_deg",
            40.3,
            lambda x: facets_intensity(cylinder(), "pitch_deg", x),
        ),
        Case(
            f"{name}, radius",
            turned_cylinder,
            "cylinder.radius",
            0.0,
            lambda x: pitched(cylinder(x)),
        ),
        Case(
            f"{name}, length",
            turned_cylinder,
            "cylinder.length",
            0.0,
            lambda x: pitched(cylinder(0, x)),
        ),
    ]


def sphere(opening: float, rings: int = 48, sides: int = 96):
    """Corners and triangles, seen from inside, of a sphere whose opening faces +x."""
    radius = CAVITY[0]
    theta = np.linspace(np.pi, np.arcsin(opening / radius), rings + 1)
    phi = np.arange(sides) * 2 * np.pi / sides
    circles = np.stack(np.broadcast_arrays(np.cos(theta)[:, None], *_across(theta, phi)), axis=-1)
    k = np.arange(rings * sides)
    right = k // sides * sides + (k + 1) % sides
    squares = [[k, k + sides, right], [right, k + sides, right + sides]]
    return radius * circles.reshape(-1, 3), np.concatenate([np.stack(s, axis=1) for s in squares])


def _across(theta, phi):
    return [np.sin(theta)[:, None] * of(phi) for of in (np.cos, np.sin)]


def cavity(folder: Path):
    corners, triangles = sphere(CAVITY[1])
    rate = (sphere(CAVITY[1] + H)[0] - sphere(CAVITY[1] - H)[0]) / (2 * H)
    mesh("wider", corners + OPENED * rate, triangles).write_ply(str(folder / "wider.ply"))
    shape = mesh("wall", corners, triangles, 1 - CAVITY[2], HOT)
    scene = scene_of(shape, window=0.6, view=[1.0, 0, 0], max_bounces=14)
    declare(
        scene, motions_of({"wall.opening": {"groups": ["wall"], "displaced": "wider.ply"}}, folder)
    )
    return scene


def light_of_cavity(opening: float) -> float:
    """Intensity of the isothermal sphere along its axis [W/sr]; its radiosity is uniform."""
    corners, triangles = sphere(opening)
    a, b, c = np.moveaxis(corners[triangles], 1, 0)
    facets, emissivity = np.cross(b - a, c - a) / 2, CAVITY[2]
    hole, inside = np.linalg.norm(facets.sum(axis=0)), np.linalg.norm(facets, axis=1).sum()
    uniform = emissivity / (1 - (1 - emissivity) * (1 - hole / inside))
    return uniform * L * (HOT / 300) ** 4 * hole


def derivative(scene, case: Case, paths: int, seed: int) -> Difference:
    with changed(scene, {case.motion: case.value}):
        result = mi_lcair.sensitivities(scene, [case.motion], paths=paths, seed=seed)
    return result.differences[case.motion]


def half_width(difference: Difference) -> float:
    """Half of the 95 % interval of a derivative."""
    scatter = np.sqrt(np.sum(difference.deviations**2))
    of_scatter = student_factor(len(difference.deviations) - 1) * scatter
    return float(np.hypot(of_scatter, student_factor(np.inf) * difference.unscattered))


def row(case: Case) -> str:
    """Row of a closed form: errors with MANY paths, and how many intervals hold."""
    scene, hold = case.scene(), []
    for paths, seeds in SEEDS.items():
        results = [derivative(scene, case, paths, seed) for seed in tqdm(range(seeds), case.label)]
        off = np.array([result.derivative - case.exact for result in results])
        inside = int(np.sum(np.abs(off) <= [half_width(result) for result in results]))
        low, high = binomtest(inside, seeds).proportion_ci(method="wilson")
        hold.append(f"{inside} of {seeds} ({100 * low:.0f}-{100 * high:.0f} %)")
    apart, stated = np.sqrt(np.mean(off**2)), np.mean([result.error for result in results])
    return (
        f"| {case.label} | {case.exact:.5g} | {100 * apart / abs(case.exact):.3f} % | "
        f"{100 * stated / abs(case.exact):.3f} % | {' | '.join(hold)} | {results[0].method} | "
        f"{results[0].verdict} |"
    )


def along(scene, case: Case) -> np.ndarray:
    """Displacements of the vertices of a case's group per unit of its motion, (n, 3) [m]."""
    ends = []
    for value in (case.value + APART, case.value - APART):
        with changed(scene, {case.motion: value}):
            ends.append(MovedMesh(scene, case.motion.partition(".")[0]).positions)
    return (ends[0] - ends[1]) / (2 * APART)


def row_of_shape(name: str, scene, group: str, expected: float, displacements) -> str:
    """Row of the sum of the derivatives by all vertices of a group times displacements."""
    sum_, error = derivatives(scene, group, displacements, SHAPE_PATHS)[1].total
    return f"| {name} | {expected:.5g} | {sum_:.5g} ± {error:.2g} |"


def shapes(folder: Path) -> dict[str, object]:
    """Sums of the derivatives by all vertices, and how many intervals of theirs hold."""
    rows, held, count = [], 0, 0
    for case in tqdm(cases(folder)[:-1], "shapes"):
        scene, group = case.scene(), case.motion.partition(".")[0]
        rates = along(scene, case)
        with changed(scene, {case.motion: case.value}):
            rows.append(row_of_shape(case.label, scene, group, case.exact, lambda p, u=rates: u))
    scene = mi_lcair.load("cylinder_ir_range")
    found = mi_lcair.sensitivities(scene, ["self.size"], paths=SHAPE_TRUTH).differences["self.size"]
    name = "cylinder_ir_range, size"
    rows.append(row_of_shape(name, scene, "self", found.derivative, lambda p: p))
    for seed in (1, 2, 3):
        scene = bodies(seed, 0.5)
        twice = 2 * mi_lcair.signature(scene, tolerance=1e-3).target.intensity
        rows.append(row_of_shape(f"bodies {seed}, size", scene, "body", twice, lambda p: p))
    for seed in (1, 2):
        scene = bodies(seed, 0.5)
        _, truth = derivatives(scene, "body", None, SHAPE_TRUTH, seed=99)
        of_truth = standard_errors(truth.by_block)
        for run in tqdm(range(SHAPE_SEEDS), f"bodies {seed}"):
            _, result = derivatives(scene, "body", None, SHAPE_FEW, seed=run)
            half = np.hypot(
                student_factor(7) * standard_errors(result.by_block),
                student_factor(np.inf) * np.hypot(result.unscattered, of_truth),
            )
            near = np.abs(result.mean - truth.mean) <= half
            held, count = held + int(near.sum()), count + len(near)
    return {
        "shapes": "\n".join(rows),
        "shape_paths": SHAPE_PATHS,
        "shape_few": SHAPE_FEW,
        "shape_truth": SHAPE_TRUTH,
        "shape_seeds": 2 * SHAPE_SEEDS,
        "shape_held": f"{held} of {count}",
    }


def fine_edges() -> dict[str, object]:
    """Processor time and memory of the edges of a fine mesh."""
    corners, triangles = sphere(CAVITY[1], 224, 224)
    scene = scene_of(mesh("wall", corners, triangles, 0.5), max_bounces=2)
    surface, times = MovedMesh(scene, "wall"), []
    with scene.prepared() as tracer:
        for _ in range(3):
            start = process_time()
            paths = AttachedPaths(surface, scene.sensor(0), tracer, Choice(np.ones(len(triangles))))
            paths.contacts.meets_itself()
            times.append(process_time() - start)
    edges = vars(paths.edges).values()
    return {
        "triangles": len(triangles),
        "edge_time": f"{median(times):.1f}",
        "edge_bytes": round(sum(of.nbytes for of in edges) / len(paths.length)),
    }


def row_of_scene(name: str, parameters: dict, motion: str) -> str:
    """Row of a motion of a bundled scene: derivative, and variances of both kinds."""
    motions = MOTIONS if name == "a340_landing" else None
    scene = mi_lcair.load(name, motions=motions, **parameters)
    numbers = CommonNumbers(scene, Sampling(paths=MANY))
    intensity = numbers.render().mean("target")[0]
    differences = differences_of(numbers, motion)
    result, variances = differences.at(), {}
    differences.turning = []  # compare both kinds beside a kink as well
    for kind in differences.kinds():
        differences.aims[result.step, -result.step] = None  # on the film, evenly
        ends = differences.totals([result.step, -result.step], kind, MANY)
        high, low = map(differences.rows, ends)
        variance = np.sum((high[1:] - low[1:]) ** 2)
        variances[kind.method] = min(variance, variances.get(kind.method, np.inf))
    gain = variances[ON_FILM] / variances[ATTACHED]
    scaled = result.scaled(100 / intensity)
    value = f"{scaled.derivative:.3f} ± {scaled.error:.3f}"
    return (
        f"| {label(name, parameters)} | `{motion}` | {value} | "
        f"{result.step:.3g} | {result.verdict} | {gain:.0f} |"
    )


def pitch() -> dict[str, str]:
    """Change of the airliner's intensity with pitch by plain renders of turned models [%/deg]."""
    scene = mi_lcair.load("a340_landing", position=3, band="LWIR")
    present, result = mi_lcair.parameters(scene)[PITCH].value, {}
    for bounces in (1, 4):
        scene.mi.integrator().max_bounces = bounces
        values = []
        for change in (TURNED, -TURNED):
            with changed(scene, {PITCH: present + change}):
                values.append(mi_lcair.signature(scene, spp=SPP).target)
        high, low = (value.intensity for value in values)
        error = np.hypot(*(value.standard_error for value in values))
        factor = 100 / (2 * TURNED) / ((high + low) / 2)
        result[f"pitch_{bounces}"] = f"{factor * (high - low):.2f} ± {factor * error:.2f}"
    return result


def registration(folder: Path) -> dict[str, str]:
    """Errors and intervals of shifts, turn and pitch of a cube's image with noise, by draws."""
    convex_hull("cube", CUBE).write_ply(str(folder / "cube.ply"))
    (folder / "cube.xml").write_text(SCENE)
    scene, errors, stated = mi_lcair.load(folder / "cube.xml"), [], []
    with changed(scene, TRUTH):
        image = mi_lcair.render(scene, spp=2048, seed=77).channels["Y"].astype(float)
    for draw in tqdm(range(FRAMES), "images"):
        noise = np.random.default_rng(draw).normal(0, NOISE, image.shape)
        np.save(folder / "image.npy", image + noise)
        answers = mi_lcair.invert(problem(folder), advise=False).answers
        errors.append([answer.value - TRUTH[answer.label] for answer in answers])
        stated.append([answer.standard_error for answer in answers])
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    inside = int(np.sum(np.abs(errors) <= student_factor(np.inf) * np.array(stated)))
    low, high = binomtest(inside, FRAMES * len(TRUTH)).proportion_ci(method="wilson")
    return {
        "registered": "\n".join(
            f"| `{name}` | {error:.4f} | {of_name:.4f} |"
            for name, error, of_name in zip(TRUTH, rms, np.mean(stated, axis=0))
        ),
        "held": f"{inside} of {FRAMES * len(TRUTH)} ({100 * low:.0f}-{100 * high:.0f} %)",
    }


def kinks_of(points: np.ndarray) -> list[tuple[float, float, float]]:
    """Yaws at which a facet of a convex hull turns edge-on, and the derivatives on both sides.

    Those of which no other one is near, and whose derivatives differ by a tenth.
    """
    of = partial(facets_intensity, points, "yaw_deg")
    normals, roots = ConvexHull(points).equations[:, :3], []
    for normal, yaw in product(normals, np.arange(-30.0, 30.0)):
        toward = lambda x, n=normal: turned(n, x, "yaw_deg", np.zeros(3)) @ VIEW  # noqa: E731
        if toward(yaw) * toward(yaw + 1) < 0:
            roots.append(brentq(toward, yaw, yaw + 1, xtol=1e-12))
    alone = [x for x in roots if sum(abs(x - y) < 0.7 for y in roots) == 1]
    sides = [(x, (of(x) - of(x - H)) / H, (of(x + H) - of(x)) / H) for x in alone]
    return [side for side in sides if np.ptp(side[1:]) > 0.1 * np.abs(side[1:]).max()]


def kinks() -> dict[str, object]:
    """How many kinks beside poses are named, and how many intervals of both sides hold."""
    distances = np.geomspace(*KINK_DISTANCES, KINKS) * np.resize([1, -1], KINKS)
    places, seed, named, off = [], 0, 0, []
    while len(places) < KINKS:
        points = (0.5 * np.random.default_rng(seed).normal(size=(12, 3))).astype(np.float32)
        places += [(points.astype(float), *kink) for kink in kinks_of(points.astype(float))[:2]]
        seed += 1
    for seed, (distance, place) in enumerate(zip(distances, tqdm(places, "kinks"))):
        points, yaw, *sides = place
        scene = scene_of(convex_hull("body", points), window=4)
        with changed(scene, {"body.yaw_deg": yaw + distance}):
            result = mi_lcair.sensitivities(scene, ["body.yaw_deg"], paths=FEW, seed=seed)
        found = result.differences["body.yaw_deg"]
        named += found.verdict == "kink"
        off += [*np.abs(np.subtract(found.one_sided, sides)) / found.one_sided_errors]
    return {
        "kinks": KINKS,
        "named": named,
        "sides": 2 * KINKS,
        "sided": int(np.sum(np.array(off) < 1.96)),
    }


def budget() -> dict[str, float]:
    """Standard deviation of an intensity, by the budget and by draws that are rendered.

    The paths of all draws begin at the same points of facets.
    """
    scene = mi_lcair.load("a340_landing", motions=MOTIONS, position=1)
    result = mi_lcair.budget(scene, {"sigma": SIGMA}, spp=64)
    draws = np.random.default_rng(0).normal(size=(DRAWS, len(SIGMA))) * list(SIGMA.values())
    poses = [dict(zip(SIGMA, draw.tolist())) for draw in draws]
    camera, rows = scene.sensor(0), []
    windows, sampling = Windows.whole(camera), Sampling(paths=DRAW_PATHS)
    aims = starts_in(scene, camera, poses)
    for pose, aim in zip(poses, tqdm(aims, "draws")):
        with moved(scene, pose):
            total = measure(scene, windows, sampling, Measurands.of("target"), aim=aim)
        rows.append(mean_and_deviations(total, ["target"]) * window_area(camera, scene.name))
    values, deviations = np.array(rows)[:, 0], np.array(rows)[:, 1:]
    noise = np.sum((deviations - deviations.mean(axis=0)) ** 2) / (DRAWS - 1)
    return {
        "of_budget": float(result.sigma),
        "of_draws": float(np.sqrt(np.var(values, ddof=1) - noise)),
        "of_draws_error": float(100 / np.sqrt(2 * (DRAWS - 1))),
        "draw_noise": float(np.sqrt(noise)),
        "renders": result.renders,
    }


def main(page: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:
        closed = [row(case) for case in cases(Path(folder))]
        of_shapes = shapes(Path(folder))
        registered = registration(Path(folder))
    write_page(
        page,
        "motions",
        closed="\n".join(closed),
        scenes="\n".join(row_of_scene(*scene) for scene in SCENES),
        few=FEW,
        many=MANY,
        draws=DRAWS,
        frames=FRAMES,
        **of_shapes,
        **fine_edges(),
        **pitch(),
        **registered,
        **kinks(),
        **budget(),
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else PAGE)
