"""Contrast of a target at a sensor (thesis 3.7 and 3.8, Eqs 3.13-3.19).

The contrast is the target's radiation through the air, plus that of the air before it, less the
background that the target hides. Only the target is rendered. All other terms follow from its
effective areas.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from typing import Any

import numpy as np

from mi_lcair.charts import Curve, LineChart, LineCharts, by_wavelength
from mi_lcair.detection import approximations
from mi_lcair.detection.detection_range import DetectionRange, detection_range
from mi_lcair.detection.irradiance import Irradiance, RenderError
from mi_lcair.detection.scenario import RenderTable, Scenario
from mi_lcair.detection.setting import Setting, rendered_as, setting_of
from mi_lcair.errors import InputError, option
from mi_lcair.estimate import Estimate
from mi_lcair.physics.air.atmosphere import Atmosphere, LineOfSight
from mi_lcair.physics.imager import Detector
from mi_lcair.plugins.emission.source import Source
from mi_lcair.plugins.emitters.thermal_emitter import one_sun
from mi_lcair.plugins.paths.launch import Aim
from mi_lcair.plugins.recorders.radiance import MAX_BOUNCE_CHANNELS
from mi_lcair.rendering.reflections import followed_row
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene, changed
from mi_lcair.rendering.statistics import invalid_remark
from mi_lcair.rendering.views import Target, terrain_remark
from mi_lcair.results import Result, entries_of, entry
from mi_lcair.sections import (
    NORMAL,
    Section,
    Table,
    error_row,
    interval,
    interval_rows,
    part_cell,
)
from mi_lcair.signatures.signature import Signature, measure_signature

# What `contrast` returns: values with errors for each number of reflections
# --------------------------------------------------------------------------

INTENSITY, IRRADIANCE, IRRADIANCE_UNIT = "W sr-1 um-1", "W m-2 um-1", "W m-2"


@dataclass(frozen=True)
class ContrastRow:
    """Contrast of a target, rendered with one number of reflections.

    Irradiances are at the aperture and weighted with the response of the detector.

    Attributes
    ----------
    max_bounces : int
        Number of reflections.
    intensity : Estimate
        Intensity of the target before the air, W/sr (3.13).
    target : Estimate
        Apparent irradiance of the target, W m^-2 (3.16).
    path : Estimate
        Irradiance of the air before the target, W m^-2.
    background : Estimate
        Irradiance of the background that the target hides, W m^-2.
    total : Estimate
        Contrast, W m^-2, positive or negative (3.19).
    half_width : float
        Half of the 95 % interval of the contrast, W m^-2.
    approximated : float
        Its part that is due to approximations, which remarks name, W m^-2.
    reached : bool or None
        Whether the half width is within a tolerance; None without one.
    nei_max : Estimate
        Largest noise-equivalent irradiance that detects the target, W m^-2, behind the optics
        (3.14).
    projected_area : Estimate
        Projected area of the target, m^2.
    solid_angle : float
        Solid angle of the target, sr (3.17).
    observed : float or None
        Irradiance of the field of view with the target, W m^-2 (3.18). None without a field of
        view, or if the target may overfill it.
    detected : bool or None
        Whether the target is detected; None without a nei.
    irradiance : Irradiance
        Irradiances of the target at any range.
    """

    max_bounces: int
    intensity: Estimate = entry("intensity_W_sr")
    target: Estimate = entry("target_W_m2")
    background: Estimate = entry("background_W_m2")
    path: Estimate = entry("path_W_m2")
    total: Estimate = entry("total_W_m2")
    nei_max: Estimate = entry("nei_max_W_m2")
    projected_area: Estimate = entry("projected_area_m2")
    half_width: float = entry("half_width_W_m2")
    approximated: float = entry("approximated_W_m2")
    solid_angle: float = entry("solid_angle_sr")
    observed: float | None = entry("observed_W_m2")
    reached: bool | None
    detected: bool | None
    irradiance: Irradiance = entry(repr=False)


def facts_of_entries(entries: dict) -> Iterator[Any]:
    """Yield irradiances and spectra of a contrast from the entries of its JSON."""
    yield from setting(entries)
    yield irradiances(entries["rows"])
    yield from groups(entries.get("groups", {}))
    yield Section("Spectra", [picture_of_entries(entries)])


def picture_of_entries(entries: dict) -> LineCharts:
    """The picture of a contrast from the entries of its JSON."""
    bounces = entries["rows"][-1]["max_bounces"]
    title = f"{entries['scenario_name']}, {entries['band']}, up to {bounces} reflections"
    if entries["scenario"]["sensor"]["response"] is not None:
        title += "; spectra times the response"
    return LineCharts(spectral_charts(entries), title)


def spectral_charts(entries: dict) -> list[LineChart]:
    """Spectra of the last row of a contrast from the entries of its JSON.

    They are the intensity before the air, the target's irradiance with the transmittance of the
    air, and the terms of the contrast, each times the response of the detector, so that the area
    below a curve is the value in band.
    """
    row, spectra = entries["rows"][-1], entries["spectrum"]
    columns = {name: np.array(values, dtype=float) for name, values in spectra.items()}
    x, response = columns["wavelength_um"], columns["response"]

    def weighted(name):
        return columns[name] * response

    def in_band(name):
        return f"{row[name]['value']:.4g}"

    intensity = Curve("intensity", weighted("intensity_W_sr_um"), INTENSITY)
    target = Curve("target", weighted("target_W_m2_um"), IRRADIANCE, 1)
    through = Curve("transmittance (right)", columns["transmittance"], "", 8, on_right=True)
    terms = [
        target,
        Curve("path", weighted("path_W_m2_um"), IRRADIANCE, 0),
        Curve("background, hidden", -weighted("background_W_m2_um"), IRRADIANCE, 2),
        Curve("contrast", weighted("total_W_m2_um"), IRRADIANCE),
    ]
    titles = (
        f"target before the air: {in_band('intensity_W_sr')} W/sr in band",
        f"target through {entries['range_m']:.5g} m of {entries['atmosphere']}: "
        f"{in_band('target_W_m2')} W/m² in band",
        f"contrast: {in_band('total_W_m2')} W/m² in band",
    )
    of_irradiance = "irradiance", IRRADIANCE
    return [
        by_wavelength(titles[0], x, "intensity", INTENSITY, [intensity]),
        by_wavelength(titles[1], x, *of_irradiance, [target, through]),
        by_wavelength(titles[2], x, *of_irradiance, terms, from_zero=False),
    ]


def setting(entries: dict) -> list[tuple[str, str]]:
    """Rows about scenario, sight, air, background, target and error."""
    scenario, elevation, row = (
        entries["scenario"],
        entries["sight_elevation_deg"],
        entries["rows"][-1],
    )
    transmittance = scenario["sensor"]["optics_transmittance"]
    heights = ""
    if entries["observer_height_m"] is not None:
        heights = (
            f", at a height of {entries['observer_height_m']:.5g} m; target "
            f"{entries['target_height_m']:.5g} m"
        )
    area, error = row["projected_area_m2"].values()
    rows = [
        ("scenario", ": ".join(filter(None, (scenario["name"], scenario["title"])))),
        ("band", f"{entries['band']}, optics transmit {transmittance:g}"),
        (
            "line of sight",
            f"{entries['range_m']:.6g} m, {abs(elevation):.4g} degrees "
            f"{'up' if elevation >= 0 else 'down'}ward, observer at azimuth "
            f"{scenario['observer']['azimuth_deg']:.6g}{heights}",
        ),
        (
            "atmosphere",
            f"{entries['atmosphere']}: mean transmittance {entries['transmittance']:.4f}, path "
            f"{entries['path_radiance_W_m2_sr']:.5g} W m^-2 sr^-1",
        ),
        (
            "background",
            f"{entries['background']}: {entries['background_radiance_W_m2_sr']:.5g} W m^-2 sr^-1",
        ),
        ("target", f"projected area {area:.5g} +- {error:.2g} m^2, {row['solid_angle_sr']:.5g} sr"),
    ]
    if entries["no_target_W_m2"] is not None:
        empty = f"{entries['no_target_W_m2']:.5g} W/m^2 in the field of view"
        rows.append(("without target", empty))
    total = row["total_W_m2"]
    approximated = row.get("approximated_W_m2", 0.0)
    error = float(np.hypot(total["standard_error"], approximated / NORMAL))
    reason = interval_rows(row["half_width_W_m2"], error)
    followed = [followed_row(entries["followed"])] if entries.get("followed") else []
    return [*rows, accuracy(entries), *reason, *followed]


def irradiances(entries: list[dict]) -> Table:
    """A row for each number of reflections, from the entries of a contrast's rows."""
    last = entries[-1]
    columns = [
        "reflections up to", ("intensity", "W sr-1"), ("target", IRRADIANCE_UNIT),
        ("background", IRRADIANCE_UNIT), ("path", IRRADIANCE_UNIT), "total W/m^2 (95 %)",
        ("nei max", IRRADIANCE_UNIT),
    ]  # fmt: skip
    more = {("observed", IRRADIANCE_UNIT): "observed_W_m2", "detected": "detected"}
    more = {column: name for column, name in more.items() if last[name] is not None}
    estimates = ("intensity_W_sr", "target_W_m2", "background_W_m2", "path_W_m2")
    rows = [
        [
            row["max_bounces"],
            *(tuple(row[name].values()) for name in estimates),
            f"{row['total_W_m2']['value']:.5g} +- {row['half_width_W_m2']:.2g}",
            tuple(row["nei_max_W_m2"].values()),
            *(row[name] for name in more.values()),
        ]
        for row in entries
    ]
    return Table([*columns, *more], rows)


def groups(parts: dict) -> list[Table]:
    """The target of the last row by what emitted it, from a contrast's entry `groups`.

    There is no table for one group.
    """
    whole = sum(part["target_W_m2"]["value"] for part in parts.values()) or 1.0
    rows = [
        [
            group,
            *(part_cell(*estimate.values()) for estimate in part.values()),
            f"{part['target_W_m2']['value'] / whole:.1%}",
        ]
        for group, part in parts.items()
    ]
    columns = ["emitted by", ("intensity", "W sr-1"), ("target", IRRADIANCE_UNIT), "share"]
    return [Table(columns, rows)] if len(rows) > 1 else []


def detection_ranges(contrast) -> Table:
    """The ranges at which the target is detected, by number of reflections."""
    detector = contrast.detector
    needed = (
        f"detected at, for a nei of {detector.nei:g} W/m^2 and a signal-to-noise ratio of "
        f"{detector.snr:g}"
    )
    words = [
        detection.summary().removeprefix("detected at ").removesuffix(" (standard error)")
        for detection in contrast.detection_ranges()
    ]
    return Table(
        ["reflections up to", needed],
        [[row.max_bounces, text] for row, text in zip(contrast.rows, words)],
    )


def accuracy(entries: dict) -> tuple[str, str]:
    """Row about the widest 95 % interval of a contrast, and about the tolerances if any."""
    relative, absolute, rows = (entries[k] for k in ("tolerance", "tolerance_W_m2", "rows"))
    allowed = [
        *([] if relative is None else [f"{100 * relative:.4g} %"]),
        *([] if absolute is None else [f"{absolute:.4g} W/m^2"]),
    ]
    stated = [row for row in rows if row["reached"] is False] or rows
    widest = max(stated, key=lambda row: row["half_width_W_m2"])
    half_width, total = widest["half_width_W_m2"], widest["total_W_m2"]["value"]
    several = len(rows) > 1
    of = f"the contrast with {widest['max_bounces']} reflections" if several else "the contrast"
    remedy = f"give {option('tolerance_W_m2')}, because a fraction of zero cannot be reached"
    is_zero, approximated = half_width >= abs(total) and absolute is None, ""
    part = widest.get("approximated_W_m2", 0.0)
    if part > MOST_APPROXIMATED * half_width:
        approximated = ", most of it from an approximation that a warning names"
        if not is_zero:
            is_zero, remedy = True, "more paths do not change that"
    return error_row(
        interval(half_width, total, "W/m^2", of, absolute is not None) + approximated,
        " or ".join(allowed) or None,
        entries["reached"],
        where=f"in {len(stated)} of {len(rows)} rows" if several else "",
        remedy=remedy if is_zero else "",
    )


@dataclass(frozen=True, repr=False)
class Contrast(Result):
    """Contrast of a scenario.

    Attributes
    ----------
    scenario : Scenario
        Scenario as it was read.
    detector : Detector
        Detector of the sensor.
    air : Atmosphere
        Atmosphere of the scenario.
    path : LineOfSight
        Path from the target to the sensor.
    sight_elevation_deg : float
        Elevation of the line of sight, degrees, upward from the sensor.
    observer_height_m, target_height_m : float or None
        Heights above the ground, m. None if neither the scenario nor its air gives them.
    background_name : str
        Name of the background.
    transmittance : float
        Mean transmittance of the path in the band.
    path_radiance, background_radiance : float
        Radiance of the path and of the background, W m^-2 sr^-1, weighted with the response.
    no_target : float or None
        Irradiance of the background in the whole field of view, W m^-2 (3.15). None without a field
        of view.
    radius_m : float
        Radius of the sphere around the target, m.
    rows : list of ContrastRow
        One row for each number of reflections.
    remarks : list of str
        Limits of the results, one line each.
    seconds : float
        Time of the calculation, s.
    followed : str
        What the paths follow, in words.
    """

    scenario: Scenario
    detector: Detector = entry()
    air: Atmosphere = entry("atmosphere", "name")
    path: LineOfSight = entry("range_m", "range_m")
    sight_elevation_deg: float
    observer_height_m: float | None
    target_height_m: float | None
    background_name: str = entry("background")
    transmittance: float
    path_radiance: float = entry("path_radiance_W_m2_sr")
    background_radiance: float = entry("background_radiance_W_m2_sr")
    no_target: float | None = entry("no_target_W_m2")
    radius_m: float
    rows: list[ContrastRow]
    remarks: list[str]
    seconds: float = entry("time_s")
    followed: str = ""

    kind = "contrast"
    computed = {
        "reached": "reached",
        "groups": "groups",
        "spectrum": "spectrum",
        "scenario_name": "scenario.name",
        "band": "detector.band.label",
        "tolerance": "scenario.render.tolerance",
        "tolerance_W_m2": "scenario.render.tolerance_W_m2",
    }
    facts_of = staticmethod(facts_of_entries)
    picture_of = staticmethod(picture_of_entries)

    @property
    def reached(self) -> bool | None:
        """Whether all rows have reached a tolerance; None without one."""
        return all(row.reached for row in self.rows) if self.scenario.render.has_tolerance else None

    def detection_ranges(self) -> list[DetectionRange]:
        """Detection range of each row, along the line of sight. Raises InputError without a nei."""
        return self._detection_ranges

    @cached_property
    def _detection_ranges(self) -> list[DetectionRange]:
        """They are searched once; the rows, the detector and the air of a result never change."""
        return [
            detection_range(row.irradiance, self.detector, self.air, self.radius_m)
            for row in self.rows
        ]

    def summary(self) -> str:
        """One line with the contrast of the last row and its 95 % interval."""
        row = self.rows[-1]
        detected = {None: "", True: ", detected", False: ", not detected"}[row.detected]
        return (
            f"contrast of {self.scenario.name}, {self.detector.band.label}: {row.total.value:.5g} "
            f"+- {row.half_width:.2g} W m^-2 (95 %) at {self.path.range_m:.6g} m, up to "
            f"{row.max_bounces} reflections{detected}"
        )

    def facts(self, ranges: bool = True) -> Iterator[Any]:
        """Irradiances, detection ranges and spectra.

        ranges: whether to find the detection ranges; they need a sensor with a nei.
        """
        *head, spectra = facts_of_entries(self.as_dict())
        found = ranges and self.detector.nei is not None
        table = [Section("Detection range", [detection_ranges(self)])] if found else []
        return [*head, *table, spectra]

    def picture(self) -> LineCharts:
        """The spectra of the last row."""
        return picture_of_entries(self.as_dict())

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each number of reflections, with values and standard errors."""
        rows = [entries_of(row) for row in self.rows]
        columns = {"max_bounces": np.array([row.pop("max_bounces") for row in rows])}
        for name, first in rows[0].items():
            values = [row[name] for row in rows]
            if not isinstance(first, Estimate):
                columns[name] = np.array(values, dtype=float)
                continue
            quantity, unit = name.rsplit("_W_" if "_W_" in name else "_", 1)
            unit = f"W_{unit}" if "_W_" in name else unit
            columns[name] = np.array([estimate.value for estimate in values])
            errors = np.array([estimate.standard_error for estimate in values])
            columns[f"{quantity}_standard_error_{unit}"] = errors
        return columns

    def groups(self, number: int = -1) -> dict[str, dict[str, dict[str, float]]]:
        """The target of a row by the group that emitted it, with standard errors.

        They are the intensity before the air (intensity_W_sr) and the apparent irradiance
        (target_W_m2). Empty for a scene with too many temperatures to be told apart.
        """
        return {
            group: {
                f"{name}_{unit}": parts[name].as_dict()
                for name, unit in (("intensity", "W_sr"), ("target", "W_m2"))
            }
            for group, parts in self.rows[number].irradiance.by_group(self.path).items()
        }

    def spectrum(self, number: int = -1) -> dict[str, np.ndarray]:
        """Spectra of a row, by name with the unit: columns over wavelength_um.

        They are the response of the detector, the transmittance of the path, the intensity of the
        target before the air, and the irradiances of target, path, hidden background and contrast.
        """
        irradiance = self.rows[number].irradiance
        wavelengths = irradiance.wavelengths_um
        spectral = irradiance.spectral(self.path)
        return {
            "wavelength_um": wavelengths,
            "response": irradiance.response,
            "transmittance": self.path.at(wavelengths)[0],
            "intensity_W_sr_um": spectral["intensity"],
            **{
                f"{name}_W_m2_um": spectral[name]
                for name in ("target", "path", "background", "total")
            },
        }


# Measurement of a contrast, and remarks on its limits
# ---------------------------------------------------

THERMAL_UM = 5.0  # wavelength from which on a sky scatters no sunlight worth mentioning, um
SIGNIFICANT = 3  # standard errors by which a contrast must differ from zero
# Smallest projected area of a target, in squares of its radius. Rays meet less than that only
# through the rounding of Float32, as on a plate that is seen edge-on.
SMALLEST_TARGET = 1e-6
ENOUGH_TO_MEET = 2**20  # paths after which a target that none of them has met is given up
# What resolves a contrast near zero, by whether a tolerance was reached; None without one.
REMEDIES = {
    None: "raise spp",
    True: "lower the tolerance",
    False: "a fraction of zero cannot be reached, so give tolerance_W_m2 of [render]",
}
# Approximations up to this part of the allowed half width are made up for by more paths
MOST_APPROXIMATED = 0.7
NEAR = 10  # range, in radii of the target, below which rays to the observer are not parallel


def measure_contrast(scenario: Scenario, progress) -> Contrast:
    """The contrast of a scenario, for each of its numbers of reflections."""
    start = time.perf_counter()
    setting = setting_of(scenario)
    detector, air, path, behind = setting.detector, setting.air, setting.path, setting.backdrop
    view, target, observer = setting.view, setting.target, scenario.observer
    rows, invalid, paths, followed = [], 0, 0, {}
    for bounces, irradiance, result in rendered(setting, scenario.render, progress):
        allowed = scenario.render.allowed(irradiance.at(path)["total"].value)
        followed[bounces] = result.followed
        reached = result.reached and irradiance.half_width(path) <= allowed
        rows.append(row(bounces, irradiance, path, detector, target, reached))
        invalid, paths = max(invalid, result.invalid), max(paths, result.paths)
    irradiance = rows[-1].irradiance
    transmittance, radiance = path.at(irradiance.wavelengths_um)
    mean_transmittance = irradiance.in_band(transmittance) / float(irradiance.weights_um.sum())
    return Contrast(
        scenario=scenario,
        detector=detector,
        air=air,
        path=path,
        sight_elevation_deg=setting.sight.elevation_deg,
        observer_height_m=setting.sight.observer_m,
        target_height_m=setting.sight.target_m,
        background_name=behind.name,
        transmittance=mean_transmittance,
        path_radiance=irradiance.in_band(radiance),
        background_radiance=irradiance.in_band(irradiance.background(path)),
        no_target=no_target(irradiance, detector, path),
        radius_m=target.radius,
        rows=rows,
        remarks=[
            *view.remarks,
            *([f"through the air, and with the sensor: {result.bins}"] if result.bins else []),
            *invalid_remark(invalid, paths),
            *unlit_sky(view, scenario, detector),
            *approximations.multiplied_light(
                irradiance.areas.sources, irradiance.render_error.of_light
            ),
            *remarks(rows, detector, target, observer.range_m),
            *terrain_remark(view, [observer.view], observer.range_m),
            *approximations.averaged_plumes(view, [setting]),
        ],
        seconds=time.perf_counter() - start,
        followed=followed[max(followed)],
    )


def rendered(
    setting: Setting, sampling: RenderTable, progress
) -> Iterator[tuple[int, Irradiance, Signature]]:
    """Yield (number of reflections, Irradiance of the target, its Signature) for each render.

    One pass records all numbers of reflections. With a closure, or materials in bins of wavelength,
    each has a render of its own. They have the same paths: the most that one of them needs.

    Parameters
    ----------
    setting : Setting
    sampling : RenderTable
        Numbers of reflections, samples per pixel or tolerances, lobe and seed.
    progress : callable or None
        Called with (samples per pixel done, expected).

    Raises
    ------
    InputError
        If no ray hits the target.
    """
    view, target, path = setting.view, setting.target, setting.path
    with rendered_as(view, sampling):
        integrator = view.mi.integrator()
        largest, truncation = integrator.max_bounces, integrator.truncation
    is_auto = sampling.most_bounces == "auto"
    bounces = (largest,) if is_auto or not sampling.max_bounces else sampling.max_bounces

    of_background = approximations.share_of_background(view, [setting])
    of_background += approximations.share_of_reflections(setting)

    @cache
    def of_light(sources: tuple[Source, ...]) -> np.ndarray:
        return approximations.shares_of_light(setting, list(sources))

    def irradiance(result: Signature) -> Irradiance:
        of_paths = result.degrees_of_freedom, result.missed, result.systematic
        approximated = of_light(tuple(result.effective_areas.sources)), of_background
        return Irradiance(
            result.effective_areas,
            RenderError(*of_paths, *approximated),
            setting.detector.band,
            setting.air,
            setting.backdrop,
        )

    def excess(result: Signature) -> float:
        """Ratio of the half width of the contrast's 95 % interval to the allowed one.

        It is the largest one of all numbers of reflections that a pass records.
        """
        ratios = []
        for each in (result, *result.fewer):
            if each.paths >= ENOUGH_TO_MEET:
                check_met(each, target)
            terms = irradiance(each)
            check_reachable(sampling, terms, path)
            allowed = sampling.allowed(terms.at(path)["total"].value)
            # No number of paths reduces an approximation
            by_paths = terms.approximated(path) > MOST_APPROXIMATED * allowed
            width = terms.half_width_of_paths(path) if by_paths else terms.half_width(path)
            ratios.append(width / allowed if allowed > 0 else np.inf)
        return max(ratios)

    def measured(k: int, sampled: Sampling, aim: Aim | None, up_to=()) -> Signature:
        settings = {"max_bounces": bounces[k], "truncation": truncation}
        with changed(view, lobe=sampling.lobe, **settings):
            return measure_signature(
                view,
                replace(sampled, progress=partial(step, k)),
                by_spectrum=True,
                excess=excess if sampled.paths is None and sampling.has_tolerance else None,
                aim=aim,
                up_to=up_to,
                parts=("bounce",) if up_to else (),
            )

    def step(k, done, total):
        if progress:
            progress(k * total + done, len(bounces) * total)

    if len(set(bounces)) > 1 and is_one_pass(view, max(bounces)):
        *fewer, most = sorted(set(bounces))
        result = measured(bounces.index(most), sampling.of_render(), None, tuple(fewer))
        by_count = dict(zip((*fewer, most), (*result.fewer, replace(result, fewer=()))))
        for count in bounces:
            result = by_count[count]
            check_met(result, target)
            reached = excess(result) <= 1 if sampling.has_tolerance else None
            yield count, irradiance(result), replace(result, reached=reached)
        return
    results, aim = {}, None
    for k in np.argsort(bounces)[::-1]:  # the first render, with most reflections, aims the others
        results[k] = measured(k, sampling.of_render(), aim)
        aim = results[k].aim
    # Renders share their paths, so that their differences are more precise than their values
    most = max(results.values(), key=lambda result: result.paths)
    for k, count in enumerate(bounces):
        result = results[k]
        if result.paths != most.paths or result.aim is not most.aim:
            anew = measured(k, Sampling(paths=most.paths, seed=sampling.seed), most.aim)
            result = replace(anew, reached=excess(anew) <= 1)
        check_met(result, target)
        yield count, irradiance(result), result


def is_one_pass(view: Scene, most: int) -> bool:
    """Whether a pass records the sources of a scene for fewer reflections than the most."""
    with view.prepared(by_spectrum=True) as tracer:
        by_bin = tracer.emitters.sources.by_bin
    return tracer.closure == "none" and not by_bin and most < MAX_BOUNCE_CHANNELS


def check_reachable(sampling: RenderTable, irradiance: Irradiance, path: LineOfSight) -> None:
    """Raise InputError if no number of samples reaches the tolerances of a contrast.

    A relative tolerance is judged only where the contrast differs from zero by more than its 95 %
    interval, and with the largest contrast of that interval.
    """
    contrast, half_width = irradiance.at(path)["total"].value, irradiance.half_width(path)
    if sampling.tolerance is not None and abs(contrast) <= half_width:
        return
    least = irradiance.least_half_width(path)
    allowed = sampling.allowed(abs(contrast) + half_width)
    if allowed <= least:
        raise InputError(
            f"[render]: a tolerance of {allowed:.2g} W m^-2 cannot be reached: Float32's rounding "
            "and tabulated emissivities leave half a 95 % interval of "
            f"{least:.2g} W m^-2; ask for more than that"
        )


def check_met(result: Signature, target: Target) -> None:
    """Raise InputError if the paths of a render met no more of the target than by rounding."""
    if not result.effective_areas.projected_area > SMALLEST_TARGET * target.radius**2:
        raise InputError("no ray hit the target; raise resolution or spp of [render]")


def row(
    max_bounces: int,
    irradiance: Irradiance,
    path: LineOfSight,
    detector: Detector,
    target: Target,
    reached: bool | None,
) -> ContrastRow:
    """The row of a target at the end of a path.

    Parameters
    ----------
    max_bounces : int
        Number of reflections of the render.
    irradiance : Irradiance
        Irradiances of the target at any range.
    path : LineOfSight
        Path from the target to the sensor.
    detector : Detector
        Detector of the sensor.
    target : Target
        Sphere that holds the target.
    reached : bool or None
        Whether a tolerance was reached; None without one.
    """
    terms = irradiance.at(path)
    total, area = terms["total"], irradiance.projected_area
    nei_max = total.through(lambda value: float(detector.nei_max(value)))
    empty = no_target(irradiance, detector, path)
    return ContrastRow(
        max_bounces,
        **terms,
        half_width=irradiance.half_width(path),
        approximated=irradiance.approximated(path),
        reached=reached,
        nei_max=nei_max,
        projected_area=area,
        solid_angle=area.value / path.range_m**2,
        observed=None
        if empty is None or overfills(target, path.range_m, detector)
        else empty + total.value,
        detected=None if detector.nei is None else bool(detector.detects(total.value)),
        irradiance=irradiance,
    )


def no_target(irradiance: Irradiance, detector: Detector, path: LineOfSight) -> float | None:
    """Irradiance of the background in the whole field of view, W m^-2 (3.15).

    It is None without a field of view.
    """
    return (
        None
        if detector.solid_angle is None
        else irradiance.in_band(irradiance.background(path)) * detector.solid_angle
    )


def overfills(target: Target, range_m: float, detector: Detector) -> bool:
    """Whether the target's sphere is wider than the field of view.

    A part of the target may then lie outside, and Eq 3.18 does not hold.
    """
    return (
        detector.field_of_view_deg is not None
        and np.degrees(2 * np.arcsin(target.radius / range_m)) > detector.field_of_view_deg
    )


def unlit_sky(view: Scene, scenario: Scenario, detector: Detector) -> list[str]:
    """Remark on a sky without scattered sunlight behind a scene with a sun, in a list.

    Scattered sunlight matters in MWIR, where there are tables of the daytime sky.
    """
    behind, is_thermal = scenario.background, detector.band.lower_um < THERMAL_UM
    if behind.sky is None or behind.by_day or not is_thermal or one_sun(view.mi.emitters()) is None:
        return []
    return [
        "the scene has a sun, but `sky` of [background] has no scattered sunlight; "
        "`daytime_sky` has it in MWIR"
    ]


def remarks(
    rows: list[ContrastRow], detector: Detector, target: Target, range_m: float
) -> list[str]:
    """Remarks on the limits of the results, one line each.

    Parameters
    ----------
    rows : list of ContrastRow
        Rows of the contrast.
    detector : Detector
        Detector of the sensor.
    target : Target
        Sphere that holds the target.
    range_m : float
        Range, m.
    """
    lines = [
        f"with {row.max_bounces} reflections the contrast is less than {SIGNIFICANT} standard "
        f"errors: it may be zero; {REMEDIES[row.reached]}"
        for row in rows
        if abs(row.total.value) < SIGNIFICANT * row.total.standard_error
    ]
    if overfills(target, range_m, detector):
        lines.append(
            f"the target's sphere, {target.radius:.4g} m in radius, is wider than the field of "
            "view: the true signal may be smaller"
        )
    if range_m < NEAR * target.radius:
        lines.append(
            f"the range is only {range_m / target.radius:.2g} radii of the target, but the "
            "target is rendered with parallel rays, as if it were far away"
        )
    return lines
