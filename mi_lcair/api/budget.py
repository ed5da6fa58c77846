"""`budget`, the uncertainty budget of an intensity or of a contrast."""

from collections.abc import Mapping
from os import PathLike
from pathlib import Path

from mi_lcair import scenes
from mi_lcair.api.load import sampling_of, scene_of
from mi_lcair.api.scenario import scenario_of
from mi_lcair.detection.scenario import Scenario
from mi_lcair.errors import InputError, check_known
from mi_lcair.progress import Progress
from mi_lcair.rendering.scene import SceneLike
from mi_lcair.startup.threads import exclusively
from mi_lcair.uncertainty.budget import NUMBERS, Budget, draw_up
from mi_lcair.uncertainty.monte_carlo import check_draws
from mi_lcair.uncertainty.uncertainties import Uncertainties


@exclusively
def budget(
    what: SceneLike | Scenario,
    uncertainties: str | PathLike[str] | Mapping | Uncertainties,
    *,
    sensor: int = 0,
    spp: int | None = None,
    tolerance: float | str | None = None,
    seed: int = 0,
    draws: int | None = None,
    of: str | None = None,
    progress: Progress | None = None,
    parameters: Mapping[str, object] | None = None,
) -> Budget:
    """Uncertainty budget of a target's intensity, or of a result of a scenario.

    Parameters
    ----------
    what : Scene, mi.Scene, Scenario, str or path-like
        A scene with an orthographic sensor, a contrast scenario, or the file or the bundled name of
        either.
    uncertainties : str, path-like, dict or Uncertainties
        TOML file with the uncertainties, or its tables as a dictionary, see
        `mi_lcair.uncertainty.uncertainties`.
    sensor, spp, tolerance, seed
        As for `signature`. A scenario has no sensor. The others replace the entries of [render] of
        a scenario that is named.
    draws : int or None
        Also compute the distribution of the result from this number of random draws.
    of : str, optional
        What the budget of a scenario is of: "contrast" (default), "apparent_temperature" of the
        target, "detection_range", "snr" or "netd". A scene's is of the intensity.
    progress : callable or None
        Called with (renders or draws done, expected).
    parameters : mapping of str to object, optional
        Values of the $-parameters of a scene, or entries of a scenario by dotted key, where it is
        named.

    Returns
    -------
    Budget

    Raises
    ------
    InputError
        If the uncertainties name something that the scene does not have, or anything else cannot be
        used.
    """
    stated = Uncertainties.read(uncertainties)
    if draws is not None:
        check_draws(draws)
    sampling = sampling_of(
        spp=spp, tolerance=tolerance, seed=seed, sensor=sensor, progress=progress
    )
    check_known("result of a budget", NUMBERS, of)
    if is_scenario(what):
        if sensor:
            raise InputError("sensor is one of a scene; a scenario has its observer")
        what = scenario_of(
            what, parameters, spp=spp, tolerance=sampling.tolerance, seed=seed or None
        )
    else:
        if of is not None:
            raise InputError(f"{of} is a result of a scenario; that of a scene is its intensity")
        what = scene_of(what, parameters)
    return draw_up(what, stated, sampling, draws, of or "contrast")


def is_scenario(what: object) -> bool:
    """Whether it is a contrast scenario, or the file or the bundled name of one."""
    if isinstance(what, (str, PathLike)):
        return Path(what).suffix == ".toml" or str(what) in scenes.scenarios()
    return isinstance(what, Scenario)
