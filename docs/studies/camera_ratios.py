"""Write the page docs/validation/camera.md: ratios of a camera's image, its table and its frames.

    python -m docs.studies.camera_ratios [PAGE]

It writes PAGE (default docs/validation/camera.md) from camera_ratios.template.md. The headline of
an image, the row of its table over range, the row of the table of another image, and what a matched
filter finds in 200 frames are compared at five ranges. It takes a few minutes on two cores.
"""

import sys
from pathlib import Path

import numpy as np

import mi_lcair
from docs.studies.page import write_page
from mi_lcair.detection.camera.electronics import Camera, signal_of
from mi_lcair.detection.camera.image import Shot
from mi_lcair.detection.camera.image_result import Image
from mi_lcair.detection.scenario import Scenario

RANGES_M, MIDDLE_M = (500.0, 1000.0, 2000.0, 5000.0, 10_000.0), 2000.0
FRAMES, SPP, SEED = 200, 128, 1
SCENES = {
    "position 3, night, MWIR, `insb_mwir`": (
        "a340_landing/position_3",
        {"sensor.band": "MWIR", "camera.preset": "insb_mwir", "camera.integration_time_ms": 1},
    ),
    "position 2, day, MWIR, `insb_mwir`": (
        "a340_landing/position_2",
        {
            "sensor.band": "MWIR",
            "target.parameters.light": "day",
            "camera.preset": "insb_mwir",
            "camera.integration_time_ms": 1,
        },
    ),
    "position 1, night, LWIR, `microbolometer_12um` with pattern and rows": (
        "a340_landing/position_1",
        {
            "sensor.band": "LWIR",
            "camera.preset": "microbolometer_12um",
            "camera.focal_length_mm": 50,
            "camera.sigma_vh_mK": 30,
            "camera.sigma_tv_mK": 20,
        },
    ),
}


def image(scene: str, range_m: float, spp: int = SPP, **changes) -> Image:
    """The image of one of SCENES with 320 x 256 pixels at a range, without frames."""
    name, entries = SCENES[scene]
    entries = entries | {
        "observer.range_m": range_m,
        "render.spp": spp,
        "render.max_bounces": [5],
        "camera.width": 320,
        "camera.height": 256,
        **changes,
    }
    return mi_lcair.image(Scenario.read(name, **entries), seed=SEED)


def ratios_of_frames(made: Image, frames: int = FRAMES) -> tuple[float, float, float]:
    """Ratios of a matched filter and of the strongest pixel, from frames that are drawn.

    The filter is the contrast that the camera holds. Its signal is the mean over the frames with
    the target less that of others without it, and its noise the standard deviation over the latter
    at all places of the filter. The third value is the filter's ratio if all noise were of single
    pixels.
    """
    camera = Shot.of(made.scenario, SEED).camera
    name = camera.imager.channel
    signal, behind = (made.channels[f"{name}.{end}Y"].astype(float) for end in ("", "background."))
    glow = camera.design.offset
    contrast = camera.kept_contrast(behind - glow, signal - behind)
    spectrum, squares, total, noise = np.conj(np.fft.rfft2(contrast)), 0.0, 0.0, 0.0
    for number in range(frames):
        with_target, without = (
            recorded(camera, scene, first + number)
            for scene, first in ((signal, 0), (behind, frames))
        )
        total = total + with_target - without
        rest = without - camera.design.applied(behind)
        filtered = np.fft.irfft2(np.fft.rfft2(rest) * spectrum, s=rest.shape)
        squares, noise = squares + np.mean(filtered**2), noise + np.mean(rest**2)
    mean = total / frames
    peak = np.unravel_index(np.argmax(abs(contrast)), contrast.shape)
    found = np.sum(contrast * mean) / np.sqrt(squares / frames)
    alone = np.linalg.norm(contrast) / made.measures.noise
    return float(found), float(abs(mean[peak]) / np.sqrt(noise / frames)), float(alone)


def recorded(camera: Camera, signal: np.ndarray, number: int) -> np.ndarray:
    """Corrected signal of one frame."""
    return camera.correction.applied(signal_of(camera.imager, camera.frame(signal, number)))


def main(path: Path, ranges=RANGES_M) -> None:
    rows, alone, worst = [], [], {"frames": 0.0, "peak": 0.0, "table": 0.0, "other": 0.0}
    for scene in SCENES:
        other = {row.range_m: row.snr for row in image(scene, MIDDLE_M).ranges}
        for range_m in ranges:
            made = image(scene, range_m)
            own = next(row.snr for row in made.ranges if row.range_m == range_m)
            found, peak, single = ratios_of_frames(made)
            measures = made.measures
            alone.append(single / found)
            pairs = {
                "table": own / measures.snr,
                "other": other.get(range_m, np.nan) / measures.snr,
                "frames": found / measures.snr,
                "peak": peak / measures.peak_snr,
            }
            for name, ratio in pairs.items():
                worst[name] = max(worst[name], abs(np.nan_to_num(ratio, nan=1.0) - 1))
            rows.append(
                f"| {scene} | {range_m:g} | {measures.pixels:.3g} | {measures.snr:.4g} | "
                + " | ".join(
                    "-" if np.isnan(x) else f"{100 * (x - 1):+.1f} %" for x in pairs.values()
                )
                + " |"
            )
            print(rows[-1], flush=True)
    by_day = [list(SCENES)[1], ranges[-1]]
    two = [image(*by_day, **{"render.seed": seed}).measures.snr for seed in (0, 5)]
    bounds = {f"worst_{name}": f"{100 * value:.2g} %" for name, value in worst.items()}
    seeds = f"{100 * abs(two[1] / two[0] - 1):.2g} %"
    alone = np.array(alone[-len(ranges) :])
    fields = {"least": f"{alone.min():.2g}", "most": f"{alone.max():.2g}"}
    fields |= {"rows": "\n".join(rows), "frames": FRAMES, "seeds": seeds}
    write_page(path, "camera_ratios", **fields, **bounds)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/validation/camera.md"))
