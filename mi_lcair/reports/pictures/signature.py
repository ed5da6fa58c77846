"""Picture of a signature: intensity by number of reflections and by emitting group."""

import numpy as np

from mi_lcair.drawing import new_figure, plain, styled
from mi_lcair.signatures.effective_areas import PARTS
from mi_lcair.signatures.signature_result import Signature

COLORS = {"target": "C3", "scene": "C0"}
MOST_BARS = 16  # bars in a panel; the smaller ones are left out
NEGLIGIBLE = 1e-3  # parts below this share of the largest one are not drawn
UNIT = r"intensity (W sr$^{-1}$)"


@styled
def figure(signature: Signature):
    """Figure with bars and standard errors for each number of reflections and group.

    The spectrum of a signature is drawn by its `effective_areas`.
    """
    figure = new_figure((11, 3.8), layout="constrained")
    panels = figure.subplots(1, 3, width_ratios=(1.3, 1, 1))
    names = [str(k) for k in range(len(signature.scene.by_bounce))]
    parts = {part: getattr(signature, part) for part in PARTS}
    bounces = {part: (of.by_bounce, of.by_bounce_error) for part, of in parts.items()}
    bars(panels[0], "by number of reflections", names, bounces, "number of reflections")
    for panel, kind, title, label in (
        (panels[1], "group", "by what emitted it", "group that emits"),
        (panels[2], "seen", "by what the sensor sees first", "group that is seen"),
    ):
        names = list(getattr(signature.scene, f"by_{kind}"))
        values = {
            part: (
                [getattr(of, f"by_{kind}")[name] for name in names],
                [getattr(of, f"by_{kind}_error")[name] for name in names],
            )
            for part, of in parts.items()
        }
        bars(panel, title, names, values, label)
    panels[0].legend()
    main = signature.main
    figure.suptitle(
        plain(
            f"{signature.scene_name}, {signature.band}: {signature.main_part} "
            f"{main.intensity:.6g} ± {main.half_width:.2g} W/sr (95 %)"
        )
    )
    return figure


def bars(panel, title: str, names: list[str], values: dict, label: str) -> None:
    """Draw bars of target and scene side by side.

    values: {part: (values, standard errors)} with one entry for each of `names`.
    """
    largest = np.max([np.abs(heights) for heights, _ in values.values()], axis=0)
    order = np.argsort(-largest, kind="stable")[:MOST_BARS]
    kept = np.sort(order[largest[order] >= NEGLIGIBLE * largest.max()])
    width = 0.8 / len(values)
    for number, (part, (heights, errors)) in enumerate(values.items()):
        panel.bar(
            np.arange(len(kept)) + (number - 0.5 * (len(values) - 1)) * width,
            np.array(heights)[kept],
            width,
            yerr=np.array(errors)[kept],
            color=COLORS[part],
            ecolor="black",
            label=part,
        )
    panel.set_xticks(np.arange(len(kept)), [plain(names[k]) for k in kept])
    if max(len(names[k]) for k in kept) > 4 and len(kept) > 4:
        panel.tick_params(axis="x", rotation=45)
    panel.set(title=title, xlim=(-1, len(kept)), xlabel=label, ylabel=UNIT)
