"""Larger pieces of work: a trend, a sweep, a fit, the start of the command, memory."""

import subprocess
import sys

import numpy as np

import mi_lcair
from benchmarks.timing import ratio

TIMEOUT = 900  # seconds after which asv gives a benchmark up
AZIMUTHS = np.arange(0, 360, 2.0)


def track_trend(azimuths=AZIMUTHS, tolerance=0.01, rounds=3):
    """Time of separate signatures of 180 views / of one trend, to one tolerance."""
    scene = mi_lcair.load("cylinder_ir_range")

    def apart(seed):
        for azimuth in azimuths:
            view = mi_lcair.load("cylinder_ir_range", azimuth_deg=azimuth)
            mi_lcair.signature(view, tolerance=tolerance, seed=seed)

    together = lambda seed: mi_lcair.trend(scene, azimuths, tolerance=tolerance, seed=seed)
    return ratio(apart, together, rounds)


track_trend.unit = "apart / together"


def track_sweep(azimuths=AZIMUTHS[::15], ranges=(500, 1000, 2000, 4000), rounds=3):
    """Time of separate contrasts over aspects and ranges / of one sweep, with as many paths."""
    scenario, sampling = "a340_landing/position_1", {"resolution": 64, "spp": 2}
    conditions = {"azimuth_deg": list(map(float, azimuths)), "range_m": list(ranges)}

    def apart(seed):
        common = {f"render.{name}": value for name, value in sampling.items()}
        common |= {"render.max_bounces": 10, "render.seed": seed}
        for azimuth in azimuths:
            for range_m in ranges:
                line = {"observer.azimuth_deg": float(azimuth), "observer.range_m": range_m}
                mi_lcair.contrast(scenario, parameters=common | line)

    def together(seed):
        tables = {"base": {"scenario": scenario}, "conditions": conditions}
        mi_lcair.sweep(tables | {"sampling": sampling | {"seed": seed}})

    return ratio(apart, together, rounds)


track_sweep.unit = "apart / together"


def measurements(step_deg=2.0):
    """In-plane scans of a surface with a broad lobe, with 5 % noise."""
    from drjit.llvm.ad import Array3f64, Float64

    from mi_lcair.fitting.scatterometer.reading import Measurements
    from mi_lcair.physics.reflection.models import MODELS

    model = MODELS["sandford_robertson"]
    angles = np.meshgrid([20.0, 40.0, 60.0], np.arange(-80, 80 + step_deg / 2, step_deg))
    theta_i, theta_r = (np.radians(values.ravel()) for values in angles)
    surface = model.surface(*map(Float64, (0.30, 0.20, 0.40, 0.25)), form=model.forms[0])
    i = Array3f64(Float64(np.sin(theta_i)), 0, Float64(np.cos(theta_i)))
    r = Array3f64(Float64(-np.sin(theta_r)), 0, Float64(np.cos(theta_r)))
    noise = 1 + 0.05 * np.random.default_rng(0).standard_normal(len(theta_i))
    values = np.array(model.f(surface, i, r)) * noise
    return Measurements(theta_i, theta_r, values, name="synthetic")


def track_fit(starts=64, rounds=3):
    """Time of a fit with 64 starts / with one start: the starts share one launch."""
    data = measurements()
    run = lambda count: (
        lambda seed: mi_lcair.fit(
            data, model="sandford_robertson", form="thesis", starts=count, seed=seed
        )
    )
    return ratio(run(starts), run(1), rounds)


track_fit.unit = "64 starts / 1 start"


def process(*arguments):
    """Function of a seed that runs Python with these arguments."""
    return lambda seed: subprocess.run(
        [sys.executable, *arguments], check=True, capture_output=True
    )


def track_help(rounds=9):
    """Time of `mi-lcair --help` / of a Python that does nothing."""
    return ratio(process("-m", "mi_lcair", "--help"), process("-c", ""), rounds)


track_help.unit = "command / bare Python"


def track_command(rounds=5):
    """Time of a whole `mi-lcair signature` / of a Python that only imports Mitsuba."""
    arguments = ("signature", "two_plates", "--tolerance", "1%")
    bare = "import mi_lcair, mitsuba; mitsuba.set_variant('llvm_ad_mono')"
    return ratio(process("-m", "mi_lcair", *arguments), process("-c", bare), rounds)


track_command.unit = "command / import"


def peakmem_image(resolution=512, spp=64):
    """Memory of an image with its channels."""
    scene = mi_lcair.load("cylinder_ir_range", resolution=resolution)
    mi_lcair.render(scene, spp=spp)


def peakmem_signature(paths=2**23):
    """Memory of an intensity."""
    scene = mi_lcair.load("cylinder_ir_range", resolution=1)
    mi_lcair.signature(scene, spp=paths)


for benchmark in (
    track_trend,
    track_sweep,
    track_fit,
    track_help,
    track_command,
    peakmem_image,
    peakmem_signature,
):
    benchmark.timeout = TIMEOUT
