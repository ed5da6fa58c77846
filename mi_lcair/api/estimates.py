"""Public functions that say how certain a number is, and what it depends on."""

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path

from mi_lcair import scenes
from mi_lcair.api.scenarios import scenario_of
from mi_lcair.api.scenes import sampling_of, scene_of
from mi_lcair.derivatives.shape import ShapeDerivatives, differentiate_shape
from mi_lcair.derivatives.window import Sensitivities, differentiate_intensity
from mi_lcair.detection.scenario import Scenario
from mi_lcair.errors import InputError, check_known, errors_of
from mi_lcair.heating.temperatures.description import HeatDescription
from mi_lcair.knowing.budgets.budget import NUMBERS, Budget, draw_up
from mi_lcair.knowing.budgets.monte_carlo import DRAWS
from mi_lcair.knowing.budgets.uncertainties import Uncertainties
from mi_lcair.knowing.inversion.invert import solve_problem
from mi_lcair.knowing.inversion.solution import Solution
from mi_lcair.knowing.inversion.unknowns import InverseProblem
from mi_lcair.knowing.twin.calibration import HeatCalibration, calibrated
from mi_lcair.knowing.twin.problem import twin_problem
from mi_lcair.progress import Progress
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.scene import SceneLike
from mi_lcair.tasks import exclusively
from mi_lcair.toml_table import plain

# `budget`, the uncertainty budget of an intensity or of a contrast
# -----------------------------------------------------------------


@exclusively
def budget(
    what: SceneLike | Scenario,
    uncertainties: str | PathLike[str] | Mapping | Uncertainties | None = None,
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

    `mi_lcair.knowing.budgets.uncertainties` says how uncertainties are stated.

    Parameters
    ----------
    what : Scene, mi.Scene, Scenario, str or path-like
        A scene with an orthographic sensor, a contrast scenario, or the file or bundled name of
        either. For a scenario given by name or file, `spp`, `tolerance` and `seed` replace the
        entries of its [render]. `sensor` is for scenes only.
    uncertainties : str, path-like, dict, Uncertainties or None
        TOML file with the uncertainties, or its tables as a dictionary: standard deviations,
        covariances, reports of fits. Materials that have a sigma themselves, such as labels of
        surfaces, need no entry.
    sensor, spp, seed
        As for `signature`.
    tolerance : float, str or None
        Trace paths until half of the 95 % interval of the result is at most this fraction of it.
        This is only the error of the rendering.
    draws : int or None
        Also compute the distribution of the result from this number of random draws.
    of : str, optional
        Result of a scenario: "contrast" (default), "apparent_temperature" of the target,
        "detection_range", "snr" or "netd". For a scene the result is always the intensity.
    progress : callable or None
        Called with (renders or draws done, expected).
    parameters : mapping of str to object, optional
        Values of the $-parameters of a scene, or entries of a scenario by dotted key, if it is
        given by name or file.

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
        DRAWS.check(draws, "draws")
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
    """Return whether `what` is a contrast scenario, or the file or bundled name of one."""
    if isinstance(what, (str, PathLike)):
        return Path(what).suffix == ".toml" or str(what) in scenes.scenarios()
    return isinstance(what, Scenario)


# `invert`, the unknowns of a scene from measurements
# ---------------------------------------------------


@exclusively
def invert(
    problem: str | PathLike[str] | dict | InverseProblem,
    advise: bool = True,
    progress: Progress | None = None,
) -> Solution | HeatCalibration:
    """Estimate the unknowns of an inverse problem, or of a heat balance from measured temperatures.

    Parameters
    ----------
    problem : path-like, dict or InverseProblem
        TOML file, its content as a dictionary, or the problem itself.
    advise : bool
        Whether to compute how much further measurements would help, if an unknown is not
        determined.
    progress : callable or None
        Called with (renders of each datum done, largest number).

    Returns
    -------
    Solution or HeatCalibration
        The latter for a problem with the table [heat], see
        `mi_lcair.knowing.twin.problem`.

    Raises
    ------
    InputError
        If the problem, or one of its files or scenes, cannot be used.
    """
    if (of_heat := twin_problem(problem)) is not None:
        description = HeatDescription.read(of_heat.heat.file)
        target = description.target
        scene = scene_of(target.scene, target.parameters)
        return calibrated(scene, description, of_heat, advise, progress)
    if isinstance(problem, dict):
        problem = InverseProblem.of(plain(problem))
    elif not isinstance(problem, InverseProblem):
        problem = InverseProblem.read(problem)
    with errors_of(f"problem '{problem.name}'"):
        return solve_problem(problem, advise, progress)


# `sensitivities`, an intensity and its derivatives
# -------------------------------------------------


@exclusively
def sensitivities(
    scene: SceneLike,
    names: Sequence[str],
    *,
    sensor: int = 0,
    part: str = "target",
    weights: Mapping | None = None,
    spp: int | None = None,
    paths: int | None = None,
    tolerance: float | str | None = None,
    seed: int = 0,
    progress: Progress | None = None,
    parameters: Mapping[str, object] | None = None,
) -> Sensitivities:
    """Intensity and its derivatives with respect to parameters, all from the same paths.

    Derivatives with respect to temperatures, radiances and emissivities of emitters follow exactly
    from the intensity, because the radiance is linear in its sources. Derivatives with respect to
    parameters of materials are estimated from the derivatives of the path weights. A control
    variate is used if it reduces the noise of a short test run (see `plugins.recorders.columns`).

    Parameters
    ----------
    scene : Scene, str, Path or mi.Scene
        A loaded scene, or what `mi_lcair.load` takes: a bundled name, a file, Mitsuba's own scene.
        Its sensor must be orthographic.
    names : sequence of str
        Names of parameters, see `mi_lcair.rendering.parameters.values`.
    sensor, spp, tolerance, seed, progress
        As for `signature`.
    part : str
        "target" (the model's facets) or "scene".
    weights : mapping or None
        Factor of each source's intensity in the sum, by (group, name of the spectrum) as in
        `Source`. None: the sum over all sources without factors.
    paths : int or None
        Number of paths in place of `spp`.
    parameters : mapping of str to object, optional
        Values of the scene's $-parameters, for a name or a file.

    Returns
    -------
    Sensitivities

    Raises
    ------
    InputError
        If a name is unknown, if a parameter has no derivative, and as for `signature`.
    """
    sampling = sampling_of(
        spp=spp, paths=paths, tolerance=tolerance, seed=seed, sensor=sensor, progress=progress
    )
    scene = scene_of(scene, parameters)
    return differentiate_intensity(scene, names, sampling, part, weights)


# `shape_derivatives`, which part of a surface to move
# ----------------------------------------------------


@exclusively
def shape_derivatives(
    scene: SceneLike,
    group: str,
    *,
    sensor: int = 0,
    spp: int | None = None,
    paths: int | None = None,
    seed: int = 0,
    progress: Progress | None = None,
    parameters: Mapping[str, object] | None = None,
) -> ShapeDerivatives:
    """Derivatives of the target's intensity with respect to all vertices of a group at once.

    Each vertex moves along its outward normal. Vertices of other groups at the same position move
    with it. The derivative includes the turning of facets, hidden surfaces and reflections in other
    surfaces. It does not include the shadows of transmitting plumes.

    Parameters
    ----------
    scene : Scene, str, Path or mi.Scene
        A loaded scene, or what `mi_lcair.load` takes: a bundled name, a file, Mitsuba's own scene.
        Its sensor must be orthographic, and its model must consist of meshes.
    group : str
        Group of the model whose surface moves.
    spp : int or None
        Paths per pixel of the sensor's film: the number of paths is spp x pixels (default: the
        scene's number).
    sensor, seed
        As for `signature`.
    paths : int or None
        Number of paths in place of `spp`.
    progress : callable, optional
        Called with (renders done, all renders).
    parameters : mapping of str to object, optional
        Values of the scene's $-parameters, for a name or a file.

    Returns
    -------
    ShapeDerivatives

    Raises
    ------
    InputError
        If the group is unknown, if a part of the model is not a mesh, for closure = tail, and as
        for `signature`.
    """
    sampling = Sampling(spp=spp, paths=paths, seed=seed, sensor=sensor, progress=progress)
    return differentiate_shape(scene_of(scene, parameters), group, sampling)
