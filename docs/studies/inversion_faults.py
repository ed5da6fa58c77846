"""Measure what `mi-lcair invert` says if the camera or the scene is not as the problem states.

    python -m docs.studies.inversion_faults [CASE[=DRAWS] ... | page] [workers=N | dask=ADDRESS]

Each case of `CASES` is a fault that no problem states, and each case of `RIGHT` a right scene with
unknown poses, motions or heat modes. The script adds what it measures to
docs/validation/inversion/faults.json and writes docs/validation/inversion_faults.md from all that
is there. All cases take 20 minutes of processor time. With `page` the script measures nothing.
"""

import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

import mi_lcair
from docs.studies.page import write_page
from mi_lcair.files import replacing
from mi_lcair.knowing.inversion.data.nuisances import camera_faults, group_errors
from mi_lcair.knowing.inversion.data.readings import noise_of_netd
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance, in_band_slope
from mi_lcair.rendering.motions.table import motions_of
from mi_lcair.rendering.parameters.values import changed, load_with_values
from mi_lcair.tasks import in_order
from tests.knowing.inversion import corner

PAGE = Path("docs/validation/inversion_faults.md")
MEASURED = Path("docs/validation/inversion/faults.json")
SIZE = 24  # pixels along a side
SKY_K = 290.0
LWIR = band("LWIR")
SKY = """<shape type="sphere"> <float name="radius" value="20"/>
    <boolean name="flip_normals" value="true"/>
    <bsdf type="diffuse" id="black"> <spectrum name="reflectance" value="0"/> </bsdf>
    <emitter type="thermal"> <string name="band" value="$band"/>
    <float name="temperature" value="$sky"/> <string name="group" value="sky"/>
    <string name="facet_type" value="sky"/> </emitter> </shape> </scene>"""
FALSE = 3.0  # standard errors beyond which a verdict "determined" is false
DRAWS = 30
ASSUMED = 0.01  # standard deviation of the faults that inversions assume


def write_scene(folder: Path) -> str:
    """Write the corner under a sky; return its path."""
    path = Path(corner.write_scene(folder))
    text = path.read_text(encoding="utf-8").replace("</scene>", SKY)
    sky = f'<default name="sky" value="{SKY_K:g}"/> <default name="band"'
    path.write_text(text.replace('<default name="band"', sky), encoding="utf-8")
    return str(path)


def places() -> tuple[np.ndarray, np.ndarray]:
    """Coordinates of the pixels, -1 to 1 from left to right and from top to bottom."""
    at = (2 * np.arange(SIZE) + 1) / SIZE - 1
    return np.meshgrid(at, at)


def exact(clean, random) -> np.ndarray:
    """The image of a camera and a scene without faults."""
    return clean()


def right(clean, random) -> np.ndarray:
    """An image with faults of the sizes that inversions assume."""
    return with_faults(clean(hotter(corner.KELVIN, random)), random)


def hotter(kelvin, random) -> np.ndarray:
    """Temperatures (n,) whose blackbody radiances are wrong by the assumed size."""
    kelvin = np.array(kelvin)
    per_share = in_band_radiance(LWIR, kelvin) / in_band_slope(LWIR, kelvin)
    return kelvin + ASSUMED * random.normal(size=len(kelvin)) * per_share


def with_faults(parts: dict, random) -> np.ndarray:
    """An image with errors of the camera and of its parts that have the assumed sizes."""
    seen = [part for name, part in parts.items() if name != "Y"]
    total = np.maximum(parts["Y"], np.finfo(float).tiny)
    shares = {str(k): (part / total).ravel() for k, part in enumerate(seen)}
    counts = np.ones(parts["Y"].shape, dtype=bool)
    faults = camera_faults(counts, ASSUMED, True, True).beside(group_errors(shares, ASSUMED))
    columns = faults.columns(parts["Y"].ravel())
    return parts["Y"] + (columns @ random.normal(size=columns.shape[1])).reshape(counts.shape)


def radiances(image) -> dict:
    """The radiance of an image, and that of each part."""
    channels = image.channels.items()
    return {n: of.astype(float) for n, of in channels if n == "Y" or n.startswith("seen.")}


def vignetting(clean, random) -> np.ndarray:
    """An image that is 4 % darker at the corners."""
    x, y = places()
    return clean() * (1 - 0.04 * (x**2 + y**2) / 2)


def gradient(clean, random) -> np.ndarray:
    """An image whose gain changes by +-1 % from edge to edge."""
    angle = random.uniform(0, 2 * np.pi)
    x, y = places()
    return clean() * (1 + 0.01 * (x * np.cos(angle) + y * np.sin(angle)))


def gain(clean, random) -> np.ndarray:
    """An image whose gain is 1 % wrong."""
    return clean() * (1 + 0.01 * random.choice([-1, 1]))


def saturation(clean, random) -> np.ndarray:
    """An image whose brightest pixels are saturated (the camera's noise comes before)."""
    return clean()


def sky(clean, random) -> np.ndarray:
    """The image under a sky that is 20 K hotter or colder than stated."""
    return clean(sky=SKY_K + 20 * random.choice([-1, 1]))


def neighbour(clean, random) -> np.ndarray:
    """The image with one strip whose reflectance is 0.05 higher or lower than stated."""
    strip = f"R{random.integers(len(corner.KELVIN))}"
    return clean(**{strip: 0.3 + 0.05 * random.choice([-1, 1])})


FAULTS = exact, right, vignetting, gradient, gain, saturation, sky, neighbour
CASES = {case.__name__: case for case in FAULTS}
SATURATED = 0.9  # share of the pixels that are not saturated


def images(case, path: str, draws: range) -> Iterator[np.ndarray]:
    """Yield a noisy image of a case for each draw."""
    kept = {}

    def clean(kelvin=corner.KELVIN, **parameters):
        """The radiance, and with other temperatures also that of each part."""
        is_right = kelvin is corner.KELVIN
        if not is_right or (key := tuple(parameters.items())) not in kept:
            scene = mi_lcair.load(path, size=SIZE, **parameters)
            with changed(scene, dict(zip(corner.NAMES, kelvin))):
                image = mi_lcair.render(scene, spp=2**12, seed=99, parts=not is_right)
            if not is_right:
                return radiances(image)
            kept[key] = radiances(image)["Y"]
        return kept[key]

    sigma = corner.noise_of_netd(mi_lcair.load(path).band, clean(), corner.NETD_MK)
    for draw in draws:
        random = np.random.default_rng((draw, FAULTS.index(case), 40))
        image = case(clean, random)
        image = image + sigma * random.normal(size=image.shape)
        yield np.minimum(image, np.quantile(image, SATURATED)) if case is saturation else image


def of_corner(case, folder: Path, draws: range) -> Iterator[tuple[dict, dict]]:
    """Yield the problem of each draw of a case, and the truth."""
    path = write_scene(folder)
    for draw, image in zip(draws, images(case, path, draws)):
        unknowns = {name: {"start": 310.0} for name in corner.NAMES}
        tree = problem_of(folder, image, path, {"size": SIZE}, draw)
        yield tree | {"unknowns": unknowns}, dict(zip(corner.NAMES, corner.KELVIN))


def problem_of(folder: Path, image, path: str, parameters: dict, draw: int) -> dict:
    """A problem without unknowns, whose datum is an image in a file."""
    np.save(folder / "image.npy", image)
    entry = {"scene": path, "image": str(folder / "image.npy"), "quantity": "radiance"}
    entry |= {"netd_mK": corner.NETD_MK, "parameters": parameters}
    return {"data": [entry], "render": {"seed": draw, "spp": 64}}


# Right scenes: a box on its plate, whose pose, shape or heat is unknown
# ----------------------------------------------------------------------
EXAMPLES = Path("scenes/examples")
VIEW = {"azimuth_deg": 30, "elevation_deg": 40, "resolution": 32}
KELVIN = {"lid.temperature": 330.0, "self.temperature": 310.0}
SIDES = {"groups": ["self", "lid"]}
OWN = {"box.height": SIDES | {"scale": [0, 0, 1]}, "box.width": SIDES | {"scale": [1, 1, 0]}}
SOUGHT = "heat.h", "heat.absorptance"  # modes that are sought
CARRIED = (
    "emissivity",
    "sky_K",
    "air_K",
    "terrain.conductivity",
    *(f"{group}.model_K" for group in ("lid", "self", "terrain")),
)
MODES = [*SOUGHT, *(f"heat.{name}" for name in CARRIED)]
RIGHT = {  # half widths of the intervals in which true values lie, or standard deviations of modes
    "camera_pose": {"observer.x_px": 1.0, "observer.y_px": 1.0, "observer.roll_deg": 2.0},
    "target_pose": {"model.yaw_deg": 3.0, "model.pitch_deg": 2.0, "model.roll_deg": 2.0},
    "motions": {"box.height": 0.05, "box.width": 0.05, "lid.x_m": 0.1},
    "two_modes": dict.fromkeys(SOUGHT, 1.0),
    "all_modes": dict.fromkeys(MODES, 1.0),
}


def of_box(case: str, folder: Path, draws: range) -> Iterator[tuple[dict, dict]]:
    """Yield the problem of each draw of a right scene with faults of the assumed sizes."""
    shutil.copytree(EXAMPLES, folder, dirs_exist_ok=True)
    has_modes, path = case.endswith("modes"), str(folder / "box" / "scene.xml")
    for words in ("import box.obj -o box", "heat heat.toml -o noon.csv --hour 12"):
        subprocess.run(["mi-lcair", *words.split()], cwd=folder, check=True, capture_output=True)
    parameters = VIEW | ({"modes": str(folder / "noon.csv")} if has_modes else {})
    kelvin, own = {} if has_modes else KELVIN, OWN if case == "motions" else {}
    scene = load_with_values(path, parameters, motions=motions_of(own, folder))
    for draw in draws:
        random = np.random.default_rng((draw, list(RIGHT).index(case), 41))
        size = random.normal if has_modes else partial(random.uniform, -1)
        truth = {name: of * float(size()) for name, of in RIGHT[case].items()}
        actual = dict(zip(kelvin, hotter([*kelvin.values()], random).tolist()))
        with changed(scene, truth | actual):
            parts = radiances(mi_lcair.render(scene, spp=2**12, seed=99, parts=True))
        sigma = noise_of_netd(scene.band, parts["Y"], corner.NETD_MK)
        image = with_faults(parts, random) + sigma * random.normal(size=sigma.shape)
        sought = dict.fromkeys(SOUGHT if has_modes else truth | kelvin, {})
        tree = problem_of(folder, image, path, parameters, draw) | {"unknowns": sought}
        carried = {name: {"prior": [0, 1]} for name in truth if name not in sought}
        yield tree | {"nuisance": carried, "motions": own}, truth | kelvin


def of_case(case: str, draws: range) -> tuple[str, dict]:
    """Name of a case, and what inversions of its images say."""
    result = dict.fromkeys(
        ("draws", "intervals", "held", "determined", "false", "missed", "unfinished"), 0
    )
    worst = 0.0
    with tempfile.TemporaryDirectory() as name:
        of = of_box if case in RIGHT else of_corner
        for tree, truth in of(CASES.get(case, case), Path(name), draws):
            solution = mi_lcair.invert(tree, advise=False)
            result["draws"] += 1
            result["missed"] += solution.answers[0].verdict.startswith("not determined by")
            result["unfinished"] += not solution.converged
            for answer in solution.answers:
                z = abs(answer.value - truth[answer.name]) / answer.standard_error
                result["intervals"] += 1
                result["held"] += answer.lower <= truth[answer.name] <= answer.upper
                result["determined"] += answer.is_determined
                result["false"] += answer.is_determined and z > FALSE
                worst = max(worst, z if answer.is_determined else 0.0)
    return case, result | {"worst": worst}


def row(name: str, of: dict) -> str:
    """A row of the page."""
    return (
        f"| `{name}` | {of['draws']} | {of['intervals']} | {of['held'] / of['intervals']:.1%} | "
        f"{of['missed']} | {of['determined']} | {of['worst']:.1f} | {of['false']} |"
        + (f" {of['unfinished']} |" if name in RIGHT else "")
    )


def main(*arguments: str) -> None:
    """Measure cases, and write the page. workers=N or dask=ADDRESS measures them at once."""
    known = json.loads(MEASURED.read_text(encoding="utf-8")) if MEASURED.exists() else {}
    wanted = dict(argument.partition("=")[::2] for argument in arguments)
    workers, dask = wanted.pop("workers", None), wanted.pop("dask", None)
    tasks = [
        partial(of_case, case, range(int(wanted.get(case) or DRAWS)))
        for case in [*CASES, *RIGHT]
        if not wanted or case in wanted
    ]
    with mi_lcair.workers(workers and int(workers), dask):
        for name, of in in_order(tasks):
            known[name] = of
            print(row(name, of), flush=True)
            with replacing(MEASURED) as part:
                part.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
    rows, right = (
        "\n".join(row(name, known[name]) for name in names if name in known)
        for names in (CASES, RIGHT)
    )
    write_page(PAGE, "inversion_faults", rows=rows, right=right)


if __name__ == "__main__":
    main(*sys.argv[1:])
