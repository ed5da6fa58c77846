"""A data set in its folder: recorded view by view, resumed, and described by manifest and card."""

import json
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mi_lcair import scenes, toml_table
from mi_lcair.detection.camera.image import Shot
from mi_lcair.detection.datasets.description import DatasetDescription, is_choice
from mi_lcair.detection.datasets.draws import HEAT, Case, HeatedHours, cases_of, check_views, key_of
from mi_lcair.detection.datasets.frames import (
    FOLDERS,
    IN_KELVIN,
    MODES,
    OF_TRUTH,
    Plan,
    ViewRecorder,
    digest_of,
    text_of,
    write_json,
)
from mi_lcair.detection.datasets.poses import SPLITS, colmap, transforms
from mi_lcair.detection.scenario import OF_SCENE, Scenario
from mi_lcair.detection.setting import line_of, setting_of, sun_over, target_scene
from mi_lcair.drawing import file_content, new_figure, styled
from mi_lcair.errors import InputError, errors_of
from mi_lcair.files import (
    PART,
    check_writable,
    parse_json,
    parse_toml,
    read_bytes,
    read_text,
    write_bytes,
)
from mi_lcair.formats import write_png
from mi_lcair.heating.temperatures.heat_result import write_csv
from mi_lcair.progress import Progress
from mi_lcair.rendering.images.files import read_exr
from mi_lcair.rendering.parameters.values import whole_path
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.views import corners, model_shapes
from mi_lcair.results import Result, summary_of
from mi_lcair.tasks import computed, versions

MANIFEST, TRANSFORMS = "manifest.json", "transforms.json"
KIND = "mi_lcair data set"
MOVING = ("pose.", "motions.", f"{OF_SCENE}model.")  # beginnings of draws that move the model
MOVED = (
    "[draws] moves the model, but points3D.txt has it at the place that [base] gives; methods "
    "that assume a fixed scene need images of one pose"
)
LIMITS = {
    "is_cut": "a part of the target is outside the frame",
    "saturated_share": "the detector is saturated; shorten integration_time_ms of [camera], or "
    "widen span_K of a bolometer",
    "speckle_share": "the rendering's error is above the camera's noise, as speckle.Y marks; raise "
    "spp of [render], or give to_noise = true instead",
}


@dataclass(frozen=True, repr=False)
class LabelledFrames(Result):
    """A complete data set.

    Attributes
    ----------
    name : str
        Name of its description.
    folder : str
    views, images : int
        Number of views, and of images in all bands.
    bands : tuple of str
        Names of the bands; one without a name if the description has none.
    splits : dict of str to int
        Number of views of each split.
    traced : int
        Number of views that this call traced.
    files, bytes : int
        Number of all files, and their size.
    remarks : list of str
    seconds : float
        Time of this call, s.
    """

    name: str
    folder: str
    views: int
    images: int
    bands: tuple[str, ...]
    splits: dict[str, int]
    traced: int
    files: int
    bytes: int
    remarks: list[str]
    seconds: float

    kind = "dataset"
    heading = "Data set"

    def summary(self) -> str:
        """One line with the numbers of views, images and files."""
        splits = ", ".join(f"{count} {split}" for split, count in self.splits.items())
        bands = f" in {', '.join(self.bands)}" if any(self.bands) else ""
        return (
            f"data set {self.name}: {self.views} views ({splits}), {self.images} images{bands}, "
            f"{self.traced} traced now, {self.files} files of {self.bytes / 1e6:.4g} MB in "
            f"{self.folder}"
        )

    def facts(self) -> Iterator[Any]:
        """The numbers in one line."""
        yield summary_of(self)


def record_dataset(
    description: DatasetDescription, folder: Path, progress: Progress | None = None
) -> LabelledFrames:
    """Record all images of a data set into a folder, those which are not there yet.

    Everything is checked before the first render. progress: called with (views done, all views).
    """
    start = time.perf_counter()
    scenario = based(description)
    scene = target_scene(scenario, scenario.sensor.detector())
    stated = stated_of(description, scene)
    check_folder(folder, stated)
    cases, hours = cases_of(description, scenario, scene), None
    if description.base.heat is not None:
        hours = HeatedHours.of(description.base.heat, scene)
        cases = [hours.applied(case, scenario) for case in cases]
    frames = description.frames
    plan = Plan(
        folder=folder.resolve(),
        home=Path.cwd(),
        source=whole_path(description.base.scenario),
        bands=description.bands,
        cases=tuple(cases),
        frames=frames.frames,
        seed=frames.seed,
        truth=frames.truth,
        kelvin=frames.kelvin,
    )
    check_plan(plan, description, scene)
    begin(plan, stated, hours)
    views: dict[int, list[Case]] = {}
    for case in cases:
        views.setdefault(case.view, []).append(case)
    missing = [of_view for of_view in views.values() if not plan.has(of_view)]
    recorder, traced, known = ViewRecorder(plan), 0, len(views) - len(missing)
    if progress:
        progress(known, len(views))
    tasks = [partial(recorder.view, tuple(of_view)) for of_view in missing]
    for done, (_, traces) in enumerate(computed(tasks), known + 1):
        traced += traces
        if progress:
            progress(done, len(views))
    records = {band: [plan.record(case, band) for case in cases] for band in plan.bands}
    points = points_of(scene)
    written = [
        file for band in plan.bands for file in write_poses(plan, band, records[band], points)
    ]
    if plan.truth:
        written += [file for band in plan.bands for file in write_coco(plan, band)]
    remarks = remarks_of([record for of_band in records.values() for record in of_band])
    if moves(plan):
        remarks.append(MOVED)
    written += write_card(plan, description, scenario, records, remarks)
    files = write_manifest(plan, stated, records, written, hours)
    return LabelledFrames(
        name=description.name,
        folder=str(folder),
        views=len(views),
        images=len(cases) * len(plan.bands),
        bands=tuple(plan.bands),
        splits=dict(Counter(of_view[0].split for of_view in views.values())),
        traced=traced,
        files=len(files) + 1,
        bytes=sum(entry["bytes"] for entry in files.values()),
        remarks=remarks,
        seconds=time.perf_counter() - start,
    )


def based(description: DatasetDescription) -> Scenario:
    """The scenario of [base] in its first band; raises InputError for one without poses."""
    source, band = description.base.scenario, next(iter(description.bands.values()))
    scenario = Scenario.read(source, **band)
    with errors_of(f"scenario '{source}'"):
        check_has_pose(scenario)
    return scenario


def check_has_pose(scenario: Scenario) -> None:
    """Raise InputError for a scenario without a camera whose pose is known."""
    if scenario.camera is None:
        raise InputError("has no table [camera], which records the images")
    if scenario.camera.projection != "perspective":
        raise InputError(
            "[camera]: an orthographic camera has no pose in the files of a data set; leave "
            "projection out"
        )
    if scenario.flight is not None:
        raise InputError("[flight] moves the camera, as [views] does; give an [observer]")


def stated_of(description: DatasetDescription, scene: Scene) -> dict:
    """What a data set is made from, as its manifest has it."""
    base = description.base
    suffix = Path(base.scenario).suffix
    of_scenario = Path(base.scenario) if suffix else scenes.scenario_path(base.scenario)
    trees = {
        name: None if file is None else parse_toml(read_text(file), str(file))
        for name, file in (("scenario", of_scenario), ("heat", base.heat))
    }
    views = description.views.file
    return {
        "kind": KIND,
        "name": description.name,
        "dataset": description.tree,
        **trees,
        "views_sha256": None if views is None else digest_of(read_bytes(views)),
        "scene": scene.name,
        "scene_fingerprint": scene.fingerprint,
        "versions": versions(),
    }


def check_folder(folder: Path, stated: Mapping) -> None:
    """Raise InputError for a folder that cannot be written, or that holds something else."""
    if folder.exists() and not folder.is_dir():
        raise InputError(f"'{folder}' is no folder; name a folder for the data set")
    if not folder.absolute().parent.is_dir():
        raise InputError(f"cannot make '{folder}': its folder does not exist; create it first")
    check_writable((folder if folder.exists() else folder.absolute().parent) / MANIFEST)
    if not folder.exists():
        return
    names = [file.name for file in folder.iterdir() if not file.name.endswith(PART)]
    if not names:
        return
    file = folder / MANIFEST
    held = parse_json(read_text(file), str(file)) if MANIFEST in names else None
    if not isinstance(held, dict) or held.get("kind") != KIND:
        raise InputError(f"'{folder}' contains other files; name a new or an empty folder")
    for name, value in json.loads(text_of(dict(stated))).items():
        if held.get(name) != value:
            raise InputError(
                f"'{folder}' contains another data set, with other {name.replace('_', ' ')}; "
                "name another folder, or remove this one"
            )


def begin(plan: Plan, stated: Mapping, hours: HeatedHours | None) -> None:
    """Make the folder with what a resumed call compares, and the temperatures of all hours."""
    plan.folder.mkdir(exist_ok=True)
    if not (plan.folder / MANIFEST).exists():
        write_json(plan.folder / MANIFEST, stated)
    if hours is not None:
        (plan.folder / HEAT).mkdir(exist_ok=True)
        for case in plan.cases:
            file = plan.folder / case.changes[MODES]
            if not file.exists():
                write_csv(file, hours.heat, case.hour)
    for band in plan.bands:
        for kind in FOLDERS + OF_TRUTH * plan.truth + (IN_KELVIN,) * plan.kelvin:
            (plan.folder / band / kind).mkdir(parents=True, exist_ok=True)


def check_plan(plan: Plan, description: DatasetDescription, scene: Scene) -> None:
    """Raise InputError for an image whose scenario, chosen words or view are not possible."""
    choices = [key_of(name) for name, law in description.draws.items() if is_choice(law)]
    scenarios: dict[int, Scenario] = {}
    seen: set[tuple] = set()
    for case in plan.cases:
        scenario = plan.scenario(without_modes(case), next(iter(plan.bands)))
        new = {(name, case.changes[name]) for name in choices if name in case.changes} - seen
        with errors_of(f"view {case.view}"):
            check_has_pose(scenario)
            if new:
                setting_of(scenario)
            if case.view not in scenarios:
                line_of(scenario, scenario.sensor.detector(), sun_over(scenario, scene))
        scenarios.setdefault(case.view, scenario)
        seen |= new
    first = without_modes(plan.cases[0])
    for band in plan.bands:
        scenario = plan.scenario(first, band)
        with errors_of("view 0"):
            check_has_pose(scenario)
            Shot.of(scenario, plan.seed)
    if not moves(plan):
        check_views(scene, scenarios)


def moves(plan: Plan) -> bool:
    """Whether the model is elsewhere in some images than in others."""
    return any(name.startswith(MOVING) for case in plan.cases for name in case.changes)


def without_modes(case: Case) -> Case:
    """A case without the file of its facets' temperatures, which is not written yet."""
    return replace(case, changes={k: v for k, v in case.changes.items() if k != MODES})


def points_of(scene: Scene) -> np.ndarray:
    """Corners of the model's facets in the file's coordinates, (n, 3) [m]."""
    points = np.concatenate([corners(shape) for shape in model_shapes(scene)])
    return np.unique(points, axis=0) + scene.origin


def write_poses(plan: Plan, band: str, records: list, points: np.ndarray) -> list[Path]:
    """Write transforms.json and COLMAP's text files of a band; returns them."""
    folder = plan.folder / band
    ends = {"file_path": ("images", ".png")}
    if plan.truth:
        ends |= {"mask_path": ("masks", ".png"), "depth_file_path": ("depth", ".npy")}
    paths = [
        {
            name: plan.place(band, kind, case.number, end).relative_to(folder).as_posix()
            for name, (kind, end) in ends.items()
        }
        for case in plan.cases
    ]
    sparse = folder / "sparse" / "0"
    sparse.mkdir(parents=True, exist_ok=True)
    write_json(folder / TRANSFORMS, transforms(records, paths))
    names = [Path(of["file_path"]).name for of in paths]
    texts = colmap(records, names, points)
    for name, text in texts.items():
        write_bytes(sparse / name, text.encode())
    return [folder / TRANSFORMS, *(sparse / name for name in texts)]


def write_coco(plan: Plan, band: str) -> list[Path]:
    """Write the annotations of a band by split, from those of its images; returns the files."""
    written = []
    for split in SPLITS:
        whole: dict[str, list] = {"images": [], "annotations": [], "categories": []}
        for case in plan.cases:
            if case.split == split:
                file = plan.place(band, "truth", case.number, ".coco.json")
                part = json.loads(file.read_text("utf-8"))
                whole["images"] += part["images"]
                whole["categories"] = part["categories"]
                for annotation in part["annotations"]:
                    number = len(whole["annotations"]) + 1
                    whole["annotations"].append(annotation | {"id": number})
        written.append(plan.folder / band / f"coco_{split}.json")
        write_json(written[-1], whole)
    return written


def remarks_of(records: list[Mapping]) -> list[str]:
    """Remarks on the limits of a data set, one line each."""
    count = len(records)
    lines = list(dict.fromkeys(line for record in records for line in record["remarks"]))
    for key, text in LIMITS.items():
        if some := sum(bool(record[key]) for record in records):
            most = 100 * max(record[key] for record in records)
            share = f" and up to {most:.2g} % of their pixels" if key.endswith("_share") else ""
            lines.append(f"in {some} of {count} images{share} {text}")
    return lines


def write_manifest(
    plan: Plan, stated: Mapping, records: Mapping, written: list[Path], hours
) -> dict[str, dict]:
    """Write the manifest with the checksums of all files, which are returned by name."""
    digests: dict[str, str] = {}
    for band, of_band in records.items():
        for case, record in zip(plan.cases, of_band):
            digests |= record["files"]
            written.append(plan.place(band, "frames", case.number, ".json"))
    if hours is not None:
        written += [plan.folder / case.changes[MODES] for case in plan.cases]
    for file in written:
        digests[file.relative_to(plan.folder).as_posix()] = digest_of(file.read_bytes())
    files = {
        name: {"sha256": digest, "bytes": (plan.folder / name).stat().st_size}
        for name, digest in sorted(digests.items())
    }
    write_json(plan.folder / MANIFEST, {**stated, "images": len(plan.cases), "files": files})
    return files


# The card of a data set: a README with what it holds, how it was made, and pictures
# ----------------------------------------------------------------------------------

CARD, CONTACT, STATISTICS = "README.md", "contact.png", "statistics.png"
SHOWN = 12  # images of a band on the contact sheet
COLUMNS, TILE = 4, 200  # of the sheet, and pixels across an image on it
BARS = 40
KELVIN = "mean_temperature.Y"


def write_card(
    plan: Plan,
    description: DatasetDescription,
    scenario: Scenario,
    records: Mapping[str, Sequence[Mapping]],
    remarks: Sequence[str],
) -> list[Path]:
    """Write the README of a data set and its pictures; returns the files."""
    places = np.linspace(0, len(plan.cases) - 1, min(SHOWN, len(plan.cases))).round().astype(int)
    kelvin = {
        (band, number): read_exr(plan.place(band, "radiance", number, ".exr"))[0][KELVIN]
        for band in plan.bands
        for number in dict.fromkeys(places.tolist())
    }
    ranges = [record["range_m"] for record in next(iter(records.values()))]
    write_png(plan.folder / CONTACT, contact_sheet([*kelvin.values()]))
    contents = {
        STATISTICS: file_content(histograms(kelvin, ranges), ".png"),
        CARD: text_of_card(plan, description, scenario, records, remarks).encode(),
    }
    for name, content in contents.items():
        write_bytes(plan.folder / name, content)
    return [plan.folder / name for name in (CONTACT, *contents)]


def contact_sheet(images: Sequence[np.ndarray]) -> np.ndarray:
    """Images side by side in colours from the least to the largest value of each, (H, W, 3)."""
    import matplotlib

    height = max(image.shape[0] for image in images)
    width = max(image.shape[1] for image in images)
    larger, smaller = -(-TILE // width), max(width // TILE, 1)
    tiles = []
    for image in images:
        share = (image - image.min()) / (np.ptp(image) or 1)
        tile = np.pad(
            matplotlib.colormaps["inferno"](share)[..., :3],
            [(0, height - image.shape[0]), (0, width - image.shape[1]), (0, 0)],
        )
        tiles.append(np.kron(tile[::smaller, ::smaller], np.ones((larger, larger, 1))))
    tiles += [np.zeros_like(tiles[0])] * (-len(tiles) % COLUMNS)
    rows = [np.hstack(tiles[k : k + COLUMNS]) for k in range(0, len(tiles), COLUMNS)]
    return (255 * np.vstack(rows)).astype(np.uint8)


@styled
def histograms(kelvin: Mapping[tuple[str, int], np.ndarray], ranges: Sequence[float]):
    """Histograms of apparent temperature, of the images shown, and of range, of all."""
    figure = new_figure((8, 3), 100)
    left, right = figure.subplots(1, 2, gridspec_kw={"bottom": 0.2})
    for band in dict.fromkeys(band for band, _ in kelvin):
        values = [image.ravel() for (of, _), image in kelvin.items() if of == band]
        left.hist(np.concatenate(values), BARS, histtype="step", label=band or " ", log=True)
    left.set(xlabel="apparent temperature, K", ylabel="pixels")
    left.legend()
    right.hist(ranges, BARS)
    right.set(xlabel="range, m", ylabel="images")
    return figure


FILES = {
    "images/NUMBER.png": "counts of a frame with noise, 16 bits; `NUMBER_1.png` is the second one",
    "radiance/NUMBER.exr": "without noise: radiance at the aperture in W m^-2 sr^-1, electrons, "
    "apparent temperature and its standard error in K",
    "frames/NUMBER.json": "changes of the scenario, pose, seeds, checksums",
    "transforms.json": "poses and splits as nerfstudio reads them, with the axes of OpenGL",
    "sparse/0/*.txt": "the same poses as COLMAP writes them, and the corners of the model",
}
FILES_IN_KELVIN = {
    "kelvin/NUMBER.png": "apparent temperature of the same frame in hundredths of a kelvin, "
    "16 bits, by the camera's calibration; 65535 for 655.35 K and more",
}
FILES_OF_TRUTH = {
    "truth/NUMBER.*": "truth of each pixel: facet, group, material and instance, depth, normal, "
    "temperature, emissivity, and parts of the radiance with standard errors",
    "masks/NUMBER.png": "the target: 255 where it is seen",
    "depth/NUMBER.npy": "distance along the camera's axis in mm; 0 for none",
    "coco_SPLIT.json": "boxes and masks of visible groups, in COCO's format",
}


def text_of_card(
    plan: Plan,
    description: DatasetDescription,
    scenario: Scenario,
    records: Mapping[str, Sequence[Mapping]],
    remarks: Sequence[str],
) -> str:
    """The README, in Markdown."""
    everything = [record for of_band in records.values() for record in of_band]
    splits = [*{case.view: case.split for case in plan.cases}.values()]
    counts = ", ".join(f"{n} {name}" for name in SPLITS if (n := splits.count(name)))
    coldest = min(record["temperature_K"][0] for record in everything)
    hottest = max(record["temperature_K"][2] for record in everything)
    pixels = [record["pixels_on_target"] for record in everything]
    camera, bands = scenario.camera, ", ".join(filter(None, plan.bands)) or scenario.sensor.band
    files = (
        FILES | (FILES_IN_KELVIN if plan.kelvin else {}) | (FILES_OF_TRUTH if plan.truth else {})
    )
    place = "Each band has its own folder." if any(plan.bands) else "All is in this folder."
    made_by = ", ".join(f"{name} {version}" for name, version in versions().items())
    parts = [
        f"# {description.name}",
        f"{len(splits)} views ({counts}) of {scenario.heading.rstrip('.')}. {len(everything)} "
        f"images in "
        f"{bands}, {camera.width} x {camera.height} pixels.",
        f"![images]({CONTACT})",
        "Some images in apparent temperature, each with its own scale.",
        f"Apparent temperatures are {coldest:.4g} to {hottest:.4g} K, and the target has "
        f"{min(pixels):.3g} to {max(pixels):.3g} pixels.",
        f"![histograms]({STATISTICS})",
        f"## Files\n\n{place} `manifest.json` has the checksums of all files and the description.",
        "\n".join(
            ["| file | content |", "|---|---|"]
            + [f"| `{name}` | {text} |" for name, text in files.items()]
        ),
        "## How it was made",
        f"```toml\n{toml_table.text_of(description.tree).strip()}\n```",
        f"Versions: {made_by}.",
        *(["## Remarks", "\n".join(f"- {remark}" for remark in remarks)] if remarks else []),
    ]
    return "\n\n".join(parts) + "\n"
