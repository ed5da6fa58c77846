"""How fast trends are: against as many separate signatures, and on a Dask cluster against this
process.

    python -m docs.studies.trend

The cylinder in its range, LWIR, 180 views of 64 x 64 pixels, each intensity to 1 %; then 900 views
to 0.5 %, here and by two worker processes of one thread each. Each side runs once before, so that
no kernel is compiled in what is timed; medians of ROUNDS alternating runs. A few minutes.
"""

import time
from statistics import median

import numpy as np
from distributed import LocalCluster

import mi_lcair

ROUNDS = 5
AZIMUTHS = np.arange(0, 360, 2.0)
ELEVATIONS = (-10.0, 0.0, 10.0, 20.0, 30.0)
SIGNATURE_SPP = 2  # the fewest that tell an error: it is below 1 % already


def together(scene):
    result = mi_lcair.trend(scene, AZIMUTHS)
    return result.columns["standard_error_W_sr"] / result.columns["intensity_W_sr"]


def apart(views=AZIMUTHS):
    errors = []
    for azimuth in views:
        scene = mi_lcair.load("cylinder_ir_range", resolution=64, azimuth_deg=azimuth)
        target = mi_lcair.signature(scene, spp=SIGNATURE_SPP).target
        errors.append(target.standard_error / target.intensity)
    return np.array(errors)


def many(scene, dask=None):
    return mi_lcair.trend(scene, AZIMUTHS, ELEVATIONS, tolerance=0.005, batch=60, dask=dask)


def timed(function, *args):
    start = time.perf_counter()
    result = function(*args)
    return time.perf_counter() - start, result


def main():
    scene = mi_lcair.load("cylinder_ir_range")
    first, _ = timed(together, scene)
    apart(AZIMUTHS[:2])
    rounds = [(*timed(together, scene), *timed(apart)) for _ in range(ROUNDS)]
    one, errors, other, other_errors = zip(*rounds)
    print(
        f"180 views together: {median(one):.2f} s ({first:.2f} s at first, with its compiles), largest error {max(map(max, errors)):.2%}"
    )
    print(
        f"180 signatures apart: {median(other):.2f} s, largest error {max(map(max, other_errors)):.2%}"
    )
    print(
        f"ratio {median(b / a for a, b in zip(one, other)):.1f} (smallest {min(b / a for a, b in zip(one, other)):.1f})"
    )

    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        address = cluster.scheduler_address
        here, there = many(scene), many(scene, address)
        same = all(np.array_equal(here.columns[name], there.columns[name]) for name in here.columns)
        rounds = [(timed(many, scene)[0], timed(many, scene, address)[0]) for _ in range(ROUNDS)]
    print(
        f"900 views here: {median(a for a, _ in rounds):.2f} s; by two workers: {median(b for _, b in rounds):.2f} s; "
        f"speed {median(a / b for a, b in rounds):.2f} of the local one; the same numbers: {same}"
    )


if __name__ == "__main__":
    main()
