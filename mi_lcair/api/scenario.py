"""The scenario that a caller of a public function means."""

from collections.abc import Mapping
from os import PathLike

from mi_lcair.detection.scenario import TO_A_TOLERANCE, Scenario
from mi_lcair.errors import InputError


def scenario_of(
    scenario: Scenario | str | PathLike[str],
    parameters: Mapping[str, object] | None = None,
    **sampling: object,
) -> Scenario:
    """The scenario that a caller means.

    Parameters
    ----------
    scenario : Scenario, str or path-like
        Scenario, or the file or bundled name that `Scenario.read` takes.
    parameters : mapping of str to object, optional
        Entries of a scenario that is named, by dotted key such as "sensor.band".
    **sampling
        Entries of [render] of a scenario that is named; those that are None are left out.

    Raises
    ------
    InputError
        If the scenario cannot be used, or if entries are given for one that is read already.
    """
    given = {name: value for name, value in sampling.items() if value is not None}
    if "spp" in given and given.keys() & set(TO_A_TOLERANCE):
        raise InputError(
            "spp sets a fixed number of samples; tolerances and max_spp choose one, and do not go "
            "with it"
        )
    changes = dict(parameters or {}) | {f"render.{name}": value for name, value in given.items()}
    if not isinstance(scenario, Scenario):
        return Scenario.read(scenario, **changes)
    if changes:
        raise InputError(
            f"scenario '{scenario.name}': is read already, so that {', '.join(changes)} cannot be "
            "changed here; Scenario.read takes changes"
        )
    return scenario
