"""What a target adds to a sensor's signal: its own radiation through the air, the air's, less the
background that it hides.

Thesis 3.7 and 3.8, Eqs 3.13-3.19, for a scenario: the target is rendered, everything else follows
from its effective areas.
"""

import time
from dataclasses import asdict, dataclass, field
from functools import partial

import numpy as np

from mi_lcair.detection.detection_range import DetectionRange, detection_range
from mi_lcair.detection.irradiance import Backdrop, Estimate, Irradiance
from mi_lcair.detection.scenario import Scenario
from mi_lcair.errors import InputError
from mi_lcair.physics.atmosphere import Atmosphere, LineOfSight, atmosphere
from mi_lcair.physics.blackbody import spectral_radiance
from mi_lcair.physics.detector import Detector
from mi_lcair.physics.spectrum import has_elevations, spectrum
from mi_lcair.rendering.loading.files import survey
from mi_lcair.rendering.scene import Scene, find, load
from mi_lcair.rendering.settings import changed
from mi_lcair.rendering.statistics import invalid_remark
from mi_lcair.rendering.views import Target, View, hidden_share, seen_from
from mi_lcair.signatures.signature import signature

SIGNIFICANT = 3  # standard errors
NEAR = 10  # radii of the target, within which rays to the observer are not parallel


@dataclass(frozen=True)
class Row:
    """The target with so many reflections, each with its standard error.

    intensity: before the air [W/sr] (3.13). target: apparent irradiance (3.16), path and
    background: of the air before it and of what it hides, total: the contrast (3.19), positive or
    negative, at the aperture, times the response [W m^-2]. nei_max (3.14) is behind the optics.
    observed: with the field of view's background (3.18), where there is a field of view; detected:
    where there is a nei. projected_area [m^2]; solid_angle [sr] (3.17).
    """

    max_bounces: int
    intensity: Estimate
    target: Estimate
    path: Estimate
    background: Estimate
    total: Estimate
    nei_max: Estimate
    projected_area: Estimate
    solid_angle: float
    observed: float | None
    detected: bool | None
    irradiance: Irradiance = field(repr=False)

    def as_dict(self) -> dict:
        entries = {name: value for name, value in vars(self).items() if name != "irradiance"}
        return {
            name: value._asdict() if isinstance(value, Estimate) else value
            for name, value in entries.items()
        }


@dataclass(frozen=True)
class Contrast:
    """A scenario's numbers: a row for each number of reflections, and what they stand on.

    sight_elevation_deg: of the line of sight, upward from the sensor. transmittance: mean in the
    band, path_radiance and background_radiance [W m^-2 sr^-1]: times the response. no_target: the
    background in the whole field of view (3.15) [W m^-2], where there is one. radius_m: of the
    sphere that holds the target. remarks: what to know before trusting it.
    """

    scenario: Scenario
    detector: Detector
    air: Atmosphere
    path: LineOfSight
    sight_elevation_deg: float
    background_name: str
    transmittance: float
    path_radiance: float
    background_radiance: float
    no_target: float | None
    radius_m: float
    rows: list[Row]
    remarks: list[str]
    seconds: float

    def detection_ranges(self) -> list[DetectionRange]:
        """For each row, along the same line of sight. Raises InputError without a nei."""
        return [
            detection_range(row.irradiance, self.detector, self.air, self.radius_m)
            for row in self.rows
        ]

    def as_dict(self) -> dict:
        """For JSON: the scenario as it was read, what was found, and the rows."""
        plain = (
            "sight_elevation_deg",
            "transmittance",
            "path_radiance",
            "background_radiance",
            "no_target",
            "radius_m",
            "remarks",
            "seconds",
        )
        return {
            "scenario": asdict(self.scenario),
            "band": self.detector.band.label,
            "range_m": self.path.range_m,
            "atmosphere": self.air.name,
            "background": self.background_name,
            **{name: getattr(self, name) for name in plain},
            "rows": [row.as_dict() for row in self.rows],
        }


def contrast(scenario, progress=None) -> Contrast:
    """The contrast of a scenario (3.19) and its parts, for each of its numbers of reflections.

    scenario: a Scenario, or what Scenario.read takes. progress: called with (samples per pixel
    done, expected). Raises InputError; what only needs reading is refused before anything is
    rendered.
    """
    if not isinstance(scenario, Scenario):
        scenario = Scenario.read(scenario)
    try:
        return measured(scenario, progress)
    except InputError as error:
        raise InputError(f"scenario '{scenario.name}': {error}") from None


def measured(scenario: Scenario, progress) -> Contrast:
    start = time.perf_counter()
    observer, sampling = scenario.observer, scenario.render
    detector = scenario.sensor.detector()
    air = atmosphere(scenario.atmosphere.table, scenario.atmosphere.ranges_m)
    air.check_covers(detector.band)
    path = air.path(observer.range_m, scenario.atmosphere.extrapolate)
    behind = backdrop(scenario, detector)

    scene = target_scene(scenario, detector)
    target = Target.of(scene)
    if observer.range_m <= target.radius:
        raise InputError(
            f"the observer is inside the target: range {observer.range_m:g} m, but {scene.name} "
            f"reaches {target.radius:.4g} m from its middle"
        )
    view = seen_from(scene, View(observer.azimuth_deg, observer.elevation_deg), sampling.resolution)
    bounces = sampling.max_bounces or (scene.mi.integrator().max_bounces,)
    rows, invalid, paths = [], 0, 0
    for k, count in enumerate(bounces):

        def step(done, total):
            if progress:
                progress(k * total + done, len(bounces) * total)

        with changed(view, lobe=sampling.lobe, max_bounces=count):
            found = signature(
                view, sampling.spp, seed=sampling.seed, by_spectrum=True, progress=step
            )
        invalid, paths = invalid + found.invalid, paths + found.paths
        if not found.effective_areas.projected_area > 0:
            raise InputError("no ray met the target; raise resolution or spp of [render]")
        seen = found.target
        relative_error = seen.standard_error / seen.intensity if seen.intensity > 0 else 0.0
        rows.append(
            row(
                count,
                Irradiance(found.effective_areas, relative_error, detector.band, air, behind),
                path,
                detector,
                target,
            )
        )
    seen = rows[-1].irradiance
    transmittance, radiance = path.at(seen.wavelengths_um)
    mean_transmittance = seen.in_band(transmittance) / float(seen.weights_um.sum())
    return Contrast(
        scenario=scenario,
        detector=detector,
        air=air,
        path=path,
        sight_elevation_deg=0.0 - observer.elevation_deg,
        background_name=behind.name,
        transmittance=mean_transmittance,
        path_radiance=seen.in_band(radiance),
        background_radiance=seen.in_band(seen.backdrop),
        no_target=no_target(seen, detector),
        radius_m=target.radius,
        rows=rows,
        remarks=[
            *view.remarks,
            *invalid_remark(invalid, paths),
            *remarks(
                rows, detector, target, observer.range_m, hidden_share(view, observer.range_m)
            ),
        ],
        seconds=time.perf_counter() - start,
    )


def backdrop(scenario: Scenario, detector: Detector) -> Backdrop:
    """The background in the direction of the line of sight."""
    temperature, sky = scenario.background.temperature, scenario.background.sky
    if temperature is not None:
        return Backdrop(
            f"blackbody at {temperature:g} K",
            partial(spectral_radiance, temperature=temperature),
            np.empty(0),
        )
    elevation = -scenario.observer.elevation_deg if has_elevations(sky) else None
    if elevation is not None and elevation < 0:
        raise InputError(
            f"the line of sight looks down, by {-elevation:g} degrees, where no sky is behind "
            "the target; give [background] a temperature"
        )
    table = spectrum(sky, elevation)
    table.in_band_radiance(detector.band)  # refuses what does not cover the band
    return Backdrop(f"sky {table.name}", table.at, table.wavelengths_um)


def target_scene(scenario: Scenario, detector: Detector) -> Scene:
    """The scene as the scenario wants it, in a band that holds the detector's."""
    parameters, source = scenario.scene_parameters(), scenario.target.scene
    if "band" in survey(find(source), parameters):
        parameters["band"] = scenario.sensor.band
    scene = load(source, **parameters)
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
    max_bounces: int, irradiance: Irradiance, path: LineOfSight, detector: Detector, target: Target
) -> Row:
    terms = irradiance.at(path)
    total, area = terms["total"], irradiance.projected_area
    nei_max = Estimate(*(float(detector.nei_max(value)) for value in total))
    empty = no_target(irradiance, detector)
    return Row(
        max_bounces,
        **terms,
        nei_max=nei_max,
        projected_area=area,
        solid_angle=area.value / path.range_m**2,
        observed=None
        if empty is None or overfills(target, path.range_m, detector)
        else empty + total.value,
        detected=None if detector.nei is None else bool(detector.detects(total.value)),
        irradiance=irradiance,
    )


def no_target(irradiance: Irradiance, detector: Detector) -> float | None:
    """The background in the whole field of view [W m^-2] (3.15); None without one."""
    return (
        None
        if detector.solid_angle is None
        else irradiance.in_band(irradiance.backdrop) * detector.solid_angle
    )


def overfills(target: Target, range_m: float, detector: Detector) -> bool:
    """Whether the target's sphere is wider than the field of view, so that the whole of it is not
    the signal (3.18).
    """
    return (
        detector.field_of_view_deg is not None
        and np.degrees(2 * np.arcsin(target.radius / range_m)) > detector.field_of_view_deg
    )


def remarks(
    rows: list[Row], detector: Detector, target: Target, range_m: float, hidden: float
) -> list[str]:
    found = [
        f"with {row.max_bounces} reflections the contrast is less than {SIGNIFICANT} of its standard errors: not told from zero; raise spp"
        for row in rows
        if abs(row.total.value) < SIGNIFICANT * row.total.standard_error
    ]
    if overfills(target, range_m, detector):
        found.append(
            f"the target's sphere, {target.radius:.4g} m in radius, is wider than the field of view: the signal may be less than stated"
        )
    if range_m < NEAR * target.radius:
        found.append(
            f"the range is only {range_m / target.radius:.2g} radii of the target, which is seen by parallel rays: true far away only"
        )
    if hidden > 0:
        found.append(
            f"{hidden:.0%} of the target has sky or terrain of the scene between it and the observer, which is not taken to hide it"
        )
    return found
