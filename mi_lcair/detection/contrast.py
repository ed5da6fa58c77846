"""Contrast of a target at a sensor (thesis 3.7 and 3.8, Eqs 3.13-3.19).

The contrast is the target's radiation through the air, plus that of the air before it, less the
background that the target hides. Only the target is rendered. All other terms follow from its
effective areas.
"""

import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from os import PathLike
from typing import ClassVar

import numpy as np

from mi_lcair.detection.detection_range import DetectionRange, detection_range
from mi_lcair.detection.irradiance import Backdrop, Estimate, Irradiance
from mi_lcair.detection.line_of_sight import Sight, backdrop
from mi_lcair.detection.scenario import Sampling, Scenario, scenario_of
from mi_lcair.errors import InputError
from mi_lcair.fraction import fraction
from mi_lcair.physics.atmosphere import Atmosphere, LineOfSight
from mi_lcair.physics.detector import Detector
from mi_lcair.plugins.emission.one_sun import check_fits, one_sun
from mi_lcair.progress import Progress
from mi_lcair.rendering.loading.files import survey
from mi_lcair.rendering.scene import Scene, find, load
from mi_lcair.rendering.settings import changed
from mi_lcair.rendering.statistics import invalid_remark
from mi_lcair.rendering.views import Target, View, hidden_share, seen_from
from mi_lcair.results import Result
from mi_lcair.sensitivity.solution_file import apply_solution
from mi_lcair.signatures.signature import Signature, signature

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
    False: "no fraction of zero can be reached, so give tolerance_W_m2 of [render]",
}
NEAR = 10  # range, in radii of the target, below which rays to the observer are not parallel


@dataclass(frozen=True)
class Row:
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
    intensity: Estimate
    target: Estimate
    path: Estimate
    background: Estimate
    total: Estimate
    half_width: float
    reached: bool | None
    nei_max: Estimate
    projected_area: Estimate
    solid_angle: float
    observed: float | None
    detected: bool | None
    irradiance: Irradiance = field(repr=False)

    def estimates(self) -> dict[str, Estimate]:
        """Values with standard errors by name with the unit, in the order of the console's table.

        They are those of the attributes of the same names.
        """
        return {
            "intensity_W_sr": self.intensity,
            "target_W_m2": self.target,
            "background_W_m2": self.background,
            "path_W_m2": self.path,
            "total_W_m2": self.total,
            "nei_max_W_m2": self.nei_max,
            "projected_area_m2": self.projected_area,
        }

    def numbers(self) -> dict:
        """The other entries by name with the unit, such as half_width_W_m2."""
        return {
            "half_width_W_m2": self.half_width,
            "solid_angle_sr": self.solid_angle,
            "observed_W_m2": self.observed,
            "reached": self.reached,
            "detected": self.detected,
        }

    def as_dict(self) -> dict:
        """The row as a dictionary, for JSON."""
        estimates = {name: value._asdict() for name, value in self.estimates().items()}
        return {"max_bounces": self.max_bounces, **estimates, **self.numbers()}


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
        Heights above the ground, m. None where neither the scenario nor its air states them.
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
        Radius of the sphere that holds the target, m.
    rows : list of Row
        One row for each number of reflections.
    remarks : list of str
        Limits of the results, one line each.
    seconds : float
        Time of the calculation, s.
    """

    scenario: Scenario
    detector: Detector
    air: Atmosphere
    path: LineOfSight
    sight_elevation_deg: float
    observer_height_m: float | None
    target_height_m: float | None
    background_name: str
    transmittance: float
    path_radiance: float
    background_radiance: float
    no_target: float | None
    radius_m: float
    rows: list[Row]
    remarks: list[str]
    seconds: float

    kind: ClassVar[str] = "contrast"
    drawn_by: ClassVar[str] = "mi_lcair.reports.contrast_plot:figure"

    @property
    def reached(self) -> bool | None:
        """Whether all rows have reached a tolerance; None without one."""
        return all(row.reached for row in self.rows) if self.scenario.render.has_tolerance else None

    def detection_ranges(self) -> list[DetectionRange]:
        """Detection range of each row, along the line of sight. Raises InputError without a nei."""
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

    def entries(self) -> dict:
        """Entries for JSON: the scenario as it was read, the results, the rows, and the spectra.

        The spectra are those of the last row.
        """
        render = self.scenario.render
        return {
            "scenario_name": self.scenario.name,
            "scenario": asdict(self.scenario),
            "band": self.detector.band.label,
            "range_m": self.path.range_m,
            "atmosphere": self.air.name,
            "background": self.background_name,
            "tolerance": render.tolerance,
            "tolerance_W_m2": render.tolerance_W_m2,
            "reached": self.reached,
            "sight_elevation_deg": self.sight_elevation_deg,
            "observer_height_m": self.observer_height_m,
            "target_height_m": self.target_height_m,
            "transmittance": self.transmittance,
            "path_radiance_W_m2_sr": self.path_radiance,
            "background_radiance_W_m2_sr": self.background_radiance,
            "no_target_W_m2": self.no_target,
            "radius_m": self.radius_m,
            "remarks": self.remarks,
            "time_s": self.seconds,
            "rows": [row.as_dict() for row in self.rows],
            "spectrum": self.spectrum(),
        }

    def columns(self) -> dict[str, np.ndarray]:
        """A row for each number of reflections, with values and standard errors."""
        columns = {"max_bounces": np.array([row.max_bounces for row in self.rows])}
        for name in self.rows[0].estimates():
            estimates = np.array([row.estimates()[name] for row in self.rows])
            quantity, unit = name.rsplit("_W_" if "_W_" in name else "_", 1)
            unit = f"W_{unit}" if "_W_" in name else unit
            columns[name] = estimates[:, 0]
            columns[f"{quantity}_standard_error_{unit}"] = estimates[:, 1]
        for name in self.rows[0].numbers():
            values = [row.numbers()[name] for row in self.rows]
            columns[name] = np.array([np.nan if own is None else own for own in values], float)
        return columns

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


def contrast(
    scenario: Scenario | str | PathLike[str],
    progress: Progress | None = None,
    *,
    parameters: Mapping[str, object] | None = None,
    spp: int | None = None,
    tolerance: float | str | None = None,
    tolerance_W_m2: float | None = None,
    max_spp: int | None = None,
) -> Contrast:
    """Contrast of a scenario and its parts (3.19), for each number of reflections.

    Parameters
    ----------
    scenario : Scenario, str or path-like
        Scenario, or the file or bundled name that `Scenario.read` takes.
    progress : callable, optional
        Called with (samples per pixel done, expected).
    parameters : mapping of str to object, optional
        Entries of a scenario that is named, by dotted key such as {"sensor.band": "LWIR"}.
    spp, tolerance, tolerance_W_m2, max_spp
        Entries of [render] of a scenario that is named, see `Sampling`. The tolerance may be
        written 0.01 or "1%".

    Returns
    -------
    Contrast

    Raises
    ------
    InputError
        If the scenario cannot be used. All inputs are checked before anything is rendered.
    """
    scenario = scenario_of(
        scenario,
        parameters,
        spp=spp,
        tolerance=fraction(tolerance),
        tolerance_W_m2=tolerance_W_m2,
        max_spp=max_spp,
    )
    try:
        return measured(scenario, progress)
    except InputError as error:
        raise InputError(f"scenario '{scenario.name}': {error}") from None


def measured(scenario: Scenario, progress) -> Contrast:
    """The contrast of a scenario; see `contrast`."""
    start = time.perf_counter()
    setting = setting_of(scenario)
    detector, air, path, behind = setting.detector, setting.air, setting.path, setting.backdrop
    view, target, observer = setting.view, setting.target, scenario.observer
    rows, invalid, paths = [], 0, 0
    for bounces, irradiance, result in rendered(
        view, target, scenario.render, detector, air, path, behind, progress
    ):
        rows.append(row(bounces, irradiance, path, detector, target, result.reached))
        invalid, paths = invalid + result.invalid, paths + result.paths
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
            *invalid_remark(invalid, paths),
            *unlit_sky(view, scenario, detector),
            *remarks(
                rows, detector, target, observer.range_m, hidden_share(view, observer.range_m)
            ),
        ],
        seconds=time.perf_counter() - start,
    )


@dataclass(frozen=True)
class Setting:
    """What the contrast of a scenario is computed from, after all checks and before any render.

    Attributes
    ----------
    detector : Detector
    sight : Sight
        Line of sight with its air.
    air : Atmosphere
        Air between target and sensor.
    path : LineOfSight
        Path from the target to the sensor.
    backdrop : Backdrop
        Background of the target.
    target : Target
        Sphere that holds the target.
    view : Scene
        Scene with the sensor of the observer.
    """

    detector: Detector
    sight: Sight
    air: Atmosphere
    path: LineOfSight
    backdrop: Backdrop
    target: Target
    view: Scene


def setting_of(scenario: Scenario) -> Setting:
    """The setting of a scenario; raises InputError if the scenario cannot be used."""
    observer, detector = scenario.observer, scenario.sensor.detector()
    sight = Sight.of(scenario)
    air = sight.air
    air.check_covers(detector.band)
    path = air.path(observer.range_m, scenario.atmosphere.extrapolate)
    behind = backdrop(scenario, detector, sight)
    if behind.path_at is not None:
        behind.path_at(observer.range_m)  # raises InputError if the table ends before the ground
    scene = target_scene(scenario, detector)
    sun = one_sun(scene.mi.emitters())
    if sun is not None and scenario.background.daytime_sky is not None:
        check_fits(sun, scenario.background, "the daytime_sky of [background]")
    target = Target.of(scene)
    if observer.range_m <= target.radius:
        raise InputError(
            f"the observer is inside the target: range {observer.range_m:g} m, but {scene.name} "
            f"reaches {target.radius:.4g} m from its middle"
        )
    view = seen_from(
        scene, View(observer.azimuth_deg, observer.elevation_deg), scenario.render.resolution
    )
    return Setting(detector, sight, air, path, behind, target, view)


def rendered(
    view: Scene,
    target: Target,
    sampling: Sampling,
    detector: Detector,
    air: Atmosphere,
    path: LineOfSight,
    behind: Backdrop,
    progress,
):
    """Yield (number of reflections, Irradiance of the target, its Signature) for each render.

    Parameters
    ----------
    view : Scene
        Scene with the sensor of the observer.
    target : Target
        Sphere that holds the target.
    sampling : Sampling
        Numbers of reflections, samples per pixel or tolerances, lobe and seed.
    detector, air, path, behind : Detector, Atmosphere, LineOfSight, Backdrop
        What the irradiance depends on beside the target.
    progress : callable or None
        Called with (samples per pixel done, expected).

    Raises
    ------
    InputError
        If no ray hits the target.
    """
    bounces = sampling.max_bounces or (view.mi.integrator().max_bounces,)

    def irradiance(result: Signature) -> Irradiance:
        part = result.target
        return Irradiance(
            result.effective_areas,
            part.standard_error / part.intensity if part.intensity > 0 else 0.0,
            detector.band,
            air,
            behind,
            result.degrees_of_freedom,
            result.missed,
            result.systematic,
        )

    def excess(result: Signature) -> float:
        """Ratio of the half width of the contrast's 95 % interval to the allowed one."""
        if result.paths >= ENOUGH_TO_MEET:
            check_met(result, target)
        terms = irradiance(result)
        check_reachable(sampling, terms, path)
        allowed = sampling.allowed(terms.at(path)["total"].value)
        return terms.half_width(path) / allowed if allowed > 0 else np.inf

    for k, count in enumerate(bounces):

        def step(done, total):
            if progress:
                progress(k * total + done, len(bounces) * total)

        with changed(view, lobe=sampling.lobe, max_bounces=count):
            result = signature(
                view,
                sampling.spp,
                max_spp=sampling.max_spp,
                seed=sampling.seed,
                by_spectrum=True,
                progress=step,
                excess=excess if sampling.has_tolerance else None,
            )
        check_met(result, target)
        yield count, irradiance(result), result


def check_reachable(sampling: Sampling, irradiance: Irradiance, path: LineOfSight) -> None:
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
        raise InputError("no ray met the target; raise resolution or spp of [render]")


def target_scene(scenario: Scenario, detector: Detector) -> Scene:
    """The scene with the parameters of the scenario, in a band that holds the detector's."""
    parameters, source = scenario.scene_parameters(), scenario.target.scene
    if "band" in survey(find(source), parameters):
        parameters["band"] = scenario.sensor.band
    scene = load(source, **parameters)
    if scenario.target.solution is not None:
        apply_solution(scene, scenario.target.solution)
    wanted, has = detector.band, scene.band
    if has.is_total or wanted.lower_um < has.lower_um or wanted.upper_um > has.upper_um:
        raise InputError(
            f"the sensor's band {wanted.label} is not within that of {scene.name}, {has.label}"
        )
    if scenario.render.lobe is not None and not scene.surfaces():
        raise InputError(
            f"{scene.name} has no material with a fidelity ladder to set a lobe of; leave lobe out"
        )
    return scene


def row(
    max_bounces: int,
    irradiance: Irradiance,
    path: LineOfSight,
    detector: Detector,
    target: Target,
    reached: bool | None,
) -> Row:
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
    nei_max = Estimate(*(float(detector.nei_max(value)) for value in total))
    empty = no_target(irradiance, detector, path)
    return Row(
        max_bounces,
        **terms,
        half_width=irradiance.half_width(path),
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
    is_thermal = scenario.background.sky is not None and detector.band.lower_um < THERMAL_UM
    if not is_thermal or one_sun(view.mi.emitters()) is None:
        return []
    return [
        "the scene has a sun, but `sky` of [background] has no scattered sunlight; "
        "`daytime_sky` has it in MWIR"
    ]


def remarks(
    rows: list[Row], detector: Detector, target: Target, range_m: float, hidden: float
) -> list[str]:
    """Remarks on the limits of the results, one line each.

    Parameters
    ----------
    rows : list of Row
        Rows of the contrast.
    detector : Detector
        Detector of the sensor.
    target : Target
        Sphere that holds the target.
    range_m : float
        Range, m.
    hidden : float
        Share of the target that sky or terrain of the scene hides from the observer.
    """
    lines = [
        f"with {row.max_bounces} reflections the contrast is less than {SIGNIFICANT} of its "
        f"standard errors: it may be zero; {REMEDIES[row.reached]}"
        for row in rows
        if abs(row.total.value) < SIGNIFICANT * row.total.standard_error
    ]
    if overfills(target, range_m, detector):
        lines.append(
            f"the target's sphere, {target.radius:.4g} m in radius, is wider than the field of "
            "view: the signal may be less than stated"
        )
    if range_m < NEAR * target.radius:
        lines.append(
            f"the range is only {range_m / target.radius:.2g} radii of the target, but the target "
            "is rendered with parallel rays, as from far away"
        )
    if hidden > 0:
        lines.append(
            f"{hidden:.0%} of the target has sky or terrain of the scene between it and the "
            "observer; this sky or terrain is ignored and does not hide the target"
        )
    return lines
