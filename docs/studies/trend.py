"""Measure the speed of `trend` against separate signatures.

    python -m docs.studies.trend

The scene is the cylinder in its range, in LWIR. There are 180 views of 64 x 64 pixels, each
intensity to 1 %. Everything runs once before it is timed, so that kernels are compiled. Times are
medians of ROUNDS alternating runs. The script takes a few minutes.
"""

import time
from statistics import median

import numpy as np

import mi_lcair

ROUNDS = 5  # number of timed runs of each variant
AZIMUTHS = np.arange(0, 360, 2.0)
TOLERANCE = 0.01  # half of the 95 % interval of each intensity


def together(scene):
    """Render all views by one trend; return half of their 95 % intervals, relative."""
    result = mi_lcair.trend(scene, AZIMUTHS, tolerance=TOLERANCE)
    return result.table["half_width_W_sr"] / result.table["intensity_W_sr"]


def apart(views=AZIMUTHS):
    """Render each view by a signature of its own; return half of their 95 % intervals, relative."""
    errors = []
    for azimuth in views:
        scene = mi_lcair.load("cylinder_ir_range", resolution=64, azimuth_deg=azimuth)
        target = mi_lcair.signature(scene, tolerance=TOLERANCE).target
        errors.append(target.half_width / target.intensity)
    return np.array(errors)


def timed(function, *args):
    """Return the seconds that a call takes, and its result."""
    start = time.perf_counter()
    result = function(*args)
    return time.perf_counter() - start, result


def main():
    scene = mi_lcair.load("cylinder_ir_range")
    first, _ = timed(together, scene)
    apart(AZIMUTHS[:2])
    rounds = [(*timed(together, scene), *timed(apart)) for _ in range(ROUNDS)]
    trend_times, trend_errors, signature_times, signature_errors = zip(*rounds)
    ratios = [b / a for a, b in zip(trend_times, signature_times)]
    print(
        f"180 views together: {median(trend_times):.2f} s "
        f"({first:.2f} s at first, with its compiles), "
        f"largest half width {max(map(max, trend_errors)):.2%}"
    )
    print(
        f"180 signatures apart: {median(signature_times):.2f} s, "
        f"largest half width {max(map(max, signature_errors)):.2%}"
    )
    print(f"ratio {median(ratios):.1f} (smallest {min(ratios):.1f})")


if __name__ == "__main__":
    main()
