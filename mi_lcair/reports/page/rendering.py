"""Pages of scenes and scenarios: what is rendered for them, and how."""

from dataclasses import asdict

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.rendering.scene import scene_of
from mi_lcair.rendering.window import window_size
from mi_lcair.reports.page.contrast_panel import contrast_sections
from mi_lcair.reports.page.page import Section
from mi_lcair.reports.page.reading import Request
from mi_lcair.reports.page.sections import (
    audit_section,
    camera_sections,
    image_sections,
    plan_section,
    signature_sections,
)
from mi_lcair.reports.page.tables import facts, listed

PHOTONS = 2**16  # photons from each emitter in the audit of a page
PLAN_TOLERANCE = 0.01  # tolerance of a plan without one


def of_scene(what, request: Request):
    """Title and sections of a scene: image, signature with facets and spectrum, audit, plan."""
    scene = scene_of(what, request.parameters)
    sampling, sensor = request.sampling, request.sampling.get("sensor", 0)
    camera = scene.sensor(sensor)
    size_m = window_size(camera)
    planned, sections = None, []
    if size_m is None and (request.plan or "tolerance" in sampling):
        raise InputError(
            f"{scene.name}: a tolerance or a plan is for the signature, which needs an "
            "orthographic sensor; give spp instead"
        )
    if request.plan:
        tolerance = sampling.get("tolerance", PLAN_TOLERANCE)
        planned = mi_lcair.plan(
            scene, tolerance, seed=sampling.get("seed", 0), sensor=sensor, progress=request.progress
        )
    of_image = {name: sampling[name] for name in ("spp", "seed", "sensor") if name in sampling}
    image = mi_lcair.render(scene, **of_image, progress=request.progress)
    *images, made = image_sections(image.channels, image.header)
    sections += images
    if size_m is not None:
        sections += signature_of(scene, request, planned)
    if planned:
        sections.append(plan_section(planned))
    sections += audit_of(scene, request)
    made.parts[:0] = [listed(scene.remarks)]
    return scene.name, [*sections, Section("How it was made", made.parts)]


def signature_of(scene, request: Request, planned) -> list[Section]:
    """Sections of a scene's signature, with its facets and, in a band with limits, its spectrum."""
    options = {"by_spectrum": not scene.band.is_total, "facets": True}
    result = mi_lcair.signature(
        scene, **request.sampling, **options, plan=planned, progress=request.progress
    )
    return signature_sections(result, scene, request.sampling.get("sensor", 0))


def audit_of(scene, request: Request) -> list[Section]:
    """The section of a scene's audit, or none for a scene whose flux cannot be followed."""
    try:
        audit = mi_lcair.audit(scene, photons=PHOTONS, seed=request.sampling.get("seed", 0))
    except InputError as error:
        request.notes.append(f"no audit: {error}")
        return []
    return [audit_section(audit)]


def of_scenario(what: str, request: Request):
    """Title and sections of a scenario.

    They are the image through the air (of the camera, if the scenario has one), the contrast with
    its ranges and spectra, the facets, the audit, and how all was made.
    """
    from mi_lcair.detection.scenario import Scenario
    from mi_lcair.detection.setting import setting_of
    from mi_lcair.rendering.settings import changed

    own = ("spp", "tolerance", "max_spp", "seed")
    sampling = {
        f"render.{name}": request.sampling[name] for name in own if name in request.sampling
    }
    scenario = Scenario.read(what, **request.parameters | sampling)
    contrast = mi_lcair.contrast(scenario, progress=request.progress)
    setting, render = setting_of(scenario), scenario.render
    view, spp = setting.view, render.spp or 64
    bounces = max(render.max_bounces, default=view.mi.integrator().max_bounces)
    with changed(view, lobe=render.lobe, max_bounces=bounces):
        if scenario.camera is None:
            image = mi_lcair.render(
                view,
                spp=spp,
                seed=render.seed,
                atmosphere=setting.air,
                range_m=scenario.observer.range_m,
                progress=request.progress,
            )
        else:
            image = mi_lcair.image(scenario, seed=render.seed, progress=request.progress)
        result = mi_lcair.signature(
            view,
            spp=spp,
            seed=render.seed,
            by_spectrum=True,
            facets=True,
            progress=request.progress,
        )
        audit = audit_of(view, request)
    if scenario.camera is None:
        *images, made = image_sections(image.channels, image.header)
    else:
        *images, made = camera_sections(image)
    sections = [
        *images,
        *contrast_sections(contrast),
        *signature_sections(result, view),
        *audit,
        Section("How it was made", [facts(entries_of(scenario)), *made.parts]),
    ]
    return f"{scenario.name}: {scenario.title}", sections


def entries_of(scenario) -> list[tuple[str, object]]:
    """The entries of a scenario that are given, as rows of a table."""
    rows = []
    for table, entries in asdict(scenario).items():
        if isinstance(entries, dict):
            given = {
                key: value for key, value in entries.items() if value not in (None, {}, [], ())
            }
            rows.append((f"[{table}]", ", ".join(f"{key} = {given[key]}" for key in given)))
    return [row for row in rows if row[1]]
