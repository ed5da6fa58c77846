"""Draw docs/pictures/overview.png: an image, an intensity all around and a budget of the airliner.

    python -m docs.studies.overview [PICTURE]

The script takes about three minutes on two cores.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import mi_lcair
from mi_lcair.drawing import write_figure

SCENE, BAND = "a340_landing", "MWIR"
SIGMA = {
    "hot_parts.temperature": 20,
    "plume.temperature": 10,
    "self.temperature": 2,
    "terrain.temperature": 2,
    "sky.radiance": "10 %",
    "bare_aluminum.epsilon": 0.02,
    "bare_aluminum.e": 0.001,
}
COLDEST_K, HOTTEST_K = 286, 308  # ends of the colour scale
SIZE = 640  # pixels along a side of the image


def image(axes, figure) -> None:
    """Apparent temperature of the airliner."""
    scene = mi_lcair.load(SCENE, position=2, resolution=SIZE, band=BAND)
    rendered = mi_lcair.render(scene, spp=256)
    kelvin = rendered.channels["temperature.Y"]
    rows, columns = np.nonzero(rendered.channels["target.Y"])
    part = [slice(max(at.min() - 12, 0), at.max() + 12) for at in (rows, columns)]
    drawn = axes.imshow(kelvin[tuple(part)], cmap="inferno", vmin=COLDEST_K, vmax=HOTTEST_K)
    axes.set_axis_off()
    axes.set_title("an airliner on its approach, apparent temperature in MWIR", fontsize=10)
    bar = figure.colorbar(
        drawn, ax=axes, orientation="horizontal", extend="both", pad=0.03, aspect=40
    )
    bar.set_label("K")


def intensity(axes) -> None:
    """Intensity of the airliner all around, with its 95 % intervals."""
    azimuths = np.arange(0, 360, 10)
    trend = mi_lcair.trend(
        SCENE, azimuths, tolerance=0.05, parameters={"position": 2, "band": BAND}
    )
    columns = trend.columns()
    watts, half = columns["intensity_W_sr"], columns["half_width_W_sr"]
    angles = np.radians(np.append(azimuths, 360))
    closed = np.append(watts, watts[0])
    axes.plot(angles, closed, color="C3", lw=1.2)
    axes.errorbar(angles[:-1], watts, half, fmt=".", color="C3", ms=3, elinewidth=1)
    axes.set_rlabel_position(60)
    axes.tick_params(labelsize=8)
    axes.set_title("intensity all around, W/sr, with 95 % intervals", fontsize=10)


def budget(axes) -> None:
    """Contributions to the uncertainty of the intensity."""
    scene = mi_lcair.load(SCENE, position=2, band=BAND)
    made = mi_lcair.budget(scene, {"sigma": SIGMA}, tolerance=0.02)
    rows = [row for row in made.rows if row.contribution][:6][::-1]
    value = made.value
    axes.barh(
        [f"{row.quantity} ± {row.sigma:.2g}" if row.sigma else row.quantity for row in rows],
        [200 * row.contribution / value for row in rows],
        left=[-100 * row.contribution / value for row in rows],
        color="C0",
    )
    axes.axvline(0, color="0.3", lw=0.8)
    axes.tick_params(labelsize=8)
    axes.set_xlabel("change of the intensity, %")
    axes.set_title("what its uncertainty comes from", fontsize=10)


def main(path: str = "docs/pictures/overview.png") -> None:
    figure = Figure((14, 3.9), layout="constrained")
    parts = figure.subfigures(1, 3, width_ratios=(1.6, 1, 1.25))
    image(parts[0].subplots(), parts[0])
    intensity(parts[1].subplots(subplot_kw={"projection": "polar"}))
    budget(parts[2].subplots())
    write_figure(figure, Path(path))


if __name__ == "__main__":
    main(*sys.argv[1:])
