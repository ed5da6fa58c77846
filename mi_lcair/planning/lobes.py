"""Simpler lobes for the materials of a scene, as far as probes show that they suffice."""

from dataclasses import replace

from mi_lcair.physics.reflection.interface import Rung
from mi_lcair.planning.probe import Probe, ProbeSeries, Settings, difference
from mi_lcair.rendering.scene import Scene


def simpler_lobes(
    probes: ProbeSeries,
    settings: Settings,
    reference: Probe,
    error: float,
    more_error: float,
    budget: float,
) -> tuple[Settings, float, Probe | None, list[str]]:
    """The simplest lobes with which the error of all simplifications stays within `budget`.

    Parameters
    ----------
    probes : ProbeSeries
        Probes of the scene.
    settings : Settings
        Settings so far.
    reference : Probe
        Probe under full fidelity.
    error : float
        Upper bound (95 %) of the error of `settings`, as a fraction of the mean radiance.
    more_error : float
        Part of it that probes do not see, because it is the same in all randomisations.
    budget : float
        Error that is allowed.

    Returns
    -------
    settings : Settings
        `settings` with simpler lobes.
    error : float
        Upper bound of their error.
    probe : Probe or None
        Probe under them; None if no lobe was changed.
    left_out : list of str
        One line for each lobe that is an approximation.
    """
    left_out, probe = [], None
    for material, rung in candidates(probes.scene, exact=False).items():
        trial = replace(settings, lobe=settings.lobe | {material: rung})
        trial_probe = probes(trial)
        # The difference from full fidelity contains the errors of all simplifications so far.
        gap = (trial_probe.value - reference.value) / reference.mean
        bound = difference(gap, probes.each_pixel) + more_error
        if bound <= budget:
            left_out.append(
                f"the BRDF of {material or 'an unnamed material'}, taken as {rung}: error so far "
                f"at most {bound:.2g} of the mean"
            )
            settings, error, probe = trial, bound, trial_probe
    return settings, error, probe, left_out


def candidates(scene: Scene, exact: bool) -> dict[str, str]:
    """The lower rungs of the fidelity ladder that are exact, or those that are not, by material."""
    return {material: rung.lobe for material, rung in rungs(scene).items() if rung.exact == exact}


def rungs(scene: Scene) -> dict[str, Rung]:
    """The lower rung of the fidelity ladder by material, for materials that have one.

    Surfaces whose material has the same name are changed together. They are left out if their
    rungs differ, or if one of them has none.
    """
    of_materials = {}
    for surface in scene.surfaces():
        rung = surface.model.lower_rung(*surface.values, form=surface.form)
        of_materials.setdefault(surface.material, []).append(rung)
    return {
        material: Rung(of_surfaces[0].lobe, exact=all(rung.exact for rung in of_surfaces))
        for material, of_surfaces in of_materials.items()
        if None not in of_surfaces and len({rung.lobe for rung in of_surfaces}) == 1
    }
