"""Contrast of a target at a sensor (thesis 3.7 and 3.8, Eqs 3.13-3.19).

The contrast is the target's radiation through the air, plus that of the air before it, less the
background that the target hides. Only the target is rendered. All other terms follow from its
effective areas.
"""

import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from mi_lcair.detection.contrast_result import Contrast, ContrastRow
from mi_lcair.detection.irradiance import Irradiance, RenderError
from mi_lcair.detection.remarks import averaged_plumes, multiplied_light
from mi_lcair.detection.scenario import RenderTable, Scenario
from mi_lcair.detection.setting import Setting, rendered_as, setting_of
from mi_lcair.errors import InputError
from mi_lcair.physics.air.atmosphere import LineOfSight
from mi_lcair.physics.detector import Detector
from mi_lcair.plugins.emitters.thermal_emitter import one_sun
from mi_lcair.plugins.paths.aim import Aim
from mi_lcair.plugins.recorders.by_bounce import MAX_BOUNCE_CHANNELS
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import Scene
from mi_lcair.rendering.settings import changed
from mi_lcair.rendering.statistics import invalid_remark
from mi_lcair.rendering.views import Target, terrain_remark
from mi_lcair.signatures.signature import measure_signature
from mi_lcair.signatures.signature_result import Signature

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


def measure_contrast(scenario: Scenario, progress) -> Contrast:
    """The contrast of a scenario, for each of its numbers of reflections."""
    start = time.perf_counter()
    setting = setting_of(scenario)
    detector, air, path, behind = setting.detector, setting.air, setting.path, setting.backdrop
    view, target, observer = setting.view, setting.target, scenario.observer
    rows, invalid, paths = [], 0, 0
    for bounces, irradiance, result in rendered(setting, scenario.render, progress):
        rows.append(row(bounces, irradiance, path, detector, target, result.reached))
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
            *multiplied_light(setting, irradiance.areas.sources),
            *remarks(rows, detector, target, observer.range_m),
            *terrain_remark(view, [observer.view], observer.range_m),
            *averaged_plumes(view, [setting]),
        ],
        seconds=time.perf_counter() - start,
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

    def irradiance(result: Signature) -> Irradiance:
        return Irradiance(
            result.effective_areas,
            RenderError(result.degrees_of_freedom, result.missed, result.systematic),
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
            ratios.append(terms.half_width(path) / allowed if allowed > 0 else np.inf)
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
        raise InputError("no ray met the target; raise resolution or spp of [render]")


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
    return lines
