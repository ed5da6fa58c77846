"""Simpler lobes for the materials of a scene, as far as probes show that they suffice."""

from dataclasses import replace

from mi_lcair.physics.reflection.interface import Rung
from mi_lcair.planning.probe import Probe, ProbeSeries, Settings, difference
from mi_lcair.rendering.scene import Scene


def simpler_lobes(
    probes: ProbeSeries, full: Settings, reference: Probe, budget: float
) -> tuple[dict[str, str], float, Probe, list[str]]:
    """The simplest lobes whose error stays within `budget`.

    Parameters
    ----------
    probes : ProbeSeries
        Probes of the scene.
    full : Settings
        Settings of full fidelity.
    reference : Probe
        Probe under `full`.
    budget : float
        Error that is allowed, as a fraction of the mean radiance.

    Returns
    -------
    lobe : dict of str to str
        Lobe by material.
    error : float
        Upper bound (95 %) of the error of all changes together.
    probe : Probe
        Probe under these lobes.
    left_out : list of str
        One line for each lobe that is an approximation.
    """
    lobe, error, left_out, lobe_probe = dict(full.lobe), 0.0, [], reference
    for material, rung in candidates(probes.scene).items():
        trial = lobe | {material: rung.lobe}
        if rung.exact:  # the same reflection, evaluated faster: no probe is needed
            lobe = trial
            continue
        trial_probe = probes(replace(full, lobe=trial))
        # The difference from the reference bounds the error of all changes so far together.
        bound = difference(trial_probe, reference, probes.each_pixel)
        if bound <= budget:
            left_out.append(
                f"the BRDF of {material or 'an unnamed material'}, taken as {rung.lobe}: error of "
                f"the lobes so far at most {bound:.2g} of the mean"
            )
            lobe, error, lobe_probe = trial, bound, trial_probe
    return lobe, error, lobe_probe, left_out


def candidates(scene: Scene) -> dict[str, Rung]:
    """The lower rung of the fidelity ladder by material, for materials that have one.

    Surfaces whose material has the same name are changed together. They are left out if their
    rungs differ, or if one of them has none.
    """
    rungs = {}
    for surface in scene.surfaces():
        rung = surface.model.lower_rung(*surface.values, form=surface.form)
        rungs.setdefault(surface.material, []).append(rung)
    return {
        material: Rung(of_surfaces[0].lobe, exact=all(rung.exact for rung in of_surfaces))
        for material, of_surfaces in rungs.items()
        if None not in of_surfaces and len({rung.lobe for rung in of_surfaces}) == 1
    }
