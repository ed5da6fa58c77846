"""Public functions that write pages."""

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from importlib.metadata import version
from operator import attrgetter
from os import PathLike
from typing import Any

import mi_lcair
from mi_lcair.api.scenes import scene_of
from mi_lcair.declared import fraction
from mi_lcair.detection.scenario import Scenario
from mi_lcair.detection.setting import rendered_as, setting_of
from mi_lcair.errors import InputError, complete
from mi_lcair.progress import Progress
from mi_lcair.rendering.facets import FacetTable
from mi_lcair.rendering.scene import Scene, SceneLike
from mi_lcair.rendering.window import toward_sensor, window_size
from mi_lcair.results import Result, settings_section
from mi_lcair.sections import Facts, Remarks, Section, remarks
from mi_lcair.show import kinds
from mi_lcair.show.page import reading
from mi_lcair.show.page.page import check_output, save
from mi_lcair.tasks import exclusively

# `report`, which writes the page of one subject or of several
# ------------------------------------------------------------

What = SceneLike | Result  # what a page shows: a file, a name, a scene or a result
PHOTONS = 2**16  # photons from each emitter in the audit of a page
SPP = 64  # samples per pixel of a scenario that states none
TAKEN = (
    "report takes a radiance image (.exr), the .json of a result, the .csv or .nc of a trend, "
    "facets, a spectrum, a sweep or a flight, a model (.obj and others), a scene (.xml, bundled "
    "name or the folder of an import) and a scenario (.toml or bundled name)"
)


@dataclass(frozen=True)
class Request:
    """How the subjects on a page are made.

    Attributes
    ----------
    scene : SceneLike or None
        Scene whose model shows a table of facets or the facets of a signature's JSON.
    parameters : dict of str to str
        $-parameters of scenes, or changes of a scenario's entries.
    sampling : dict
        spp, tolerance, max_spp, seed and sensor of renders, those that were given.
    progress : callable or None
        Called with (samples per pixel done, expected).
    """

    scene: SceneLike | None
    parameters: dict[str, str]
    sampling: dict
    progress: Progress | None

    @property
    def sensor(self) -> int:
        return self.sampling.get("sensor", 0)

    @property
    def seed(self) -> int:
        return self.sampling.get("seed", 0)


@exclusively
def report(
    what: What | Sequence[What],
    path: str | PathLike[str],
    *,
    scene: SceneLike | None = None,
    parameters: Mapping[str, object] | None = None,
    spp: int | None = None,
    tolerance: float | str | None = None,
    max_spp: int | None = None,
    seed: int | None = None,
    sensor: int | None = None,
    command: str | None = None,
    progress: Progress | None = None,
) -> list[str]:
    """Write a page in HTML that shows something, with pictures to hover and turn.

    The page is one file and loads nothing from the network. The same input gives the same page,
    byte for byte.

    Parameters
    ----------
    what : str, path-like, Scene, result, or sequence of these
        A radiance image (EXR); the JSON of a result; the CSV or netCDF of a trend, facets, a
        spectrum, a sweep or a flight; a model; a scene (XML or bundled name), which is rendered; a
        scenario (TOML or bundled name), whose contrast is computed; or a result in memory.
    path : path-like
        File to write, FILE.html.
    scene : Scene, str, Path or mi.Scene, optional
        Scene whose model shows the facets of a CSV.
    parameters : dict, optional
        $-parameters of scenes; entries of scenarios, such as {"sensor.band": "LWIR"}.
    spp : int, optional
        Samples per pixel of images and signatures (default: the number of the scene or scenario).
    tolerance : float or str, optional
        Instead of spp: half of the 95 % interval of the scene's intensity or the scenario's
        contrast, as a fraction of it, such as 0.01 or "1%".
    max_spp : int, optional
        Largest number of samples per pixel for a tolerance.
    seed, sensor : int, optional
        As for `render`.
    command : str, optional
        Command to print on the page as the one that made it.
    progress : callable, optional
        Called with (samples per pixel done, expected).

    Returns
    -------
    list of str
        Warnings about the content of the page, one line each.

    Raises
    ------
    InputError
        If something cannot be shown, or the file cannot be written. Nothing is written then.
    """
    check_output(path)
    subjects = list(what) if isinstance(what, (list, tuple)) else [what]
    if not subjects:
        raise InputError("a report needs something to show; name a file, a scene or a scenario")
    options = {
        "spp": spp,
        "tolerance": fraction(tolerance),
        "max_spp": max_spp,
        "seed": seed,
        "sensor": sensor,
    }
    request = Request(
        scene=str(scene) if isinstance(scene, PathLike) else scene,
        parameters={name: str(value) for name, value in (parameters or {}).items()},
        sampling={name: value for name, value in options.items() if value is not None},
        progress=progress,
    )
    pages = [page_of(subject, request) for subject in subjects]
    sections = [
        Section(f"{title}: {section.title}" if len(pages) > 1 else section.title, section.parts)
        for title, of_thing in pages
        for section in sorted(of_thing, key=attrgetter("is_detail"))
    ]
    title = ", ".join(title for title, _ in pages)
    stated = ", ".join(f"'{subject}'" for subject in subjects if str(subject).endswith(".json"))
    with complete(f"{stated}: a result that") if stated else nullcontext():
        save(path, title, [*sections, this_page(command, subjects)])
    return remarks(sections)


def page_of(what: What, request: Request) -> tuple[str, list[Section]]:
    """Title and sections of one subject."""
    if isinstance(what, Result):
        return what.page_title(), what.page()
    kind = kinds.kind_of(what) if isinstance(what, (str, PathLike)) else kinds.SCENE
    if kind == kinds.SCENE:
        return of_scene(scene_of(what, request.parameters), request)
    if kind == kinds.SCENARIO:
        return of_scenario(str(what), request)
    if not kinds.KINDS[kind].page:
        raise InputError(f"'{what}' is {kind}, which no page shows; {TAKEN}")
    return reading.read(str(what), kind, model_of(request))


def model_of(request: Request) -> reading.SceneModel | None:
    """The model of the scene that was given for tables of facets, if there is one."""
    if request.scene is None:
        return None
    scene = scene_of(request.scene, request.parameters)
    facets = FacetTable(scene)
    return reading.SceneModel(
        scene.name,
        request.parameters,
        facets.triangles,
        facets.triangle_facet,
        toward_sensor(scene.sensor(request.sensor)),
        scene.band,
    )


def of_scene(scene: Scene, request: Request) -> tuple[str, list[Section]]:
    """Title and sections of a scene: image, signature with facets and spectrum, audit."""
    sampling, progress = request.sampling, request.progress
    is_orthographic = window_size(scene.sensor(request.sensor)) is not None
    if not is_orthographic and "tolerance" in sampling:
        raise InputError(
            f"{scene.name}: a tolerance is for the signature, which needs an orthographic sensor; "
            "give spp instead"
        )
    of_image = {name: sampling[name] for name in ("spp", "seed", "sensor") if name in sampling}
    sections = mi_lcair.render(scene, **of_image, parts=True, progress=progress).sections()
    if is_orthographic:
        signature = mi_lcair.signature(
            scene, **sampling, by_spectrum=not scene.band.is_total, facets=True, progress=progress
        )
        sections += signature.sections(scene=scene, sensor=request.sensor)
    sections += audit_of(scene, request.seed)
    if scene.remarks:
        parts = [Remarks(scene.remarks)]
        sections.append(Section("Remarks on the scene", parts, is_detail=True))
    return scene.name, sections


def audit_of(scene: Scene, seed: int) -> list[Section]:
    """The sections of a scene's audit, or a warning if the audit is not possible for the scene."""
    try:
        return mi_lcair.audit(scene, paths=PHOTONS, seed=seed).sections()
    except InputError as error:
        return [Section("Energy audit", [Remarks([f"no audit: {error}"])])]


def of_scenario(what: str, request: Request) -> tuple[str, list[Section]]:
    """Title and sections of a scenario.

    They are the image through the air (of the camera, if the scenario has one), the contrast with
    its ranges and spectra, the facets, the audit, and how the page was made.
    """
    names = ("spp", "tolerance", "max_spp", "seed")
    given = request.sampling.items()
    entries = {f"render.{name}": value for name, value in given if name in names}
    scenario = Scenario.read(what, **request.parameters | entries)
    contrast = mi_lcair.contrast(scenario, progress=request.progress)
    setting, render = setting_of(scenario), scenario.render
    view = setting.view
    sampling = {"seed": render.seed, "progress": request.progress}
    with rendered_as(view, render):
        if scenario.camera is not None:
            image = mi_lcair.image(scenario, **sampling)
        else:
            image = mi_lcair.render(
                view,
                spp=render.spp or SPP,
                parts=True,
                atmosphere=setting.air,
                range_m=scenario.observer.range_m,
                **sampling,
            )
        signature = mi_lcair.signature(
            view, spp=render.spp or SPP, by_spectrum=True, facets=True, **sampling
        )
        audit = audit_of(view, request.seed)
    seen, by = view.band.label, setting.detector.band.label
    unweighted = f"of the scene's {seen}, not of the response {by}: the scene has no parameter band"
    remarks = [Remarks([f"intensities and facets are those {unweighted}"])] if seen != by else []
    return scenario.heading, [
        *image.sections(),
        *contrast.sections(),
        *([Section("Band of the intensities", remarks)] if remarks else []),
        *signature.sections(scene=view),
        *audit,
        settings_section("Scenario", scenario),
    ]


def this_page(command: str | None, subjects: list) -> Section:
    """How a page was made: the call and the versions that read and drew it."""
    names = ", ".join(
        repr(str(subject)) if isinstance(subject, (str, PathLike)) else type(subject).__name__
        for subject in subjects
    )
    rows = [
        ("made by", command or f"mi_lcair.report({names})"),
        ("mi_lcair", mi_lcair.__version__),
        ("plotly", version("plotly")),
    ]
    return Section("This page", [Facts(rows)])


# `save_page`, the page of one result: what `Result.save` does for FILE.html
# --------------------------------------------------------------------------


def save_page(path: str | PathLike[str], result: Result, **options: Any) -> None:
    """Write the page of a result in memory.

    Parameters
    ----------
    path : path-like
        File to write, FILE.html.
    result : Result
        Any result.
    **options
        Options of its sections, such as `scene`, which shows the facets of a signature. A scene may
        be given in any form that `mi_lcair.load` takes.

    Raises
    ------
    InputError
        If the file cannot be written, or if the result has no such option.
    """
    check_output(path)
    if "scene" in options:
        options["scene"] = scene_of(options["scene"])
    save(path, result.page_title(), result.page(**options))
