"""Draw layers of the truth by pixel: the airliner on its approach in a camera's frame.

    python -m docs.studies.truth_layers [PICTURE]

It writes PICTURE (default docs/pictures/truth.png). It takes about a minute on two cores.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.colors import LogNorm, Normalize

import mi_lcair
from docs.studies.camera import scenario
from mi_lcair.drawing import new_figure, styled, write_figure
from mi_lcair.rendering.images.truth import Truth

RANGE_M, WIDTH, HEIGHT, SPP = 250.0, 800, 300, 256
PANELS = {
    "IndexFacet.X": "number of the facet",
    "IndexGroup.X": "number of the group",
    "Depth.Z": "depth (m)",
    "Normal": "normal",
    "true_temperature.Y": "true temperature (K)",
    "emissivity.Y": "emissivity along the view",
    "emitted.Y": "emitted (W m⁻² sr⁻¹)",
    "reflected": "reflected (W m⁻² sr⁻¹)",
    "apparent_temperature.Y": "apparent temperature (K)",
    "stderr.apparent_temperature.Y": "its standard error (K)",
}
LOGARITHMIC = ("emissivity.Y", "emitted.Y", "reflected", "stderr.apparent_temperature.Y")
COLOURS = 977  # by which numbers of facets are spread over the colours, so that neighbours differ


def layer(truth: Truth, name: str) -> np.ndarray:
    """A layer (H, W), a sum of layers, or normals as colours (H, W, 3)."""
    if name == "Normal":
        return np.stack([0.5 + 0.5 * truth.channels[f"Normal.{axis}"] for axis in "XYZ"], axis=-1)
    if name == "reflected":
        return sum(v for key, v in truth.channels.items() if key.startswith("reflected."))
    values = truth.channels[name]
    return (values * COLOURS) % 256 if name == "IndexFacet.X" else values


@styled
def picture(truth: Truth):
    """The PANELS around the target, with colour bars."""
    rows, columns = np.nonzero(truth.channels["mask.Y"])
    around = np.s_[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
    figure = new_figure((10, 9), layout="constrained")
    on = truth.ids("instance")[around] > 0
    for axes, (name, title) in zip(figure.subplots(5, 2).ravel(), PANELS.items()):
        values = layer(truth, name)[around]
        is_number = name.startswith("Index")
        if name == "Normal":
            axes.imshow(np.where(on[..., None], values, 1), interpolation="nearest")
        else:
            ends = np.quantile(values[on], (0, 1) if is_number else (0.02, 0.995))
            norm = LogNorm if name in LOGARITHMIC else Normalize
            shown = axes.imshow(
                np.where(on, values, np.nan),
                cmap="turbo" if is_number else "viridis",
                interpolation="nearest",
                norm=norm(*ends, clip=True),
            )
            if name != "IndexFacet.X":
                figure.colorbar(shown, ax=axes, extend="neither" if is_number else "both")
        axes.set_title(f"{title}: {name}")
        axes.set_xticks([])
        axes.set_yticks([])
    return figure


def main(path: Path) -> None:
    """Record the frame and draw its truth."""
    made = scenario(RANGE_M)
    camera = replace(made.camera, width=WIDTH, height=HEIGHT)
    render = replace(made.render, spp=SPP, tolerance=None)
    truth = mi_lcair.image(replace(made, camera=camera, render=render), truth=True).truth
    write_figure(picture(truth), path)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/pictures/truth.png"))
