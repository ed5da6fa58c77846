"""`flight`, the contrast of a moving target against time."""

from dataclasses import replace
from os import PathLike
from pathlib import Path

from mi_lcair.api.scenario import scenario_of
from mi_lcair.camera.sequence import check_film, film
from mi_lcair.detection.scenario import Scenario
from mi_lcair.errors import errors_of
from mi_lcair.files import together
from mi_lcair.progress import Progress
from mi_lcair.startup.threads import exclusively
from mi_lcair.sweeps.areas_folder import AreasFolder
from mi_lcair.sweeps.flight import measure_flight
from mi_lcair.sweeps.flight_result import Flight


@exclusively
def flight(
    scenario: Scenario | str | PathLike[str],
    areas: str | PathLike[str] | None = None,
    frames: str | PathLike[str] | None = None,
    video: str | PathLike[str] | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Flight:
    """Contrast of a scenario's target at each moment of its flight.

    Views are traced at some moments, and more where the contrast does not change linearly between
    them. Air, range and background are calculated for each moment.

    Parameters
    ----------
    scenario : Scenario, str or path-like
        Scenario with a table [flight], or what `Scenario.read` takes. `tolerance` of its [render]
        is half of the 95 % interval of each traced intensity, as a fraction of it.
    areas : path-like, optional
        Folder that keeps the effective areas. What it holds is not traced again.
    frames : path-like, optional
        TIFF to write, FILE.tif: the counts of the scenario's [camera] at each moment, 16-bit pages.
    video : path-like, optional
        The same for people, FILE.gif.
    seed : int
        Seed of the camera's noise and fixed pattern.
    progress : callable, optional
        Called with (moments done, all moments).

    Returns
    -------
    Flight

    Raises
    ------
    InputError
        If the scenario or its path cannot be used, or if the path leads into the ground.
    """
    scenario = scenario_of(scenario)
    outputs = (None if frames is None else Path(frames), None if video is None else Path(video))
    with errors_of(f"scenario '{scenario.name}'"), together():
        if any(outputs):
            check_film(scenario, *outputs)
        folder = None if areas is None else AreasFolder(areas)
        made = measure_flight(scenario, folder, progress=progress)
        if not any(outputs):
            return made
        return replace(made, rendered=film(scenario, *outputs, seed, progress))
