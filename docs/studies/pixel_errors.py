"""Measure how often the intervals of pixels hold the truth, in 20 views.

    python -m docs.studies.pixel_errors

It prints a row for each view: the share of the pixels whose layer of `--truth` is within 1.96
standard errors of that of a render with LONG times as many paths. It takes about five minutes of
processor time.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np
from tqdm import tqdm

import mi_lcair
from docs.studies.camera import scenario
from mi_lcair.rendering.images.truth import Truth

SPP, LONG, SIDE = 64, 64, 48
LAYERS = ("Y", "emitted.Y", "reflected", "apparent_temperature.Y")
VIEWS = [
    *(
        ("a340_landing", {"position": position, "band": band})
        for position, band in product((1, 2, 3), ("MWIR", "LWIR"))
    ),
    *(
        ("a340_landing", {"position": position, "light": "day", "sky": "midlat_summer_clear"})
        for position in (1, 2)
    ),
    ("a340_landing", {"position": 2, "plume_transmittance": 0.8}),
    *(("cylinder_ir_range", {"band": band}) for band in ("MWIR", "LWIR")),
    *(("cylinder_ir_range", {"band": "LWIR", "azimuth_deg": azimuth}) for azimuth in (30, 60)),
    *(("furnace", {"band": band}) for band in ("MWIR", "LWIR")),
    ("open_box", {}),
    ("two_plates", {}),
    ("cavity", {"opening": 24, "window": 0.5}),
]
RANGES_M = (500.0, 2000.0)  # of the airliner in a camera's frame


def frame(range_m: float, spp: int, seed: int) -> Truth:
    """The truth of a frame of the airliner at a range."""
    made = scenario(range_m)
    camera = replace(made.camera, width=160, height=128)
    render = replace(made.render, spp=spp, tolerance=None, seed=seed)
    return mi_lcair.image(replace(made, camera=camera, render=render), truth=True).truth


def held(short: Truth, long: Truth, layer: str) -> tuple[float, float]:
    """Share of the pixels within 1.96 errors of the long render, and mean squared z-score.

    layer: a name, or the beginning of the names of several. Pixels without scatter do not count:
    those whose error is below a ten-thousandth of the largest radiance.
    """
    z = []
    for name in short.channels:
        if name == layer or name.startswith(f"{layer}."):
            error = np.hypot(short.channels[f"stderr.{name}"], long.channels[f"stderr.{name}"])
            difference = short.channels[name].astype(float) - long.channels[name]
            counts = error > 1e-4 * np.abs(long.channels[name]).max()
            z.append(difference[counts] / error[counts])
    z = np.concatenate(z)
    return (float(np.mean(np.abs(z) <= 1.96)), float(np.mean(z**2))) if z.size else (np.nan,) * 2


def views() -> Iterator[tuple[str, Truth, Truth]]:
    """Name of each view, and its truth of SPP and of LONG * SPP paths through a pixel."""
    for name, parameters in VIEWS:
        scene = mi_lcair.load(name, resolution=SIDE, **parameters)
        yield (
            " ".join([name, *map(str, parameters.values())]),
            *(
                mi_lcair.render(scene, spp=spp, seed=seed, truth=True).truth
                for spp, seed in ((SPP, 1), (LONG * SPP, 2))
            ),
        )
    for range_m in RANGES_M:
        yield f"frame at {range_m:g} m", frame(range_m, SPP, 1), frame(range_m, LONG * SPP, 2)


def main() -> None:
    """Print the table."""
    rows = {name: [] for name in ("view", *LAYERS, "rms z of Y")}
    for view, short, long in tqdm(views(), total=len(VIEWS) + len(RANGES_M)):
        whole = "Y" if "Y" in short.channels else "target.Y"
        rows["view"].append(view)
        for layer in LAYERS:
            rows[layer].append(held(short, long, whole if layer == "Y" else layer)[0])
        rows["rms z of Y"].append(np.sqrt(held(short, long, whole)[1]))
    rows["view"].append("mean")
    for layer in (*LAYERS, "rms z of Y"):
        rows[layer].append(float(np.nanmean(rows[layer])))
    for values in zip(*rows.values()):
        print(*(f"{v:.3f}" if isinstance(v, float) else f"{v:48}" for v in values))


if __name__ == "__main__":
    main()
