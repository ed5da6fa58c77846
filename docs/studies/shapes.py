"""Find shapes of bodies from silhouettes, and write the page docs/validation/shapes.md.

    python -m docs.studies.shapes [PAGE]

It takes about ten minutes.
"""

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tqdm import tqdm

import mi_lcair
from docs.studies.page import write_page
from mi_lcair import models3d
from mi_lcair.knowing.inversion.least_squares.newton import matern
from mi_lcair.plugins.emission.triangles import triangle_vertices, vertex_positions
from tests.rendering.motions.test_control_points import ball

PAGE = Path(__file__).parents[1] / "validation" / "shapes.md"
RADIUS, POINTS, VERTICES, FINE = 0.5, 24, 800, 2000
SPREAD, ALIKE = 0.06, 0.4  # prior of a control point, and its correlation length [m]
BUMPS, HEIGHT, NARROW = 3, 0.2, 2.5  # of the other bodies: number, height in radii, and 1 / width^2
SIGMA, BACKGROUND, PIXELS, VIEWS = 0.15, 37.25, 24, 8
SHAPES = 8
EXACT = {"camera_sigma": "0", "model_sigma": "0"}
CAMERA = f"""
<emitter type="constant"> <spectrum name="radiance" value="{BACKGROUND}"/> </emitter>
<sensor type="perspective"> <float name="fov" value="20"/>
    <transform name="to_world"> <lookat origin="4, 0, 0" target="0, 0, 0" up="0, 0, 1"/>
        <rotate y="-1" angle="$elevation_deg"/> <rotate z="1" angle="$azimuth_deg"/> </transform>
    <film type="hdrfilm"> <integer name="width" value="{PIXELS}"/>
        <integer name="height" value="{PIXELS}"/>
        <string name="pixel_format" value="luminance"/> <rfilter type="box"/> </film>
    <sampler type="lattice"> <integer name="sample_count" value="$spp"/> </sampler>
</sensor>"""
MOTIONS = {"blob.shape": {"groups": ["self"], "control_points": POINTS}}


def written(folder: Path, count: int, radius) -> Path:
    """The scene of a black body of 300 K. radius: function of directions (n, 3) [m]."""
    points, triangles = ball(count)
    unit = unit_of(points)
    lines = ["v {} {} {}".format(*point) for point in np.reshape(radius(unit), (-1, 1)) * unit]
    lines += ["o f*blackbody*300*blob", *("f {} {} {}".format(*t) for t in triangles + 1)]
    folder.with_suffix(".obj").write_text("\n".join(lines))
    models3d.export(models3d.read(folder.with_suffix(".obj")), folder)
    scene = folder / "scene.xml"
    text, end = scene.read_text(), "</sensor>"
    before, _, rest = text.partition('<sensor type="orthographic"')
    scene.write_text(before + CAMERA + rest.partition(end)[2])
    return scene


@dataclass(frozen=True)
class Found:
    """What an inversion found of a shape.

    errors: of the control points in standard errors, (n,). apart: distances to the truth [m].
    within: whether it did not say that the data contradict the model.
    """

    errors: np.ndarray
    apart: np.ndarray
    within: bool


def found(folder: Path, guess: Path, true: Path, given: dict, seed: int, exact=None) -> Found:
    """The shape from eight noisy views of a true scene.

    true, given: the true scene, and its parameters. exact: true radius in directions (n, 3); None
    if the truth is the guess with these values of the control points.
    """
    random, data = np.random.default_rng(seed), []
    for k in range(VIEWS):
        view = {"azimuth_deg": 360 / VIEWS * k, "elevation_deg": 25 * (-1) ** k}
        scene = mi_lcair.load(true, **given, **view)
        frame = mi_lcair.render(scene, spp=1024, seed=k).channels["Y"]
        np.save(folder / f"{seed}_{k}.npy", frame + random.normal(0, SIGMA, frame.shape))
        of_view = {"scene": str(guess), "parameters": view, "image": f"{folder}/{seed}_{k}.npy"}
        data.append(of_view | {"quantity": "radiance", "sigma": SIGMA, **EXACT})
    solution = mi_lcair.invert(
        {
            "data": data,
            "motions": MOTIONS,
            "unknowns": {"blob.shape": {"prior": [0, SPREAD], "correlation_m": ALIKE}},
            "render": {"spp": 32, "iterations": 20},
        },
        advise=False,
    )
    values = {answer.label: answer.value for answer in solution.answers}
    sigma = np.array([answer.standard_error for answer in solution.answers])
    scene = mi_lcair.load(guess, motions=given["motions"], **values, **view)
    points = surface(scene)
    if exact is None:
        known = np.array([given[label] for label in values])
        apart = np.linalg.norm(points - surface(mi_lcair.load(true, **given, **view)), axis=1)
    else:
        parameters = mi_lcair.parameters(scene)
        known = exact(unit_of([parameters[label].place for label in values])) - RADIUS
        apart = np.abs(np.linalg.norm(points, axis=1) - exact(unit_of(points)))
    return Found((np.array(list(values.values())) - known) / sigma, apart, solution.p_value > 0.05)


def surface(scene) -> np.ndarray:
    """Vertices of a scene's mesh and middles of its triangles, (n, 3) [m]."""
    mesh = scene.mi.shapes()[0]
    corners = vertex_positions(mesh).astype(float)
    return np.concatenate([corners, corners[triangle_vertices(mesh)].mean(axis=1)])


def unit_of(points) -> np.ndarray:
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def bumpy(random):
    """The radius of a body with some smooth bumps and hollows, as a function of directions."""
    at = unit_of(random.normal(size=(BUMPS, 3)))
    heights = random.uniform(-HEIGHT, HEIGHT, BUMPS)
    return lambda unit: RADIUS * (1 + np.exp(NARROW * (unit @ at.T - 1)) @ heights)


def row(name: str, results: list[Found]) -> str:
    errors = np.array([result.errors for result in results])
    apart = 1e3 * np.concatenate([result.apart for result in results])
    held = np.mean(np.abs(errors) < 1.96)
    return (
        f"| {name} | {len(results)} | {apart.mean():.1f} | {np.quantile(apart, 0.95):.1f} | "
        f"{np.sqrt(np.mean(errors**2)):.2f} | {100 * held:.0f} % of {errors.size} | "
        f"{sum(result.within for result in results)} |"
    )


def main(page: Path) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder, rows = Path(name), []
        guess = written(folder / "guess", VERTICES, lambda unit: np.full(len(unit), RADIUS))
        (folder / "motions.toml").write_text(
            f'[motions]\n"blob.shape" = {{groups = ["self"], control_points = {POINTS}}}\n'
        )
        motions = {"motions": folder / "motions.toml"}
        first = mi_lcair.load(guess, **motions, azimuth_deg=0, elevation_deg=0)
        places = {n: p.place for n, p in mi_lcair.parameters(first).items() if p.place}
        at = np.array(list(places.values()))
        alike = matern(np.linalg.norm(at[:, None] - at, axis=-1), ALIKE)
        results = []
        for seed in tqdm(range(SHAPES), "in the basis"):
            values = np.random.default_rng(seed).multivariate_normal(0 * at[:, 0], alike) * SPREAD
            given = motions | dict(zip(places, values.tolist()))
            results.append(found(folder, guess, guess, given, seed))
        rows.append(row("moved control points", results))
        results = []
        for seed in tqdm(range(SHAPES), "bumps"):
            exact = bumpy(np.random.default_rng(seed))
            true = written(folder / f"bumps_{seed}", FINE, exact)
            results.append(found(folder, guess, true, motions, 100 + seed, exact))
        rows.append(row("bumps and hollows", results))
    write_page(page, "shapes", rows="\n".join(rows), shapes=SHAPES)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else PAGE)
