"""`flight`, the contrast of a moving target against time."""

from os import PathLike

from mi_lcair.api.scenario import named_errors, scenario_of
from mi_lcair.detection.scenario import Scenario
from mi_lcair.progress import Progress
from mi_lcair.startup.threads import exclusively
from mi_lcair.sweeps.areas_folder import AreasFolder
from mi_lcair.sweeps.flight import measure_flight
from mi_lcair.sweeps.flight_result import Flight


@exclusively
def flight(
    scenario: Scenario | str | PathLike[str],
    areas: str | PathLike[str] | None = None,
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
    with named_errors(scenario):
        return measure_flight(
            scenario, None if areas is None else AreasFolder(areas), progress=progress
        )
