"""Picture of the exchange of heat: where radiation of the groups goes."""

import numpy as np

from mi_lcair.drawing import new_figure, plain, styled
from mi_lcair.heating.conductors import RINGS_DEG
from mi_lcair.heating.exchange_result import Exchange


@styled
def figure(exchange: Exchange):
    """Figure of the shares of what each group emits."""
    from matplotlib import colormaps

    C, facets = exchange.conductors.by_group(exchange.facets), exchange.facets
    names = [plain(name) for name in facets.groups]
    emitted = facets.membership @ facets.emitting_area
    figure = new_figure((7.5, 3 + 0.45 * len(names)), layout="constrained")
    bars = figure.subplots()

    blues = colormaps["Blues"](np.linspace(0.85, 0.25, len(RINGS_DEG) - 1))
    parts = [
        (f"sky, {low:g}-{high:g}°", C.to_sky[:, k], blues[k])
        for k, (low, high) in enumerate(zip(RINGS_DEG, RINGS_DEG[1:]))
    ]
    parts += [
        ("ground", C.parts["ground"], "C2"),
        ("the group itself", C.parts["itself"], "0.6"),
        ("other groups", C.parts["others"], "C1"),
        ("inside bodies", facets.share_of_groups(exchange.astray["buried"]) * emitted, "0.9"),
    ]
    left = np.zeros(len(names))
    for label, values, color in parts:
        bars.barh(names, values / emitted, left=left, color=color, label=label)
        left = left + values / emitted
    bars.set(xlabel="share of what the group emits", xlim=(0, 1.02), title="where it is absorbed")
    bars.invert_yaxis()
    bars.legend(fontsize=7, ncols=4, loc="upper center", bbox_to_anchor=(0.5, -0.22))
    figure.suptitle(plain(exchange.summary()), fontsize=10)
    return figure
