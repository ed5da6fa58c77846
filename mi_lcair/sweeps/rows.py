"""Quantities of a sweep's cases from effective areas, without another render."""

import numpy as np

from mi_lcair.detection.detection_range import largest_ranges
from mi_lcair.detection.irradiance import TERMS, LineOfSources
from mi_lcair.physics.bands import Band
from mi_lcair.physics.blackbody import brightness_temperature, in_band_radiance
from mi_lcair.signatures.view_areas import Estimates, ViewAreas
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
    detector, path = sight.detector, sight.path
    line = LineOfSources(areas, detector.band, sight.air, sight.backdrop)
    per_amount = dict(zip(TERMS, line.per_amount(path)))
    # An intensity that was missed arrives at most as this irradiance
    target, at_most = per_amount["target"], line.per_intensity(path)
    contrast = areas.estimates(per_amount["total"], target, at_most)
    intensity = areas.estimates(per_amount["intensity"], per_amount["intensity"], 1.0)
    rows = {
        **of_estimates("intensity", "W_sr", intensity),
        **of_estimates("target", "W_m2", areas.estimates(target, target, at_most)),
        "path_W_m2": per_amount["path"] @ areas.amounts.T,
        "background_W_m2": per_amount["background"] @ areas.amounts.T,
        **of_estimates("contrast", "W_m2", contrast),
        **of_estimates("nei_max", "W_m2", Estimates(*map(detector.nei_max, contrast))),
        **apparent_temperature(areas, detector.band, target, per_amount["path"], path.range_m),
    }
    if detector.nei is not None:
        snr = Estimates(*(np.abs(detector.signal(value)) / detector.nei for value in contrast))
        rows |= {"nei_ratio": detector.nei_max(contrast.value) / detector.nei}
        rows |= of_estimates("snr", "", snr)
    return rows


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


def of_estimates(name: str, unit: str, estimates: Estimates) -> dict[str, np.ndarray]:
    """Columns of a value, its standard error and half of its 95 % interval."""
    end = f"_{unit}" if unit else ""
    return {
        f"{name}{end}": estimates.value,
        f"{name}_standard_error{end}": estimates.standard_error,
        f"{name}_half_width{end}": estimates.half_width,
    }
