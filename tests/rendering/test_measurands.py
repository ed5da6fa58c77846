"""How a render is sampled: what goes together, what a sensor or a part of the work gets; and the
error of totals compared with the allowed error, by hand.
"""

import re
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import mi_lcair
from mi_lcair.errors import InputError
from mi_lcair.plugins.emission.draw_table import UnmetSources
from mi_lcair.plugins.recorders.channels import PARTS
from mi_lcair.rendering import measurands
from mi_lcair.rendering.measurands import ExcessFunction, IntensityInterval
from mi_lcair.rendering.pixels import PixelError
from mi_lcair.rendering.sampling import Sampling
from mi_lcair.rendering.views import View
from tests.rendering.made_totals import totals
from tests.signatures.rendered_views import render_views

SENSOR = SimpleNamespace(sampler=lambda: SimpleNamespace(sample_count=lambda: 24))
T3 = 3.182446  # half of Student's 95 % interval, for 3 degrees of freedom
OF_FOUR = 1.2909944 / 2  # standard error of the mean of 1, 2, 3, 4


@pytest.mark.parametrize("name", ["spp", "paths", "tolerance", "max_spp"])
@pytest.mark.parametrize("value", [0, -1, float("nan")])
def test_only_positive_numbers(name, value):
    with pytest.raises(InputError, match=f"{name} = {value}; must be positive"):
        Sampling(**{name: value})


@pytest.mark.parametrize("name", ["seed", "sensor"])
def test_numbers_from_0(name):
    with pytest.raises(InputError, match=f"{name} = -1; must (be 0 or more|lie in 0..)"):
        Sampling(**{name: -1})


@pytest.mark.parametrize("name", ["spp", "paths", "max_spp", "seed", "sensor"])
@pytest.mark.parametrize("value", ["many", 2.5, [4], True])
def test_numbers_that_count_are_whole(name, value):
    with pytest.raises(InputError, match=re.escape(f"{name} = {value!r}; must be a whole number")):
        Sampling(**{name: value})


def test_a_tolerance_is_a_number():
    with pytest.raises(InputError, match="tolerance = 'small'; must be a number"):
        Sampling(tolerance="small")


@pytest.mark.parametrize("other", [{"tolerance": 0.1}, {"max_spp": 8}])
def test_a_number_of_samples_or_a_tolerance(other):
    with pytest.raises(InputError, match="spp sets a fixed number of samples"):
        Sampling(spp=4, **other)


def test_limit_of_samples():
    assert Sampling().limit == 65536
    assert Sampling(tolerance=0.1, max_spp=8).limit == 8


def test_the_sensors_own_number_of_samples():
    """It counts where nothing else chooses one."""
    assert Sampling(seed=3).settled(SENSOR) == Sampling(spp=24, seed=3)
    for given in (Sampling(spp=2), Sampling(paths=2), Sampling(tolerance=0.1)):
        assert given.settled(SENSOR) is given


def test_progress_of_the_third_of_four_renders():
    reports = []
    whole = Sampling(spp=4, progress=lambda *work: reports.append(work))
    part = whole.part(2, 4)
    part.progress(5, 10)
    part.progress(10, 10)
    assert reports == [(25, 40), (30, 40)] and part.spp == 4
    assert Sampling(spp=4).part(2, 4) == Sampling(spp=4)


# ------------------------------------------------------------------ Criteria


def tracer_of(systematic_error=0.0, unbounded=()):
    return SimpleNamespace(
        systematic_error=systematic_error, emitters=SimpleNamespace(unbounded=unbounded)
    )


def test_error_of_pixels():
    """Two pixels with the means 2.5 and 7.5, of which the second has no scatter."""
    total = totals([[1, 2, 3, 4], [7.5, 7.5, 7.5, 7.5]])
    assert PixelError(0.1).excess(total) == pytest.approx(OF_FOUR / np.sqrt(2) / 5 / 0.1)


def test_the_error_of_dark_pixels_is_not_known():
    dark = totals(np.zeros(4), unmet=UnmetSources(10.0))
    assert PixelError(0.1).excess(dark) == np.inf


def test_interval_of_the_target():
    """The target has a tenth of the radiance of its background."""
    target = {"target": 64 * np.array([[0.1, 0.2, 0.3, 0.4]])}
    total = totals([11, 12, 13, 14], channels=target)
    assert IntensityInterval(0.05).excess(total) == pytest.approx(T3 * OF_FOUR / 2.5 / 0.05)
    of_all = T3 * OF_FOUR / 12.5 / 0.05
    assert IntensityInterval(0.05, channel=None).excess(total) == pytest.approx(of_all)


def test_the_whole_counts_where_there_is_no_target():
    total = totals([11, 12, 13, 14], channels={"target": np.zeros((1, 4))})
    assert IntensityInterval(0.05).excess(total) == pytest.approx(T3 * OF_FOUR / 12.5 / 0.05)
    assert IntensityInterval(0.05, or_whole=False).excess(total) == np.inf
    assert IntensityInterval(0.05).excess(totals(np.zeros(4), channels=total.sums)) == np.inf


def test_a_function_of_the_totals():
    assert ExcessFunction(lambda total: total.mean()[0]).excess(totals([1, 2, 3, 4])) == 2.5


@pytest.mark.parametrize(
    "criterion, least", [(PixelError, 1e-4), (IntensityInterval, 1.959964e-4)], ids=str
)
def test_what_rounding_leaves_cannot_be_asked_for(criterion, least):
    """Half of a 95 % interval is 1.96 standard errors."""
    tracer = tracer_of(systematic_error=1e-4)
    criterion(1.001 * least).check(tracer, "box")
    with pytest.raises(InputError, match=r"^box: tolerance = .* cannot be reached: .* of 0.000"):
        criterion(0.999 * least).check(tracer, "box")


@pytest.mark.parametrize(
    "criterion", [PixelError(0.1), IntensityInterval(0.1), ExcessFunction(lambda total: 0.0)]
)
def test_no_tolerance_without_a_bound_of_the_radiance(criterion):
    with pytest.raises(InputError, match="box: no tolerance can be confirmed.* lamp, sky; give"):
        criterion.check(tracer_of(unbounded=("lamp", "sky")), "box")


# Limits of a render that are known before it starts
# --------------------------------------------------

GIB = 2**30


@pytest.mark.parametrize("count", ["spp", "max_spp"])
def test_samples(count):
    scene = mi_lcair.load("two_plates", resolution=2)
    tolerance = {"tolerance": 0.1} if count == "max_spp" else {}
    for render in (mi_lcair.render, lambda s, **k: render_views(s, [View(0)], 2, Sampling(**k))):
        with pytest.raises(
            InputError, match=f"{count} = 4294967296; must be positive and at most 4294967295"
        ):
            render(scene, **{count: 2**32}, **tolerance)


def test_paths():
    """A count that a pixel may have, but not each of an image's."""
    scene = mi_lcair.load("two_plates", resolution=1024)
    with pytest.raises(
        InputError, match="spp = 2147483648 through 1048576 pixels are 2.3e\\+15 paths"
    ):
        mi_lcair.render(scene, spp=2**31)
    with pytest.raises(InputError, match="through 1048576 pixels"):
        mi_lcair.render(mi_lcair.load("two_plates", resolution=1024, spp=2**31 - 1))


def test_an_image_that_needs_too_much(monkeypatch):
    """It is refused before anything is rendered, and says how much it needs."""
    monkeypatch.setattr(measurands, "available_memory", lambda: 2 * GIB)
    scene = mi_lcair.load("two_plates", resolution=20_000)
    for parts, needed in ((True, 190.0), (False, 150.9)):
        with pytest.raises(
            InputError, match=f"400000000 pixels needs {needed} GiB of memory, and 2.0 GiB"
        ):
            mi_lcair.render(scene, spp=1, parts=parts)
    assert mi_lcair.render(mi_lcair.load("two_plates", resolution=8), spp=1).mean >= 0
    with pytest.raises(InputError, match=r"1048576 pixels needs 2.3 GiB"):
        measurands.check_memory(2**20, sources=400)


def test_what_is_available(tmp_path):
    """At least what a process may use, at most what the machine has."""
    available = measurands.available_memory()
    assert available is None or 2**20 < available < 2**50


# VmHWM counts from the start of the program; ru_maxrss contains the memory of the process that
# started it.
CODE = """
import re
from pathlib import Path
import mi_lcair
used = []
for resolution in (724, 1024):
    scene = mi_lcair.load("two_plates", resolution=resolution)
    mi_lcair.render(scene, spp=4, parts=bool({parts}))
    status = Path("/proc/self/status").read_text()
    used.append(1024 * int(re.search(r"VmHWM:\\s*(\\d+) kB", status)[1]))
with scene.prepared() as tracer:
    from mi_lcair.rendering import measurands as limits
    from mi_lcair.plugins.recorders.channels import Channels
    channels = limits.channel_count(tracer, Channels("image", {parts}))
stated = limits.BYTES_PER_PIXEL + limits.BYTES_PER_CHANNEL * channels
print((used[1] - used[0]) / (1024**2 - 724**2) / stated)
"""


@pytest.mark.slow
@pytest.mark.parametrize("parts", [PARTS, pytest.param((), marks=pytest.mark.study)])
def test_stated_memory(parts):
    """What an image of a million pixels really takes: no more than stated, and most of it."""
    code = CODE.replace("{parts}", str(parts))
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert 0.5 < float(result.stdout.split()[-1]) < 1.1
