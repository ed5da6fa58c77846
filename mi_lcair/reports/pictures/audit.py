"""Picture of an audit: where the flux goes, for the scene and for each material."""

import numpy as np

from mi_lcair.drawing import new_figure, plain, styled
from mi_lcair.energy.audit_result import Audit

ENDS = ("absorbed", "escaped", "behind", "unfinished")  # where the emitted flux of a scene goes
OF_MATERIAL = ("absorbed", "reflected", "behind")  # where the flux that arrives goes
COLORS = {"absorbed": "C0", "reflected": "C2", "escaped": "C1", "behind": "C3", "unfinished": "C4"}
MOST_MATERIALS = 20  # materials with a bar, those with the largest incident flux


@styled
def figure(audit: Audit):
    """Figure with a bar for the scene and for each material, in percent.

    The bar of the scene divides the emitted flux, that of a material the flux that arrives there.
    What is missing to 100 % is lost, and what exceeds it is created. The line at the end of a bar
    is the standard error of created flux.
    """
    order = sorted(audit.materials, key=lambda name: -audit.materials[name]["incident"][0])
    names = ["scene", *order[:MOST_MATERIALS]]
    figure = new_figure((9, 1.9 + 0.34 * len(names)), layout="constrained")
    panel = figure.subplots()
    places = np.arange(len(names))
    ends = np.zeros(len(names))
    for kind, color in COLORS.items():
        shares = np.array(
            [
                100 * audit.shares[name][kind][0]
                if kind in (ENDS if name == "scene" else OF_MATERIAL)
                else 0.0
                for name in names
            ]
        )
        if shares.any():
            panel.barh(places, shares, left=ends, height=0.65, color=color, label=kind)
        ends += shares
    errors = [100 * audit.shares[name]["created"][1] for name in names]
    panel.errorbar(ends, places, xerr=errors, fmt="none", ecolor="black", capsize=3)
    panel.axvline(100, color="black", linewidth=0.8, linestyle=":")
    panel.set_yticks(places, [plain(name) for name in names], fontsize=8)
    panel.invert_yaxis()
    panel.set_ylabel("scene, and materials")
    panel.set_xlabel("share of the flux that the scene emits, or that arrives at a material (%)")
    figure.legend(loc="outside lower center", ncols=len(COLORS))
    flux, error = audit.total["emitted"]
    left_out = len(order) - len(names) + 1
    more = f"; {left_out} more materials" if left_out else ""
    title = f"{audit.scene_name}, {audit.band}: {flux:.5g} ± {error:.2g} W emitted{more}"
    figure.suptitle(plain(title))
    return figure
