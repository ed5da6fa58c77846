"""Quantities of a sweep's cases from effective areas, without another render."""

from collections.abc import Mapping

import numpy as np

from mi_lcair.detection.detection_range import largest_ranges
from mi_lcair.detection.irradiance import LineOfSources
from mi_lcair.estimate import Estimate
from mi_lcair.physics.air.atmosphere import LineOfSight
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import brightness_temperature, in_band_radiance
from mi_lcair.physics.detector import Detector
from mi_lcair.signatures.view_areas import ViewAreas
from mi_lcair.sweeps.lines import Line, Sightline

SLOPE_STEP_K = 0.01  # step of temperature for the slope of Planck's law, K


def rows_of(line: Line, areas: ViewAreas) -> dict[str, np.ndarray]:
    """Quantities of the cases of a line by name with the unit, (cases,), without ranges.

    Parameters
    ----------
    line : Line
    areas : ViewAreas
        Effective areas toward the views of the cases, at the temperatures of the scene.
    """
    areas = areas.at_temperatures(line.temperatures)
    rows = of_estimates("intensity", "W_sr", areas.intensity()) if line.sight is None else {}
    if line.sight is not None:
        rows = of_sight(line.sight, areas)
    return rows | {
        "projected_area_m2": areas.amounts[:, -1],
        "paths": areas.paths.astype(float),
        "reached": areas.reached.astype(float),
    }


def of_sight(sight: Sightline, areas: ViewAreas) -> dict[str, np.ndarray]:
    """Quantities of a target at the end of a path, as `contrast` has them."""
    line = LineOfSources(areas, sight.detector.band, sight.air, sight.backdrop)
    _, target, path, _, _ = per_amount = line.per_amount(sight.path)
    terms = terms_of(line, sight.path, per_amount)
    return {
        **of_terms(terms),
        **beside_noise(sight.detector, terms["total"]),
        **apparent_temperature(areas, sight.detector.band, target, path, sight.path.range_m),
    }


def terms_of(
    line: LineOfSources, along: LineOfSight, per_amount: np.ndarray
) -> dict[str, Estimate]:
    """The TERMS of each view at the end of a path, from those per amount there.

    Those of path and background have the error of the projected area alone.
    """
    # An intensity that was missed arrives at most as this irradiance
    areas, at_most = line.areas, line.per_intensity(along)
    intensity, target, path, background, total = per_amount
    nothing = np.zeros_like(target)
    return {
        "intensity": areas.estimates(intensity, intensity, 1.0),
        "target": areas.estimates(target, target, at_most),
        "path": areas.estimates(path, nothing, 0.0),
        "background": areas.estimates(background, nothing, 0.0),
        "total": areas.estimates(total, target, at_most),
    }


def of_terms(terms: Mapping[str, Estimate]) -> dict[str, np.ndarray]:
    """Columns of the TERMS."""
    return {
        **of_estimates("intensity", "W_sr", terms["intensity"]),
        **of_estimates("target", "W_m2", terms["target"]),
        "path_W_m2": terms["path"].value,
        "background_W_m2": terms["background"].value,
        **of_estimates("contrast", "W_m2", terms["total"]),
    }


def beside_noise(detector: Detector, contrast: Estimate) -> dict[str, np.ndarray]:
    """Columns of a contrast and the noise of a detector."""
    rows = of_estimates("nei_max", "W_m2", contrast.through(detector.nei_max))
    if detector.nei is None:
        return rows
    snr = contrast.through(lambda value: np.abs(detector.signal(value)) / detector.nei)
    rows |= {"nei_ratio": detector.nei_max(contrast.value) / detector.nei}
    return rows | of_estimates("snr", "", snr)


def detection_ranges_of(line: Line, areas: ViewAreas) -> dict[str, np.ndarray]:
    """Detection ranges of the cases of a line, which is the same for all lines of a direction."""
    sight, areas = line.sight, areas.at_temperatures(line.temperatures)
    of_line = LineOfSources(areas, sight.detector.band, sight.air, sight.backdrop)
    ranges = largest_ranges(of_line, areas, sight.detector, sight.air, sight.radius_m)
    return dict(zip(("detection_range_m", "detection_range_standard_error_m"), ranges))


def apparent_temperature(
    areas: ViewAreas, band: Band, target: np.ndarray, path: np.ndarray, range_m: float
) -> dict[str, np.ndarray]:
    """Brightness temperature of the target's mean radiance at the sensor, air included.

    target, path: irradiances for each of the amounts. A view without a target has none: NaN.
    """
    projected = areas.amounts[:, -1]
    solid_angle = np.where(projected > 0, projected, np.nan) / range_m**2
    radiance = ((target + path) @ areas.amounts.T) / solid_angle
    # The radiance is a ratio: what raises the solid angle lowers it
    deviations = areas.deviations @ (target + path)
    deviations -= radiance[:, None] * areas.deviations[:, :, -1] / range_m**2
    relative = (target @ areas.amounts.T) * areas.relative
    error = np.hypot(np.sqrt(np.sum(deviations**2, axis=1)), relative) / solid_angle
    temperature = brightness_temperature(band, radiance)
    steps = temperature + SLOPE_STEP_K * np.array([[1.0], [-1.0]])
    high, low = in_band_radiance(band, steps)
    slope = (high - low) / (2 * SLOPE_STEP_K)
    return {
        "apparent_temperature_K": temperature,
        "apparent_temperature_standard_error_K": np.divide(
            error, slope, out=np.full_like(error, np.nan), where=slope > 0
        ),
    }


def of_estimates(name: str, unit: str, estimates: Estimate) -> dict[str, np.ndarray]:
    """Columns of a value, its standard error and half of its 95 % interval."""
    end = f"_{unit}" if unit else ""
    return {
        f"{name}{end}": estimates.value,
        f"{name}_standard_error{end}": estimates.standard_error,
        f"{name}_half_width{end}": estimates.half_width,
    }
