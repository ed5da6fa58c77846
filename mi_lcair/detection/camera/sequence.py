"""Frames of a camera along a flight, which are rendered anew when the target has moved."""

import pickle
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial
from itertools import chain, count
from pathlib import Path

import numpy as np

from mi_lcair import formats
from mi_lcair.detection.camera.bolometer import lagged
from mi_lcair.detection.camera.electronics import Camera
from mi_lcair.detection.camera.exposure import exposure
from mi_lcair.detection.camera.scenery import Scenery
from mi_lcair.detection.camera.view import CameraView
from mi_lcair.detection.scenario import Scenario
from mi_lcair.detection.setting import Setting, rendered_as, setting_of, target_scene
from mi_lcair.errors import InputError
from mi_lcair.files import check_suffix, check_writable, replacing
from mi_lcair.plugins.emission.sources import Sources
from mi_lcair.progress import Progress
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.signatures.effective_areas import temperatures_of
from mi_lcair.tasks import in_order, kept

AT_ONCE = 16  # frames of a task
STEADY = 1e-3  # relative change of a temperature up to which a render is kept
VIDEO_COLUMNS = 320  # columns of a video, whose pixels are means of the frame's
VIDEO_QUANTILES = 0.001, 0.999  # counts that are black and white in a video
FASTEST_MS = 20  # shortest time of a video's frame that players keep to


class FilmedFlight:
    """The camera of a flight.

    The target is rendered anew when one of its points would have moved by [flight] pixels in the
    frame since the last render, or when a temperature has changed. The background follows the line
    of sight in the same way. The camera is calibrated once, before the background of the beginning.

    Parameters
    ----------
    scenario : Scenario
        It has the tables [flight] and [camera].
    seed : int
        Seed of the camera's noise and fixed pattern.

    Attributes
    ----------
    rendered_at, viewed_at : list of int
        The moment whose render of the target, and whose background, each moment has.
    """

    def __init__(self, scenario: Scenario, seed: int):
        self.scenario, self.seed, self.moments = scenario, seed, scenario.flight.moments()
        self.turned = np.radians(self.moments.turned_deg)
        self.scenes: dict = {}  # the last pose and its scene
        setting = self.setting(0)
        self.radius_m, self.has_sun = setting.target.radius, setting.sun is not None
        behind = setting.backdrop.at_sensor(self.moments.range_m[0])
        self.camera = Camera.of(scenario, setting.detector, behind, seed)
        self.warmer_K = self.camera.warmer_K(self.moments.time_s)
        self.rendered_at, self.viewed_at = [0], [0]
        for number in range(1, len(self.moments.time_s)):
            render, view = self.rendered_at[-1], self.viewed_at[-1]
            if self.has_moved(number, render):
                render = view = number
            elif self.has_turned(number, view):
                view = number
            self.rendered_at.append(render)
            self.viewed_at.append(view)
        self.last_render = self.last_view = None
        self.sights: dict = {}  # the last moment, and what the camera looks at

    def __reduce__(self) -> tuple:
        return filmed, (pickle.dumps((self.scenario, self.seed)),)

    def counts(self) -> Iterator[np.ndarray]:
        """Yield the counts (H, W) of each moment, uint16."""
        first = np.flatnonzero(np.diff(self.rendered_at)) + 1
        spans = np.split(np.arange(len(self.rendered_at)), first)
        parts = [span[k : k + AT_ONCE] for span in spans for k in range(0, len(span), AT_ONCE)]
        imager = self.camera.imager
        made = self.signals if imager.time_constant_ms else self.pages
        images = chain.from_iterable(in_order([partial(made, part) for part in parts]))
        if imager.time_constant_ms:
            images = map(self.page, count(), lagged(imager, self.moments.time_s, images))
        yield from images

    def pages(self, numbers: np.ndarray) -> np.ndarray:
        """Counts (n, H, W) of some moments, uint16."""
        return np.stack([self.page(number, self.signal(number)) for number in numbers])

    def signals(self, numbers: np.ndarray) -> np.ndarray:
        """Signals (n, H, W) of some moments without the lag of the detector."""
        return np.stack([self.signal(number) for number in numbers])

    def page(self, number: int, signal: np.ndarray) -> np.ndarray:
        """Counts (H, W) of a moment with this signal."""
        return self.camera.frame(signal, number, self.warmer_K[number])

    def signal(self, number: int) -> np.ndarray:
        """Mean electrons of the pixels at a moment, (H, W)."""
        render, view = self.rendered_at[number], self.viewed_at[number]
        if self.last_render != render:
            setting, seen, scenery = self.seen(render)
            exposed = self.exposed(render, setting, seen, scenery)
            optics = self.camera.optics.at(self.moments.range_m[render])
            self.target, self.last_render = optics.seen(exposed, seen.around), render
        if self.last_view != view:
            scenery = self.seen(view)[2]
            optics = self.camera.optics.at(self.moments.range_m[view])
            self.background, self.last_view = scenery.image(self.camera.band, optics), view
        return self.camera.design.undone(np.maximum(self.background + self.target, 0))

    def has_moved(self, number: int, last: int) -> bool:
        """Whether the target must be rendered anew, if moment `last` was."""
        moments = self.moments
        for history in moments.temperatures.values():
            if abs(history[number] / history[last] - 1) > STEADY:
                return True
        range_m = min(moments.range_m[[number, last]])
        nearer = abs(moments.range_m[number] - moments.range_m[last]) / range_m
        turned = abs(self.turned[number] - self.turned[last]) + nearer
        return turned * self.radius_m / range_m > self.angle

    def has_turned(self, number: int, last: int) -> bool:
        """Whether the background must be calculated anew, if that of moment `last` was."""
        lines = self.moments.to_observer_m[[last, number]]
        first, second = lines / np.linalg.norm(lines, axis=1)[:, None]
        turned = np.abs(np.arcsin(second[2]) - np.arcsin(first[2]))
        if self.has_sun:
            turned = np.linalg.norm(second - first)
        return turned > self.angle

    @property
    def angle(self) -> float:
        """Angle by which lines of sight may turn before they are rendered anew, rad."""
        return self.scenario.flight.pixels * self.scenario.camera.pixel_angle

    def setting(self, number: int) -> Setting:
        """The setting of a moment, whose scene is loaded once for each pose."""
        scenario = self.scenario.at_moment(self.moments, number)
        if scenario.pose not in self.scenes:
            self.scenes = {scenario.pose: target_scene(scenario, scenario.sensor.detector())}
        return setting_of(scenario, self.scenes[scenario.pose])

    def seen(self, number: int) -> tuple[Setting, CameraView, Scenery]:
        """What the camera looks at; the last answer is kept."""
        if number in self.sights:
            return self.sights[number]
        setting, scenario = self.setting(number), self.scenario.at_moment(self.moments, number)
        observer = scenario.observer
        view = CameraView.of(setting.target, observer.view, observer.range_m, scenario.camera)
        self.sights = {number: (setting, view, Scenery.of(scenario, setting, view))}
        return self.sights[number]

    def exposed(
        self, number: int, setting: Setting, view: CameraView, scenery: Scenery
    ) -> np.ndarray:
        """Electrons of the target less those of the background, in the samples of the window."""
        render, scene = self.scenario.render, setting.view
        temperatures = {name: T[number] for name, T in self.moments.temperatures.items()}
        sampling = Sampling(spp=self.scenario.flight.spp, seed=render.seed)

        def at_temperatures(sources: Sources) -> list[Sources]:
            return [sources, heated(sources, temperatures, scene)] if temperatures else []

        with rendered_as(scene, render, each_pixel=True):
            made = exposure(
                setting, view, sampling, self.camera.band, scenery.of_parts, at_temperatures
            )
        if not temperatures:
            return made.contrast
        before, after = (sum(variant.values()) for variant in made.variants)
        return made.contrast + after - before


@kept
def filmed(arguments: bytes) -> FilmedFlight:
    """The flight of pickled arguments, which a worker makes once."""
    return FilmedFlight(*pickle.loads(arguments))


def heated(sources: Sources, temperatures: dict[str, float], scene: Scene) -> Sources:
    """The sources of a scene at other temperatures, K, by group."""
    known = [source for source in sources.list if source.name is not None]
    kelvin = dict(zip(known, temperatures_of(known, temperatures)))
    return sources.replaced(
        [
            source
            if kelvin.get(source) in (None, source.temperature)
            else source.at(kelvin[source], scene.band)
            for source in sources.list
        ]
    )


def check_film(scenario: Scenario, frames: Path | None, video: Path | None) -> None:
    """Raise InputError if the frames of a flight's camera cannot be written to these files."""
    if scenario.flight is None or scenario.camera is None:
        raise InputError("frames of a flight need the tables [flight] and [camera]")
    for path, suffix in ((frames, ".tif"), (video, ".gif")):
        if path is not None:
            check_suffix(path, (suffix,))
            check_writable(path)
    if frames is not None:
        count, imager = len(scenario.flight.moments().time_s), scenario.camera
        formats.check_fits(frames, count, imager.width, imager.height)


def film(
    scenario: Scenario,
    frames: Path | None,
    video: Path | None,
    seed: int,
    progress: Progress | None,
) -> int:
    """Write the frames of a flight's camera, and return how many of them were rendered.

    Parameters
    ----------
    scenario : Scenario
    frames : Path or None
        TIFF whose 16-bit pages are the counts.
    video : Path or None
        GIF with the same brightness for the same counts: those of the nearest moment fill it.
    seed : int
    progress : callable or None
        Called with (frames done, all frames).
    """
    flight = FilmedFlight(scenario, seed)
    pictures, count = [], len(flight.moments.time_s)
    with ExitStack() as files:
        add = None
        if frames is not None:
            add = files.enter_context(formats.stack(frames))
        grey = None if video is None else brightness(flight)
        for number, page in enumerate(flight.counts()):
            if add is not None:
                add(page)
            if grey is not None:
                pictures.append(grey(page))
            if progress:
                progress(number + 1, count)
        if video is not None:
            write_video(video, pictures, flight.moments.time_s)
    return len(set(flight.rendered_at))


def brightness(flight: FilmedFlight) -> Callable:
    """A function that makes a picture of counts, with the scale of the nearest moment."""
    from PIL import Image

    nearest = int(np.argmin(flight.moments.range_m))
    dark, bright = np.quantile(
        flight.camera.frame(flight.signal(nearest), nearest), VIDEO_QUANTILES
    )
    step = max(1, -(-flight.scenario.camera.width // VIDEO_COLUMNS))

    def picture(page: np.ndarray):
        rows, columns = (n // step for n in page.shape)
        cut = page[: rows * step, : columns * step].astype(float)
        mean = cut.reshape(rows, step, columns, step).mean(axis=(1, 3))
        grey = np.clip((mean - dark) / max(bright - dark, 1) * 255, 0, 255)
        return Image.fromarray(grey.astype(np.uint8))

    return picture


def write_video(path: Path, pictures: list, time_s: np.ndarray) -> None:
    """Write a GIF whose frames last as long as in the flight, at least FASTEST_MS."""
    steps = np.diff(time_s) if len(time_s) > 1 else np.ones(1)
    lasts = np.maximum(1e3 * np.append(steps, steps[-1]), FASTEST_MS).round().astype(int)
    with replacing(path) as partial, partial.open("wb") as file:
        pictures[0].save(
            file,
            format="GIF",
            save_all=True,
            append_images=pictures[1:],
            duration=lasts.tolist(),
            loop=0,
        )
