"""Write the page docs/validation/day.md on the landing airliner by day.

    python -m docs.studies.day [PAGE]

It writes PAGE (default docs/validation/day.md), and its picture into a folder of the same name
beside it. The text is day.template.md, whose {fields} are filled in. Every number on the page is
computed here. The script takes about six minutes on two cores.
"""

import sys
from pathlib import Path

import numpy as np
from tqdm import tqdm

import mi_lcair
from docs.studies.landing import CASES, number
from docs.studies.page import write_page
from mi_lcair.detection.camera.image_result import Image
from mi_lcair.detection.contrast import Contrast
from mi_lcair.detection.irradiance import TERMS
from mi_lcair.detection.scenario import Scenario
from mi_lcair.drawing import drawing
from mi_lcair.estimate import Estimate
from mi_lcair.physics.bands import band as band_of
from mi_lcair.physics.sun import sunlight

BOUNCES, SPP, IMAGE_SPP, AZIMUTH_SPP = 4, 128, 64, 16
SUN_ELEVATION_DEG, SUN_AZIMUTH_DEG = 45, 60
AZIMUTHS_DEG = 0, 30, 60, 90, 120, 150, 180, 270  # of the sun, for the table of its part
SKY = "midlat_summer_clear"
LIGHTS = "night", "day"
RANGES_M = 500, 2000, 5000
CAMERA = {
    "focal_length_mm": 60.0,
    "f_number": 2.5,
    "pitch_um": 15.0,
    "width": 640,
    "height": 256,
    "integration_time_ms": 1.0,
    "well_Me": 10.0,
    "quantum_efficiency": 0.7,
    "read_noise_e": 300.0,
}


def scenario(position: int, band: str, light: str, **changes) -> Scenario:
    """A bundled scenario of the landing under a clear sky, by night or by day."""
    own = {
        "target.parameters.light": light,
        "target.parameters.sky": SKY,
        "background.sky": SKY,
        "sensor.band": band,
        "render.max_bounces": BOUNCES,
        "render.spp": SPP,
    }
    if light == "day":
        own["target.parameters.sun_elevation_deg"] = SUN_ELEVATION_DEG
        own["target.parameters.sun_azimuth_deg"] = SUN_AZIMUTH_DEG
    return Scenario.read(f"a340_landing/position_{position}", **own | changes)


def part(contrast: Contrast, group: str) -> Estimate:
    """Irradiance at the sensor of what one group emitted, through the air [W/m^2]."""
    irradiance = contrast.rows[-1].irradiance
    per_amount = irradiance.per_amount(contrast.path)[TERMS.index("target"), :-1]
    of_group = [source.group == group for source in irradiance.areas.sources]
    weights = np.where(of_group, per_amount, 0)
    variance = weights @ irradiance.covariance[:-1, :-1] @ weights
    return Estimate(float(weights @ irradiance.amounts[:-1]), float(np.sqrt(variance)))


def sun_over_azimuth() -> dict[tuple[int, float], Estimate]:
    """The sun's irradiance at the sensor in MWIR by position and azimuth of the sun [W/m^2]."""
    few = {"render.spp": AZIMUTH_SPP}
    return {
        (position, azimuth): part(
            mi_lcair.contrast(
                scenario(
                    position,
                    "MWIR",
                    "day",
                    **few,
                    **{"target.parameters.sun_azimuth_deg": azimuth},
                )
            ),
            "sun",
        )
        for position in (1, 2, 3)
        for azimuth in AZIMUTHS_DEG
    }


def azimuth_rows(parts: dict, night: dict) -> str:
    """Rows of the table of the sun's part.

    parts: (position, azimuth) -> part. night: position -> contrast by night [W/m^2].
    """
    return "\n".join(
        f"| {azimuth} | "
        + " | ".join(
            f"{measured(parts[position, azimuth])}, "
            f"{100 * parts[position, azimuth].value / abs(night[position]):.2g} %"
            for position in (1, 2, 3)
        )
        + " |"
        for azimuth in AZIMUTHS_DEG
    )


def seen(light: str, range_m: float) -> Image:
    """What the camera records in MWIR from position 2's direction along a slant path."""
    camera = {f"camera.{name}": value for name, value in CAMERA.items()}
    return mi_lcair.image(
        scenario(
            2,
            "MWIR",
            light,
            **{
                "observer.range_m": float(range_m),
                "atmosphere.table": "midlat_summer",
                "render.spp": IMAGE_SPP,
            },
            **camera,
        ),
        seed=1,
    )


def save_pictures(path, images: dict) -> None:
    """Draw the apparent temperature of the first frames, a row for each range.

    images: (light, range) -> image. Both lights of a range have one colour scale.
    """
    with drawing(path, (12, 9.6), layout="constrained") as figure:
        panels = figure.subplots(len(RANGES_M), len(LIGHTS))
        for row, range_m in zip(panels, RANGES_M):
            frames = {light: around(images[light, range_m]) for light in LIGHTS}
            low = min(np.quantile(values, 0.002) for values, _ in frames.values())
            high = max(np.quantile(values, 0.97) for values, _ in frames.values())
            for panel, light in zip(row, LIGHTS):
                values, extent = frames[light]
                picture = panel.imshow(
                    values,
                    cmap="gray",
                    vmin=low,
                    vmax=high,
                    extent=extent,
                    interpolation="nearest",
                )
                panel.set_title(f"{light}, {range_m} m", fontsize=10)
                panel.set_xlabel("column (pixel)", fontsize=8)
                panel.tick_params(labelsize=8)
            row[0].set_ylabel("row (pixel)", fontsize=8)
            figure.colorbar(picture, ax=row, extend="both", pad=0.01).set_label(
                "apparent temperature (K)", fontsize=8
            )
        figure.suptitle("MWIR, from the side, the sun at 45 degrees by day", fontsize=11)


def around(image: Image) -> tuple[np.ndarray, tuple[float, float, float, float]]:
    """Apparent temperature of the first frame around the target [K], and its columns and rows."""
    (left, top), (columns, rows) = image.view.window
    margin = max(6, columns // 20)
    height, width = image.channels["temperature.Y"].shape
    up, down = max(top - margin, 0), min(top + rows + margin, height)
    start, end = max(left - margin, 0), min(left + columns + margin, width)
    return image.channels["temperature.Y"][up:down, start:end], (start, end, down, up)


def measured(estimate: Estimate) -> str:
    """A value and its standard error with one power of ten."""
    mantissa, power = number(estimate.value).split("·")
    exponent = np.floor(np.log10(abs(estimate.value)))
    return f"({mantissa} ± {estimate.standard_error / 10**exponent:.2g})·{power}"


def contrast_rows(contrasts: dict) -> str:
    """Rows of the table of contrasts; contrasts: (position, band, light) -> contrast."""
    lines = []
    for position, band in CASES:
        night, day = (contrasts[position, band, light] for light in LIGHTS)
        sun, total = part(day, "sun"), night.rows[-1].total
        change, error = (100 * value / abs(total.value) for value in sun.pair)
        without = day.rows[-1].total.value - sun.value
        lines.append(
            f"| {position} | {band} | {measured(total)} | {measured(day.rows[-1].total)} "
            f"| {measured(sun)} | {change:+.2g} ± {error:.1g} % "
            f"| {100 * (without / total.value - 1):+.2g} % |"
        )
    return "\n".join(lines)


def image_rows(images: dict) -> str:
    """Rows of the table of images; images: (light, range) -> image."""
    return "\n".join(
        f"| {range_m} m | {light} | {measures.pixels:.4g} | {measures.peak_snr:.3g} "
        f"| {measures.snr:.3g} | {1e3 * measures.netd:.3g} mK | {measures.render_error:.2g} K |"
        for range_m in RANGES_M
        for light in LIGHTS
        for measures in [images[light, range_m].measures]
    )


def main(page: Path) -> None:
    """Write the page and its picture."""
    folder = page.with_suffix("")
    folder.mkdir(parents=True, exist_ok=True)
    steps = tqdm(total=len(LIGHTS) * (len(CASES) + len(RANGES_M)), disable=None, leave=False)
    contrasts, images = {}, {}
    for light in LIGHTS:
        for range_m in RANGES_M:
            images[light, range_m] = seen(light, range_m)
            steps.update()
        for position, band in CASES:
            contrasts[position, band, light] = mi_lcair.contrast(scenario(position, band, light))
            steps.update()
    steps.close()
    save_pictures(folder / "camera.png", images)
    by_night = {k: contrasts[k, "MWIR", "night"].rows[-1].total.value for k in (1, 2, 3)}
    light = sunlight("midlat_summer", SUN_ELEVATION_DEG)
    write_page(
        page,
        "day",
        spp=SPP,
        image_spp=IMAGE_SPP,
        elevation=SUN_ELEVATION_DEG,
        azimuth=SUN_AZIMUTH_DEG,
        contrast_rows=contrast_rows(contrasts),
        image_rows=image_rows(images),
        azimuth_spp=AZIMUTH_SPP,
        azimuth_rows=azimuth_rows(sun_over_azimuth(), by_night),
        **CAMERA,
        **{band: f"{light.in_band_radiance(band_of(band)):.3g}" for band in ("MWIR", "LWIR")},
    )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/validation/day.md"))
