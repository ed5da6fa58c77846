"""`contrast`, the contrast of a scenario at its sensor."""

from collections.abc import Mapping
from os import PathLike

from mi_lcair.api.scenario import scenario_of
from mi_lcair.declared import fraction
from mi_lcair.detection.contrast import measure_contrast
from mi_lcair.detection.contrast_result import Contrast
from mi_lcair.detection.scenario import Scenario
from mi_lcair.errors import errors_of
from mi_lcair.progress import Progress
from mi_lcair.startup.threads import exclusively


@exclusively
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
        Entries of [render] of a scenario that is named, see `RenderTable`. The tolerance may be
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
    with errors_of(f"scenario '{scenario.name}'"):
        return measure_contrast(scenario, progress)
