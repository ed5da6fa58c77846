"""`report`, which writes the page of one thing or of several."""

from collections.abc import Mapping, Sequence
from os import PathLike

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.fraction import fraction
from mi_lcair.progress import Progress
from mi_lcair.rendering.scene import SceneLike
from mi_lcair.reports.page.page import Section, check_output, save
from mi_lcair.reports.page.reading import Request, read
from mi_lcair.reports.page.sections import of_result
from mi_lcair.reports.page.tables import facts
from mi_lcair.results import Result

What = SceneLike | Result  # what a page shows: a file, a name, a scene or a result


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
    plan: str | None = None,
    command: str | None = None,
    progress: Progress | None = None,
) -> list[str]:
    """Write a page in HTML that shows something, with pictures to hover and turn.

    The page is one file and asks no network. The same input gives the same page, byte for byte.

    Parameters
    ----------
    what : str, path-like, Scene, result, or sequence of these
        A radiance image (EXR); a signature's or fit's JSON; the CSV of a trend, facets or spectrum;
        a scene (XML or bundled name), which is rendered; a scenario (TOML or bundled name), which
        is measured; or a result in memory.
    path : path-like
        File to write, FILE.html.
    scene : Scene, str, Path or mi.Scene, optional
        Scene whose model shows the facets of a CSV.
    parameters : dict, optional
        $-parameters of scenes; entries of scenarios, such as {"sensor.band": "LWIR"}.
    spp : int, optional
        Samples per pixel of images and signatures (those of the scene or scenario).
    tolerance : float or str, optional
        Instead of spp, for the signature of a scene or the contrast of a scenario: half of the 95 %
        interval as a fraction of the value, such as 0.01 or "1%".
    max_spp : int, optional
        Largest number of samples per pixel for a tolerance.
    seed, sensor : int, optional
        Seed of the random numbers, and number of the scene's sensor (0).
    plan : str, optional
        "auto": plan the signature of a scene, and show the plan.
    command : str, optional
        What to state as the call that made the page.
    progress : callable, optional
        Called with (samples per pixel done, expected).

    Returns
    -------
    list of str
        Remarks on what the page could not show, one line each.

    Raises
    ------
    InputError
        If something cannot be shown, or the file cannot be written. Nothing is written then.
    """
    check_output(path)
    several = list(what) if isinstance(what, (list, tuple)) else [what]
    if not several:
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
        plan=plan,
        progress=progress,
    )
    pages = [page_of(one, request) for one in several]
    save(path, *joined(pages, made_by(command, several)))
    return request.notes


def page_of(what: What, request: Request) -> tuple[str, list[Section]]:
    """Title and sections of one thing."""
    if isinstance(what, (str, PathLike)):
        return read(str(what), request)
    if isinstance(what, Result):
        return of_result(what)
    from mi_lcair.reports.page.rendering import of_scene

    return of_scene(what, request)


def joined(pages, made: str) -> tuple[str, list[Section]]:
    """One title and the sections of all pages; made: HTML that says how the page was made."""
    several = len(pages) > 1
    sections = [
        Section(f"{title}: {section.title}" if several else section.title, section.parts)
        for title, own in pages
        for section in own
    ]
    return ", ".join(title for title, _ in pages), [*sections, Section("This page", [made])]


def made_by(command: str | None, several: list) -> str:
    """How a page was made, as a table: the call and the versions that read and drew it."""
    shown = ", ".join(
        repr(str(one)) if isinstance(one, (str, PathLike)) else type(one).__name__
        for one in several
    )
    return facts(
        [
            ("made by", command or f"mi_lcair.report({shown})"),
            ("mi_lcair", mi_lcair.__version__),
            ("plotly", version()),
        ]
    )


def version() -> str:
    """Version of plotly."""
    from importlib.metadata import version

    return version("plotly")
