"""The image of a scenario's target as its camera records it."""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import cached_property

import numpy as np

import mi_lcair
from mi_lcair.detection import approximations
from mi_lcair.detection.camera.electronics import AVERAGED, Camera
from mi_lcair.detection.camera.exposure import Exposure, WindowPaths, exposure_of, traced
from mi_lcair.detection.camera.image_result import Image
from mi_lcair.detection.camera.measures import Measures, measured
from mi_lcair.detection.camera.ranges import (
    NEAREST,
    RangedTarget,
    Silhouette,
    at_ranges,
    table_ranges,
)
from mi_lcair.detection.camera.scenery import Scenery
from mi_lcair.detection.camera.view import CameraView
from mi_lcair.detection.scenario import Scenario
from mi_lcair.detection.setting import Setting, rendered_as, setting_of
from mi_lcair.errors import InputError
from mi_lcair.physics.bands import Band
from mi_lcair.physics.imager import Imager, assumed
from mi_lcair.progress import Progress
from mi_lcair.rendering.images.truth import Truth, apparent_temperature, at_centres
from mi_lcair.rendering.measurands import check_free
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.statistics import invalid_remark
from mi_lcair.rendering.views import terrain_remark

# What is noted beside an image: the header of its file, and remarks on its limits
# --------------------------------------------------------------------------------

# What makes the rendering more certain, by whether a tolerance was reached; None without one.
REMEDIES = {None: "raise spp", True: "lower the tolerance", False: "raise max_spp"}


def remarks(
    imager: Imager, view: CameraView, channels: dict, measures: Measures, reached
) -> list[str]:
    """Remarks on the limits of an image, one line each.

    `reached` says whether a tolerance was reached; None without one.
    """
    lines = []
    if measures.saturated:
        share = float(f"{100 * measures.saturated:.2g}")
        signal = channels[f"{imager.channel}.Y"]
        most = imager.amount(signal.max() + imager.dark)
        lines.append(
            f"the detector is saturated in {share:g} % of the pixels, which collect up to {most} "
            f"in a well of {imager.amount(imager.well)}: their true temperature may be higher; "
            "shorten integration_time_ms"
            if imager.detector == "photon"
            else f"{share:g} % of the pixels, which receive {imager.amount(signal.min())} to "
            f"{most}, are outside the converter's span_K: they get the temperature of its "
            "nearest end"
        )
    if view.is_cut:
        lines.append(
            "a part of the target is outside the frame; signal, pixels and ranges are for the "
            "part inside"
        )
    if (speckle := channels["speckle.Y"]).any():
        most, share = channels["stderr_K.Y"].max(), float(f"{100 * speckle.mean():.2g}")
        lines.append(
            f"the rendering's error, up to {most:.2g} K, is larger than the camera's noise in "
            f"{share:g} % of the pixels (marked in speckle.Y), and is the same in all frames; "
            f"{REMEDIES[reached]} of [render]"
        )
    if assumptions := assumed(imager):
        lines.append(
            f"the preset {imager.preset} assumes {' and '.join(assumptions)}, because its "
            "sources do not give them; give your own values"
        )
    return lines


def header(
    scenario: Scenario, scene, exposed: Exposure, measures: Measures, bounces: int, frames, seed
) -> dict:
    """Header of the EXR: the scenario, the camera, its measures and the versions."""
    given = {
        name: ", ".join(map(str, value)) if isinstance(value, tuple) else value
        for name, value in asdict(scenario.camera).items()
        if value is not None
    }
    unit = "power: W; counts.Y: 1" if scenario.camera.unit == "W" else "electrons, counts.Y: 1"
    camera = {f"camera_{name}": value for name, value in given.items()}
    return {
        "scenario": scenario.name,
        "scene": scene.name,
        **scenario.sensor.detector().band.header,
        "units": f"apparent.Y: W m^-2 sr^-1; {unit}; others: K",
        "max_bounces": bounces,
        "spp": exposed.spp,
        "rms_error": exposed.rms_error,
        "range_m": scenario.observer.range_m,
        "frames": frames,
        "noise_seed": str(seed),
        "seed": str(scenario.render.seed),
        "netd_K": "none: the background saturates" if measures.netd is None else measures.netd,
        f"{scenario.camera.unit}_per_count": scenario.camera.electrons_per_count,
        "pedestal_counts": scenario.camera.pedestal,
        "nuc_frames": AVERAGED if scenario.camera.nuc else 0,
        "versions": f"mi_lcair {mi_lcair.__version__}",
        **camera,
    }


BYTES_PER_PIXEL = 400  # memory for a pixel of the frame beside its counts [bytes]


@dataclass(frozen=True)
class Shot:
    """What the camera of a scenario looks at, after all checks and before any render."""

    scenario: Scenario
    setting: Setting
    camera: Camera
    view: CameraView
    scenery: Scenery

    @staticmethod
    def of(scenario: Scenario, seed: int, scene: Scene | None = None) -> "Shot":
        """The shot of a scenario; raises InputError if it cannot be used.

        seed: of the camera's noise and fixed pattern. scene: the scenario's, if it is loaded.
        """
        imager, observer = scenario.camera, scenario.observer
        if imager is None:
            raise InputError(
                "has no table [camera]; give focal_length_mm, f_number, pitch_um, width, height, "
                "integration_time_ms and well_Me in it"
            )
        setting = setting_of(scenario, scene)
        behind = setting.backdrop.at_sensor(observer.range_m)
        setting.air.check_covers(setting.view.band)
        camera = Camera.of(scenario, setting.detector, behind, seed)
        scenario = replace(scenario, camera=camera.imager)
        view = CameraView.of(setting.target, observer.view, observer.range_m, camera.imager)
        return Shot(scenario, setting, camera, view, Scenery.of(scenario, setting, view))

    @property
    def arguments(self) -> tuple:
        """What `exposure_of` takes beside the paths."""
        return self.setting, self.camera.band, self.behind

    @cached_property
    def behind(self) -> Callable[[Band], np.ndarray]:
        """In-band values behind the parts of the window, each band of which is computed once."""
        known: dict[int, tuple[Band, np.ndarray]] = {}

        def behind(rule: Band) -> np.ndarray:
            if id(rule) not in known:
                known[id(rule)] = rule, self.scenery.of_parts(rule)
            return known[id(rule)][1]

        return behind

    def traced(
        self, progress: Progress | None = None, truth: bool = False
    ) -> tuple[WindowPaths, int]:
        """The paths to the model, and their largest number of reflections.

        truth: whether `truth` is wanted of them.
        """
        render, scene = self.scenario.render, self.setting.view
        setting, *others = self.arguments
        with rendered_as(scene, render, each_pixel=True):
            bounces = scene.mi.integrator().max_bounces
            sampling = render.of_image(progress)
            return traced(setting, self.view, sampling, *others, truth=truth), bounces

    def truth(self, exposed: Exposure, header: dict) -> Truth:
        """The truth of the frame's pixels, before optics and noise.

        What leaves the target is in the band of the scene, what arrives in that of the detector.
        Temperatures are those of the scene as it is now. header: of the image.
        """
        scene, band, layers = self.setting.view, self.setting.detector.band, dict(exposed.truth)
        arrives, hidden, error = map(layers.pop, ("arrives", "hidden", "contrast_error"))
        target, scenery = layers["target.Y"], self.scenery
        through = np.divide(arrives, target, out=np.zeros_like(target), where=target > 0)
        behind = np.maximum(scenery.at(band, *scenery.pixels) - hidden, 0)
        apparent, error = arrives + layers["path.Y"] + behind, through * error
        layers |= {"transmittance.Y": through, "background.Y": behind}
        layers |= {"apparent.Y": apparent, "stderr.apparent.Y": error}
        layers |= apparent_temperature(band, apparent, error)
        with rendered_as(scene, self.scenario.render, each_pixel=True):
            at_centre = at_centres(scene, self.view.centre_rays(scene), model_only=True)
        channels = {name: values.astype(np.float32) for name, values in layers.items()}
        bands = {"band_of_target": scene.band.label, "band_of_apparent": band.label}
        of_both = at_centre.channels | channels
        return replace(at_centre, channels=of_both, header=header | bands)

    def developed(
        self, exposed: Exposure, frames: int
    ) -> tuple[np.ndarray, dict[str, np.ndarray], np.ndarray]:
        """What the optics and the electronics make of an exposure.

        Counts (frames, H, W), the channels of `Image` in double precision, and the share of each
        pixel that the target fills (H, W).
        """
        camera, around = self.camera, self.view.around
        optics, name = camera.optics, camera.imager.channel
        background, radiance = (
            self.scenery.image(rule, optics) for rule in (camera.band, self.setting.detector.band)
        )
        scene = np.maximum(background + optics.seen(exposed.contrast, around), 0)
        signal = camera.design.undone(scene)
        error = np.sqrt(optics.variance(exposed.error**2, around))
        frame_counts = camera.frames(signal, frames)
        channels = {
            "apparent.Y": radiance + optics.seen(exposed.radiance, around),
            f"{name}.Y": signal,
            f"{name}.background.Y": camera.design.undone(np.broadcast_to(background, signal.shape)),
            "counts.Y": frame_counts[0],
            "temperature.Y": camera.temperatures(frame_counts[0]),
            **camera.mean_temperatures(scene, error),
        }
        channels["speckle.Y"] = channels["stderr_K.Y"] > channels["noise_K.Y"]
        return frame_counts, channels, optics.seen(exposed.share, around)


def record_image(
    scenario: Scenario, frames: int, seed: int, progress, truth: bool = False
) -> Image:
    """Render the target of a scenario, and record frames of it with the scenario's camera.

    truth: whether the truth by pixel is wanted.
    """
    start = time.perf_counter()
    shot = Shot.of(scenario, seed)
    scenario, camera = shot.scenario, shot.camera
    imager, observer = camera.imager, scenario.observer
    setting, view, scenery = shot.setting, shot.view, shot.scenery
    scene, target = setting.view, setting.target
    check_frames(imager, frames)

    rendering = time.perf_counter()
    paths, bounces = shot.traced(progress, truth)
    nearest = table_ranges(setting.air, NEAREST * target.radius, observer.range_m)
    exposed = exposure_of(paths, *shot.arguments, ranges_m=nearest)
    render_seconds = time.perf_counter() - rendering

    frame_counts, channels, share = shot.developed(exposed, frames)
    signal, behind = (channels[f"{imager.channel}.{end}Y"] for end in ("", "background."))
    measures = measured(
        camera,
        signal,
        behind,
        share,
        channels["stderr_K.Y"],
        exposed.area / view.pixel_m**2,
    )
    silhouette = Silhouette.of_picture(exposed.picture, view, observer.range_m)
    shortest_m = max(NEAREST * target.radius, silhouette.fits_from(imager))
    ranged = (scene.band, setting.air, measures.noise, scenario.sensor.snr)
    ranges, detected_to_m, peak_detected_to_m = at_ranges(
        RangedTarget(camera, exposed, silhouette, *ranged),
        setting.backdrop,
        table_ranges(setting.air, shortest_m, observer.range_m),
    )
    of_image = header(scenario, scene, exposed, measures, bounces, frames, seed)
    return Image(
        scenario=scenario,
        band=camera.band,
        counts=frame_counts,
        channels={
            name: np.ascontiguousarray(values, dtype=np.float32)
            for name, values in channels.items()
        },
        header=of_image,
        measures=measures,
        ranges=ranges,
        detected_to_m=detected_to_m,
        peak_detected_to_m=peak_detected_to_m,
        noise=camera.components(frame_counts, signal),
        view=view,
        mtf_parts=camera.optics.parts(measures.mtf["frequency"]),
        exposure=exposed,
        correction=camera.correction,
        remarks=[
            *scene.remarks,
            *scenery.missing(),
            *approximations.multiplied_light(
                exposed.sources.list,
                approximations.shares_of_light(setting, exposed.sources.list),
            ),
            *approximations.averaged_plumes(scene, [setting]),
            *invalid_remark(exposed.invalid, exposed.paths),
            *terrain_remark(scene, [observer.view], observer.range_m),
            *remarks(imager, view, channels, measures, exposed.reached),
        ],
        truth=shot.truth(exposed, of_image) if truth else None,
        seconds=time.perf_counter() - start,
        render_seconds=render_seconds,
    )


def check_frames(imager: Imager, frames: int) -> None:
    """Raise InputError for frames that need more memory than is free."""
    needed = imager.width * imager.height * (BYTES_PER_PIXEL + 4 * frames)
    what = f"an image of {frames} frames of {imager.width} x {imager.height} pixels"
    check_free(needed, what, "ask for fewer frames")
