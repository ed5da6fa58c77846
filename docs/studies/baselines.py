"""Try two simple methods on a data set, and write the page docs/validation/baselines.md.

    python -m docs.studies.baselines [FOLDER]

FOLDER is one that `mi-lcair dataset` has written, with truth. Its table is printed. Without a
FOLDER, a small data set of the box is made, and the page is written. That takes about a minute on
two cores.
"""

import json
import shutil
import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import mi_lcair
from docs.studies.page import write_page
from mi_lcair import models3d, scenes
from mi_lcair.cli.output import print_columns
from mi_lcair.physics.surroundings import Words
from mi_lcair.rendering.images.files import read_exr

PAGE = Path("docs/validation/baselines.md")
VIEWS, RANGE_M, WIDTH, HEIGHT = 12, 20, 64, 48
AROUND = {"sky": "clear", "ground": "288"}
CHANGES = {
    "camera.focal_length_mm": 8,
    "camera.width": WIDTH,
    "camera.height": HEIGHT,
    "render.tolerance": 0.003,
}
# What the first method guesses: emissivity of everything, and apparent temperature [K] of what it
# reflects, with standard uncertainties
EMISSIVITY, REFLECTED_K = (0.9, 0.05), (265.0, 15.0)
USED = 3  # views of the second method
FIRST_GUESS_K, SPREAD_K = 300.0, 30.0
FACTOR = 1.96  # half of a 95 % interval in standard deviations
TEMPERATURE, OF_SCENE = ".temperature", "target.parameters."
HEADING = ["method", "group", "pixels", "rms error K", "mean error K", "inside", "width K"]


@dataclass(frozen=True)
class Labelled:
    """An image of a data set with its truth.

    record: what is known of how it was made. counts: file of its frame. image, truth: channels.
    groups: names of the groups by their number in the truth.
    """

    record: Mapping
    counts: Path
    image: Mapping[str, np.ndarray]
    truth: Mapping[str, np.ndarray]
    groups: Mapping[int, str]

    @staticmethod
    def read(file: Path) -> "Labelled":
        """The image of a file of the folder `frames`."""
        record, folder, stem = json.loads(file.read_text("utf-8")), file.parents[1], file.stem
        legend = json.loads((folder / "truth" / f"{stem}.legend.json").read_text("utf-8"))
        return Labelled(
            record,
            folder / "images" / f"{stem}.png",
            read_exr(folder / "radiance" / f"{stem}.exr")[0],
            read_exr(folder / "truth" / f"{stem}.truth.exr")[0],
            {int(number): name for number, name in legend["group"].items()},
        )

    def pixels(self) -> Iterator[tuple[str, np.ndarray]]:
        """Yield each group and the pixels that it fills."""
        full = self.truth["mask.Y"] > 1 - 1e-6
        for number, name in self.groups.items():
            of_group = full & (self.truth["IndexGroup.X"] == number)
            # A pixel whose neighbours show the same group is free of the optics' blur
            inner = np.ones_like(of_group)
            for axis in (0, 1):
                for step in (-2, -1, 1, 2):
                    inner &= np.roll(of_group, step, axis)
            if (of_group & inner).any():
                yield name, of_group & inner


def small_set(folder: Path) -> Path:
    """Make a data set of the box between sky and ground; returns its folder."""
    examples = folder / "examples"
    shutil.copytree(scenes.FOLDER / "examples", examples)
    model = models3d.read(examples / "box.obj")
    models3d.export(model, examples / "box", around=Words(**AROUND))
    description = {
        "base": {"scenario": str(examples / "box.toml")},
        "views": {"sphere": VIEWS, "elevation_deg": [20, 70], "range_m": [RANGE_M]},
        "bands": {"LWIR": CHANGES},
        "splits": {"train": 0.5, "val": 0.0, "test": 0.5},
    }
    mi_lcair.dataset(description, folder / "set")
    return folder / "set"


def guessed(images: list[Labelled]) -> Callable:
    """The first method: one guess of emissivity and of reflected radiance, without air."""

    def answer(labelled: Labelled, group: str) -> tuple[np.ndarray, np.ndarray]:
        noise = np.random.default_rng(labelled.record["number"]).normal(
            size=labelled.image["noise_K.Y"].shape
        )
        kelvin = labelled.image["mean_temperature.Y"] + noise * labelled.image["noise_K.Y"]
        found = mi_lcair.temperature(
            kelvin, labelled.record["band_um"], emissivity=EMISSIVITY, reflected=REFLECTED_K
        )
        return found.kelvin, FACTOR * found.sigma

    return answer


def inverted(images: list[Labelled]) -> Callable:
    """The second method: temperatures of groups from the counts of the first USED views."""
    first, data, groups = images[:USED], [], set()
    for labelled in first:
        changes = labelled.record["changes"]
        known = {name: v for name, v in changes.items() if not name.endswith(TEMPERATURE)}
        data.append(
            {
                "scene": labelled.record["scenario"],
                "parameters": known,
                "image": str(labelled.counts),
                "quantity": "counts",
            }
        )
        groups |= {group for group, _ in labelled.pixels()}
    solution = mi_lcair.invert(
        {
            "data": data,
            "unknowns": {
                f"{group}{TEMPERATURE}": {
                    "start": FIRST_GUESS_K,
                    "prior": [FIRST_GUESS_K, SPREAD_K],
                }
                for group in sorted(groups)
            },
            "render": {"spp": 64},
        },
        advise=False,
    )

    def answer(labelled: Labelled, group: str) -> tuple[float, float]:
        estimate = solution[f"{group}{TEMPERATURE}"]
        return estimate.value, FACTOR * estimate.standard_error

    return answer


def scored(images: list[Labelled], method: Callable) -> Iterator[list[str]]:
    """Yield a row for each group: errors of the temperatures of pixels, and shares inside."""
    answer = method(images)
    errors, halves = defaultdict(list), defaultdict(list)
    for labelled in images[USED:]:
        for group, pixels in labelled.pixels():
            true = labelled.truth["true_temperature.Y"][pixels]
            kelvin, half = (
                np.broadcast_to(values, pixels.shape)[pixels] for values in answer(labelled, group)
            )
            errors[group].append(kelvin - true)
            halves[group].append(half)
    for group in sorted(errors):
        error, half = np.concatenate(errors[group]), np.concatenate(halves[group])
        yield [
            group,
            str(len(error)),
            f"{np.sqrt(np.mean(error**2)):.3g}",
            f"{np.mean(error):+.3g}",
            f"{100 * np.mean(np.abs(error) <= half):.0f} %",
            f"{2 * np.mean(half):.3g}",
        ]


def table(folder: Path) -> list[list[str]]:
    """The table of both methods on a data set, of its first band."""
    manifest = json.loads((folder / "manifest.json").read_text("utf-8"))
    files = sorted(folder.glob("**/frames/*.json"))
    images = [Labelled.read(file) for file in files if file.parent == files[0].parent]
    base = manifest["dataset"]["base"]["scenario"]
    for labelled in images:
        labelled.record["scenario"] = base
        labelled.record["band_um"] = labelled.record["changes"].get("sensor.band", "LWIR")
    methods = {"guess": guessed, "invert": inverted}
    return [[name, *row] for name, method in methods.items() for row in scored(images, method)]


def main(folder: Path | None = None) -> None:
    if folder is not None:
        print_columns([HEADING, *table(folder)])
        return
    with tempfile.TemporaryDirectory() as place:
        rows = table(small_set(Path(place)))
    lines = [f"| {' | '.join(row)} |" for row in [HEADING, ["---"] * len(HEADING), *rows]]
    write_page(
        PAGE,
        "baselines",
        table="\n".join(lines),
        views=VIEWS,
        used=USED,
        width=WIDTH,
        height=HEIGHT,
        range_m=RANGE_M,
        emissivity=EMISSIVITY,
        reflected=REFLECTED_K,
    )


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
