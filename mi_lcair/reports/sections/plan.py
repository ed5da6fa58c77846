"""Sections of a plan."""

from mi_lcair.fraction import percent
from mi_lcair.results.sections import Facts, Section


def sections(plan) -> list[Section]:
    """Settings that a plan chose, and what it leaves out."""
    closure = plan.closure
    if plan.ambient_temperature is not None:
        closure += f" at {plan.ambient_temperature:.1f} K"
    of = "rms over the pixels" if plan.each_pixel else "of the target's intensity"
    lobes = ", ".join(f"{name or 'unnamed'}: {lobe}" for name, lobe in plan.lobe.items())
    rows = [
        ("plan for", plan.scene_name),
        ("tolerance", f"{100 * plan.tolerance:.4g} %"),
        ("lobes", lobes or "no material with a fidelity ladder"),
        ("reflections", f"{plan.max_bounces}, closure {closure}"),
        ("emitter sampling", "on" if plan.emitter_sampling else "off"),
        ("error", f"at most {percent(plan.bias)} of the mean (95 %), {of}"),
        ("left for noise", percent(plan.noise_tolerance)),
        *(("left out", line) for line in plan.left_out or ["nothing"]),
        *(("not tried", line) for line in plan.untried),
    ]
    return [Section("Plan", [Facts(rows)])]
