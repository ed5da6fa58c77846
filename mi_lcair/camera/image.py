"""The image of a scenario's target as its camera records it."""

import time

import numpy as np

from mi_lcair.camera.camera import Camera
from mi_lcair.camera.exposure import Exposure, exposure
from mi_lcair.camera.image_result import Image
from mi_lcair.camera.notes import header, remarks
from mi_lcair.camera.quality import measured
from mi_lcair.camera.ranges.range_table import RangedTarget, at_ranges, table_ranges
from mi_lcair.camera.ranges.silhouette import Silhouette
from mi_lcair.camera.scenery import Scenery
from mi_lcair.camera.view import CameraView
from mi_lcair.detection.remarks import averaged_plumes, multiplied_light
from mi_lcair.detection.scenario import Scenario
from mi_lcair.detection.setting import rendered_as, setting_of
from mi_lcair.errors import InputError
from mi_lcair.physics.imager import Imager
from mi_lcair.rendering.limits import check_free
from mi_lcair.rendering.statistics import invalid_remark
from mi_lcair.rendering.views import terrain_remark

BYTES_PER_PIXEL = 400  # memory for a pixel of the frame beside its counts [bytes]


def record_image(scenario: Scenario, frames: int, seed: int, progress) -> Image:
    """Render the target of a scenario, and record frames of it with the scenario's camera."""
    start = time.perf_counter()
    imager, observer = scenario.camera, scenario.observer
    if imager is None:
        raise InputError(
            "has no table [camera]; give focal_length_mm, f_number, pitch_um, width, height, "
            "integration_time_ms and well_Me in it"
        )
    setting = setting_of(scenario)
    scene, target = setting.view, setting.target
    behind = setting.backdrop.at_sensor(observer.range_m)
    setting.air.check_covers(scene.band)
    check_frames(imager, frames)
    camera = Camera.of(scenario, setting.detector, behind, seed)
    view = CameraView.of(target, observer.view, observer.range_m, imager)
    scenery = Scenery.of(scenario, setting, view)

    rendering = time.perf_counter()
    with rendered_as(scene, scenario.render, each_pixel=True):
        bounces = scene.mi.integrator().max_bounces
        exposed = exposure(
            setting, view, scenario.render.of_image(progress), camera.band, scenery.of_parts
        )
    render_seconds = time.perf_counter() - rendering

    background, radiance = (
        scenery.image(rule, camera.optics) for rule in (camera.band, setting.detector.band)
    )
    frame_counts, channels, share = developed(camera, view, exposed, background, radiance, frames)
    measures = measured(
        camera,
        channels["electrons.Y"],
        camera.design.undone(background),
        share,
        channels["stderr_K.Y"],
        exposed.area / view.pixel_m**2,
    )
    silhouette = Silhouette.of(scene, view, observer.range_m)
    ranged = (scene.band, setting.air, measures.noise, scenario.sensor.snr)
    ranges, detected_to_m, peak_detected_to_m = at_ranges(
        RangedTarget(camera, exposed, silhouette, *ranged),
        setting.backdrop,
        table_ranges(setting.air, target.radius, observer.range_m),
    )
    return Image(
        scenario=scenario,
        band=camera.band,
        counts=frame_counts,
        channels={
            name: np.ascontiguousarray(values, dtype=np.float32)
            for name, values in channels.items()
        },
        header=header(scenario, scene, exposed, measures, bounces, frames, seed),
        measures=measures,
        ranges=ranges,
        detected_to_m=detected_to_m,
        peak_detected_to_m=peak_detected_to_m,
        view=view,
        mtf_parts=camera.optics.parts(measures.mtf["frequency"]),
        exposure=exposed,
        correction=camera.correction,
        remarks=[
            *scene.remarks,
            *scenery.missing(),
            *multiplied_light(setting, exposed.sources.list),
            *averaged_plumes(scene, [setting]),
            *invalid_remark(exposed.invalid, exposed.paths),
            *terrain_remark(scene, [observer.view], observer.range_m),
            *remarks(imager, view, channels, measures, exposed.reached),
        ],
        seconds=time.perf_counter() - start,
        render_seconds=render_seconds,
    )


def developed(
    camera: Camera, view: CameraView, exposed: Exposure, background, radiance, frames: int
) -> tuple[np.ndarray, dict[str, np.ndarray], np.ndarray]:
    """What the optics and the electronics make of an exposure.

    Parameters
    ----------
    camera, view, exposed : Camera, CameraView, Exposure
    background, radiance : ndarray, shape (H, W), or float
        Electrons of the background, and its in-band radiance, W m^-2 sr^-1.
    frames : int
        Number of frames.

    Returns
    -------
    tuple
        Counts (frames, H, W), the channels of `Image` in double precision, and the share of each
        pixel that the target fills (H, W).
    """
    optics = camera.optics
    scene = np.maximum(background + optics.seen(exposed.contrast, view.around), 0)
    signal = camera.design.undone(scene)
    error = np.sqrt(optics.variance(exposed.error**2, view.around))
    frame_counts = camera.frames(signal, frames)
    channels = {
        "apparent.Y": radiance + optics.seen(exposed.radiance, view.around),
        "electrons.Y": signal,
        "electrons.background.Y": camera.design.undone(np.broadcast_to(background, signal.shape)),
        "counts.Y": frame_counts[0],
        "temperature.Y": camera.temperatures(frame_counts[0]),
        **camera.mean_temperatures(scene, error),
    }
    channels["speckle.Y"] = channels["stderr_K.Y"] > channels["noise_K.Y"]
    return frame_counts, channels, optics.seen(exposed.share, view.around)


def check_frames(imager: Imager, frames: int) -> None:
    """Raise InputError for frames that need more memory than is free."""
    needed = imager.width * imager.height * (BYTES_PER_PIXEL + 4 * frames)
    what = f"an image of {frames} frames of {imager.width} x {imager.height} pixels"
    check_free(needed, what, "ask for fewer frames")
