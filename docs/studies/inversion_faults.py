"""Measure what `mi-lcair invert` says if the camera or the scene is not as the problem states.

    python -m docs.studies.inversion_faults [CASE[=DRAWS] ... | page] [workers=N | dask=ADDRESS]

Each case of `CASES` is a fault that no problem states. The script adds what it measures to
docs/validation/inversion/faults.json and writes docs/validation/inversion_faults.md from all that
is there. All cases take about ten minutes. With `page` the script measures nothing.
"""

import json
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
from mi_lcair.physics.bands import band
from mi_lcair.physics.blackbody import in_band_radiance, in_band_slope
from mi_lcair.rendering.parameters.values import changed
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
    kelvin = np.array(corner.KELVIN)
    per_share = in_band_radiance(LWIR, kelvin) / in_band_slope(LWIR, kelvin)
    hotter = kelvin + ASSUMED * random.normal(size=len(kelvin)) * per_share
    parts = clean(hotter)
    seen = [part for name, part in parts.items() if name != "Y"]
    shares = {str(k): (part / parts["Y"]).ravel() for k, part in enumerate(seen)}
    counts = np.ones((SIZE, SIZE), dtype=bool)
    faults = camera_faults(counts, ASSUMED, True, True).beside(group_errors(shares, ASSUMED))
    columns = faults.columns(parts["Y"].ravel())
    return parts["Y"] + (columns @ random.normal(size=columns.shape[1])).reshape(SIZE, SIZE)


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


CASES = exact, right, vignetting, gradient, gain, saturation, sky, neighbour
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
            channels = {
                name: of.astype(float)
                for name, of in image.channels.items()
                if name == "Y" or name.startswith("seen.")
            }
            if not is_right:
                return channels
            kept[key] = channels["Y"]
        return kept[key]

    sigma = corner.noise_of_netd(mi_lcair.load(path).band, clean(), corner.NETD_MK)
    for draw in draws:
        random = np.random.default_rng((draw, CASES.index(case), 40))
        image = case(clean, random)
        image = image + sigma * random.normal(size=image.shape)
        yield np.minimum(image, np.quantile(image, SATURATED)) if case is saturation else image


def of_case(case, draws: range) -> tuple[str, dict]:
    """Name of a case, and what inversions of its images say."""
    result = dict.fromkeys(("draws", "intervals", "held", "determined", "false", "missed"), 0)
    worst = 0.0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = write_scene(folder)
        for draw, image in zip(draws, images(case, path, draws)):
            np.save(folder / "image.npy", image)
            entry = {"scene": path, "image": str(folder / "image.npy"), "quantity": "radiance"}
            entry |= {"netd_mK": corner.NETD_MK, "parameters": {"size": SIZE}}
            tree = {
                "data": [entry],
                "unknowns": {name: {"start": 310.0} for name in corner.NAMES},
                "render": {"seed": draw, "spp": 64},
            }
            solution = mi_lcair.invert(tree, advise=False)
            result["draws"] += 1
            result["missed"] += solution.answers[0].verdict.startswith("not determined by")
            for answer, T in zip(solution.answers, corner.KELVIN):
                z = abs(answer.value - T) / answer.standard_error
                result["intervals"] += 1
                result["held"] += answer.lower <= T <= answer.upper
                result["determined"] += answer.is_determined
                result["false"] += answer.is_determined and z > FALSE
                worst = max(worst, z if answer.is_determined else 0.0)
    return case.__name__, result | {"worst": worst}


def row(name: str, of: dict) -> str:
    """A row of the page."""
    return (
        f"| `{name}` | {of['draws']} | {of['intervals']} | {of['held'] / of['intervals']:.1%} | "
        f"{of['missed']} | {of['determined']} | {of['worst']:.1f} | {of['false']} |"
    )


def main(*arguments: str) -> None:
    """Measure cases, and write the page. workers=N or dask=ADDRESS measures them at once."""
    known = json.loads(MEASURED.read_text(encoding="utf-8")) if MEASURED.exists() else {}
    wanted = dict(argument.partition("=")[::2] for argument in arguments)
    workers, dask = wanted.pop("workers", None), wanted.pop("dask", None)
    tasks = [
        partial(of_case, case, range(int(wanted.get(case.__name__) or DRAWS)))
        for case in CASES
        if not wanted or case.__name__ in wanted
    ]
    with mi_lcair.workers(workers and int(workers), dask):
        for name, of in in_order(tasks):
            known[name] = of
            print(row(name, of), flush=True)
            with replacing(MEASURED) as part:
                part.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
    names = [case.__name__ for case in CASES if case.__name__ in known]
    write_page(PAGE, "inversion_faults", rows="\n".join(row(n, known[n]) for n in names))


if __name__ == "__main__":
    main(*sys.argv[1:])
