"""The frames of a view with their truth, traced once where geometry and reflection stay."""

import json
import pickle
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from mi_lcair.detection.camera.electronics import Camera, saturated
from mi_lcair.detection.camera.exposure import WindowPaths, exposure_of
from mi_lcair.detection.camera.image import Shot
from mi_lcair.detection.datasets.draws import MODES, OF_CAMERA, Case, seed_of
from mi_lcair.detection.datasets.poses import pose_of
from mi_lcair.detection.scenario import Scenario
from mi_lcair.detection.setting import target_scene
from mi_lcair.errors import errors_of
from mi_lcair.files import together, write_bytes
from mi_lcair.formats import write_png
from mi_lcair.plugins.bsdfs.reflection_bsdf import has_spectral_materials
from mi_lcair.rendering.images.files import write_exr
from mi_lcair.rendering.images.truth import Truth
from mi_lcair.rendering.parameters.values import changed
from mi_lcair.rendering.scene import Scene
from mi_lcair.tasks import exclusively, kept
from mi_lcair.toml_table import plain

# Folders of a band's files
FOLDERS = ("images", "radiance", "frames")
IN_KELVIN = "kelvin"  # folder of frames in hundredths of a kelvin
OF_TRUTH = ("truth", "masks", "depth")
SCENES = 8  # loaded scenes that are kept
OF_NOISE = ("counts.Y", "temperature.Y")  # channels that belong to a frame with noise
MM = np.float32(1e3)  # depth in mm, as nerfstudio reads it
TEMPERATURE = ".temperature"  # end of the names of parameters that need no other trace


@dataclass(frozen=True)
class Plan:
    """What a data set consists of, and where it is written.

    Attributes
    ----------
    folder, home : Path
        Whole paths of the data set, and of the folder to which files in changes are relative.
    source : str
        The scenario.
    bands : dict of str to dict
        Changes of the scenario by band.
    cases : tuple of Case
    frames, seed : int
        Frames of an image, and the seed of the camera.
    truth, kelvin : bool
    """

    folder: Path
    home: Path
    source: str
    bands: Mapping[str, Mapping[str, Any]]
    cases: tuple[Case, ...]
    frames: int
    seed: int
    truth: bool
    kelvin: bool = False

    def place(self, band: str, kind: str, number: int, end: str) -> Path:
        """A file of an image."""
        return self.folder / band / kind / f"{number:06}{end}"

    def scenario(self, case: Case, band: str) -> Scenario:
        """The scenario of an image in a band, with the files of the folder."""
        changes = case.changes | dict(self.bands[band])
        for name, value in changes.items():
            home = self.folder if name == MODES else self.home
            if isinstance(value, str) and (home / value).is_file():
                changes[name] = str(home / value)  # a worker has another working folder
        with errors_of(f"view {case.view}"):
            return Scenario.read(self.source, **changes)

    def has(self, cases: Sequence[Case]) -> bool:
        """Whether all images of some cases are there and whole."""
        return all(self.record(case, band) is not None for case in cases for band in self.bands)

    def record(self, case: Case, band: str) -> dict | None:
        """What is recorded of an image whose files are all there and whole; None otherwise."""
        try:
            text = self.place(band, "frames", case.number, ".json").read_text("utf-8")
            record = json.loads(text)
            whole = all(
                digest_of((self.folder / name).read_bytes()) == digest
                for name, digest in record["files"].items()
            )
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return None
        return record if whole else None


class ViewRecorder:
    """Records the images of a plan, and keeps the scenes that it has loaded."""

    def __init__(self, plan: Plan):
        self.plan = replace(plan, cases=())  # which a worker need not know
        self.scenes: dict[str, Scene] = {}
        self.paths: dict[str, tuple[WindowPaths, int]] = {}  # of the present view

    def __reduce__(self) -> tuple:
        return recorder, (pickle.dumps(self.plan),)

    @exclusively
    def view(self, cases: Sequence[Case]) -> int:
        """Record all images of a view; returns how often it was traced."""
        self.paths, traces = {}, 0
        for case in cases:
            for band in self.plan.bands:
                with errors_of(f"view {case.view}"):
                    traces += self.image(case, band)
        return traces

    def image(self, case: Case, band: str) -> int:
        """Write the files of an image in a band, all or none; returns how often it was traced."""
        scenario = self.plan.scenario(case, band)
        scene, values = self.loaded(scenario)
        seed = seed_of(self.plan.seed, OF_CAMERA, list(self.plan.bands).index(band))
        with changed(scene, values):
            shot = Shot.of(scenario, seed, scene)
            (paths, bounces), is_new = self.traced(shot, scene, values)
            exposed = exposure_of(paths, *shot.arguments)
            _, channels, _ = shot.developed(exposed, 1)
            header = {"scenario": scenario.name, **shot.setting.detector.band.header}
            truth = shot.truth(exposed, header) if self.plan.truth else None
        with together() as waiting:
            self.write(case, band, shot.camera, channels, header)
            if truth is not None:
                self.write_truth(case, band, truth)
            files = {
                str(file.relative_to(self.plan.folder)): digest_of(partial.read_bytes())
                for partial, file in waiting.items()
            }
            record = {
                "number": case.number,
                "view": case.view,
                "split": case.split,
                "band": band,
                "changes": case.changes | dict(self.plan.bands[band]),
                "hour": case.hour,
                "camera_seed": seed,
                "first_frame": case.number * self.plan.frames,
                "max_bounces": bounces,
                "spp": exposed.spp,
                **pose_of(shot.view, scene.origin),
                **statistics(shot, channels, exposed),
                "remarks": [*scene.notes, *shot.scenery.missing()],
                "files": dict(sorted(files.items())),
            }
            write_json(self.plan.place(band, "frames", case.number, ".json"), record)
        return is_new

    def write(self, case: Case, band: str, camera: Camera, channels: dict, header: dict) -> None:
        """Write an image with and without noise."""
        place, frames = partial(self.plan.place, band, number=case.number), self.plan.frames
        for k in range(frames):
            counts = camera.frame(channels[f"{camera.imager.channel}.Y"], case.number * frames + k)
            end = f"_{k}.png" if k else ".png"
            write_png(place("images", end=end), counts)
            if self.plan.kelvin:
                write_png(place(IN_KELVIN, end=end), hundredths(camera.temperatures(counts)))
        without = {name: v for name, v in channels.items() if name not in OF_NOISE}
        write_exr(place("radiance", end=".exr"), without, header)

    def write_truth(self, case: Case, band: str, truth: Truth) -> None:
        """Write the truth of an image: its layers, and mask and depth as nerfstudio reads them."""
        place = partial(self.plan.place, band, number=case.number)
        stem, image = place("truth", end=""), f"images/{case.number:06}.png"
        coco = Path(f"{stem}.coco.json")
        for file, write in truth.files(stem).items():
            if file != coco:
                write(file)
        write_json(coco, truth.coco(image, case.number + 1))
        write_png(place("masks", end=".png"), 255 * truth.mask_of_target().astype(np.uint8))
        content = BytesIO()
        np.save(content, MM * truth.channels["Depth.Z"])
        write_bytes(place("depth", end=".npy"), content.getvalue())

    def loaded(self, scenario: Scenario) -> tuple[Scene, dict[str, float]]:
        """The scene of a scenario without values of its parameters, and these values."""
        target, values = scenario.target, {}
        if target.solution is None:  # which would replace the values
            values = {name: value for name, value in target.parameters.items() if "." in name}
            rest = {name: v for name, v in target.parameters.items() if name not in values}
            scenario = replace(scenario, target=replace(target, parameters=rest))
        parts = ("target", "pose", "motions", "surroundings", "plugins")
        of_sensor = scenario.sensor.band, scenario.sensor.response, scenario.render.lobe
        key = repr([*(getattr(scenario, part) for part in parts), of_sensor])
        if key not in self.scenes:
            while len(self.scenes) >= SCENES:
                self.scenes.pop(next(iter(self.scenes)))
            self.scenes[key] = target_scene(scenario, scenario.sensor.detector())
        return self.scenes[key], {name: float(value) for name, value in values.items()}

    def traced(
        self, shot: Shot, scene: Scene, values: Mapping[str, float]
    ) -> tuple[tuple[WindowPaths, int], bool]:
        """Paths to the model, and whether they were traced now.

        Those of an earlier case of the view serve if geometry, reflection and light are the same.
        """
        render, view, light = shot.scenario.render, shot.view, shot.setting.light
        fixed = {name: v for name, v in values.items() if not name.endswith(TEMPERATURE)}
        axes = np.array([view.eye, view.axis, view.right, view.up]).tobytes()
        window = view.parts, view.first, view.size, view.near_m, view.imager.pixel_angle
        key = repr((id(scene), fixed, axes, window, render, light))
        is_shared = render.spp is not None and not has_spectral_materials(scene.mi)
        if is_shared and key in self.paths:
            paths, bounces = self.paths[key]
            with scene.prepared(by_spectrum=True) as tracer:
                sources = tracer.emitters.sources
            if same_sources(paths, sources):
                return (paths.at_temperatures(sources), bounces), False
        self.paths[key] = shot.traced(truth=self.plan.truth)
        return self.paths[key], True


def same_sources(paths: WindowPaths, sources) -> bool:
    """Whether sources differ from those of the paths by their temperatures alone."""
    before, after = paths.sources, sources
    if len(before.wavelengths_um) or len(after.wavelengths_um):
        return before.list == after.list and np.array_equal(before.share, after.share)
    kinds = [
        [(source.group, source.temperature is None, source.light_of) for source in of.list]
        for of in (before, after)
    ]
    return kinds[0] == kinds[1]


@kept
def recorder(arguments: bytes) -> ViewRecorder:
    """The recorder of a pickled plan, which a worker makes once."""
    return ViewRecorder(pickle.loads(arguments))


def statistics(shot: Shot, channels: Mapping[str, np.ndarray], exposed) -> dict[str, float]:
    """Numbers about an image: temperatures, how much of it shows the target, and limits."""
    kelvin, imager = channels["mean_temperature.Y"], shot.camera.imager
    return {
        "range_m": shot.scenario.observer.range_m,
        "pixels_on_target": exposed.area / shot.view.pixel_m**2,
        "temperature_K": [float(np.min(kelvin)), float(np.mean(kelvin)), float(np.max(kelvin))],
        "saturated_share": saturated(imager, channels[f"{imager.channel}.Y"]),
        "speckle_share": float(np.mean(channels["speckle.Y"])),
        "is_cut": bool(shot.view.is_cut),
    }


def hundredths(kelvin: np.ndarray) -> np.ndarray:
    """Temperatures in hundredths of a kelvin, uint16; the largest is 655.35 K or more."""
    return np.clip(np.rint(100 * kelvin), 0, np.iinfo(np.uint16).max).astype(np.uint16)


def digest_of(content: bytes) -> str:
    return sha256(content).hexdigest()


def write_json(path: Path, content: Any) -> None:
    """Write JSON whose text depends on the content alone."""
    write_bytes(path, text_of(content).encode())


def text_of(content: Any) -> str:
    """The JSON of numbers, texts, dates, lists and dictionaries."""
    return json.dumps(plain(content), indent=1, sort_keys=True, default=str) + "\n"
